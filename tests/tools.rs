//! Instruments in the ECS: poses, contacts, what they do, and sessions with devices that are stepped.

#[path = "tools/acts.rs"]
mod acts;
#[path = "tools/burrs.rs"]
mod burrs;
#[path = "tools/contacts.rs"]
mod contacts;
#[path = "tools/devices.rs"]
mod devices;
#[path = "tools/drilling.rs"]
mod drilling;
#[path = "tools/order.rs"]
mod order;
#[path = "tools/sessions.rs"]
mod sessions;

use crate::support::sphere_organ;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrShape};
use glam::{DVec2, DVec3};

/// A ball of an organ around the origin, metres.
const RADIUS_M: f32 = 0.05;

/// An app with such an organ that reacts.
fn with_organ() -> (TestApp, Entity) {
    let mut app = TestApp::cpu();
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
    let organ = app.world_mut().spawn((Organ(organ), Reactions::default())).id();
    app.step(2);
    (app, organ)
}

fn structure(name: &str, hardness: f32) -> Structure {
    Structure {
        name: name.into(),
        colour: [230, 220, 200],
        tissue: Tissue::CorticalBone,
        hardness,
        bleeding_ml_per_s_mm3: 0.0,
        is_critical: false,
    }
}

/// Bone that fills z < 0 of a box of 64^3 voxels of half a millimetre; soft (label 2) for x > 0.
fn slab() -> Volume {
    let grid = VolumeGrid::upright(UVec3::splat(64), DVec3::splat(0.5));
    let volume_from_voxel = grid.volume_from_voxel();
    let (mut labels, mut solid) = (vec![0; grid.count()], vec![0; grid.count()]);
    for place in 0..grid.count() as u32 {
        let voxel = UVec3::new(place % 64, place / 64 % 64, place / 4096);
        let at_m = volume_from_voxel.transform_point3(voxel.as_vec3());
        if at_m.z < 0.0 {
            (labels[place as usize], solid[place as usize]) = (if at_m.x > 0.0 { 2 } else { 1 }, 255);
        }
    }
    let structures = Structures::new(vec![structure("hard", 1.0), structure("soft", 0.25)], labels, solid.clone());
    let volume = Volume::new(grid, Voxels::U8(solid), 1.0, 0.0).expect("a volume");
    volume.with_structures(structures.expect("two structures")).expect("of the same size")
}

fn with_bone(transform: Transform) -> (TestApp, Entity) {
    let mut app = TestApp::cpu();
    let volume = app.world_mut().resource_mut::<Assets<Volume>>().add(slab());
    let bone = app.world_mut().spawn((CtVolume(volume), transform)).id();
    app.step(2);
    (app, bone)
}

/// A drill with a ball of 4 mm.
fn drill() -> Tool {
    let burr = Burr { kind: BurrKind::Cutting, shape: BurrShape::Sphere, diameter_m: 4e-3 };
    Tool::new(ToolKind::Drill(DrillHead { burr, ..default() }))
}

/// Puts a tool somewhere with its shaft up, for the next step.
fn hold(app: &mut TestApp, tool: Entity, tip_m: Vec3, pedal: f32) {
    let pose = ToolPose::with_shaft_towards(tip_m, tip_m + Vec3::Y);
    app.world_mut().entity_mut(tool).insert((pose, ToolCommand { pedal, ..default() }));
}

fn contacts(app: &TestApp, tool: Entity) -> &ToolContacts {
    app.world().get::<ToolContacts>(tool).expect("every tool has some")
}

fn motion(app: &TestApp, tool: Entity) -> &ToolMotion {
    app.world().get::<ToolMotion>(tool).expect("every tool has one")
}

/// The messages of the last step.
fn written<M: Message + Clone>(app: &TestApp) -> Vec<M> {
    let messages = app.world().resource::<Messages<M>>();
    messages.iter_current_update_messages().cloned().collect()
}
