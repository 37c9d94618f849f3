//! Volumes as elastic bodies: what their voxels make of the cells, and how they give way in an app.

use crate::support::told;
use bevy::prelude::*;
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::deform::elastic::{ElasticBody, ElasticTissue, ToolShape};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::DeformedVolume;
use bevy_surgery::volume::structures::{Structure, Structures, Tissue};
use glam::DVec3;

const SIZE: u32 = 32;

/// 32^3 voxels of 2 mm. `what` gives each voxel its label (1 for the first tissue) and how much of it is filled.
fn volume_of(tissues: &[Tissue], what: impl Fn(UVec3) -> (u8, u8)) -> Volume {
    let grid = VolumeGrid::upright(UVec3::splat(SIZE), DVec3::splat(2.0));
    let voxels = (0..grid.count() as u32).map(|n| UVec3::new(n % SIZE, n / SIZE % SIZE, n / (SIZE * SIZE)));
    let (labels, solid): (Vec<u8>, Vec<u8>) = voxels.map(what).unzip();
    let list = tissues.iter().map(|tissue| Structure::new(format!("{tissue:?}"), [200, 180, 160], *tissue)).collect();
    let structures = Structures::new(list, labels, solid.clone()).expect("labels of the list");
    let volume = Volume::new(grid, Voxels::U8(solid), 1.0, 0.0).expect("a volume");
    volume.with_structures(structures).expect("of the same size")
}

/// Where a voxel is, metres from the volume's middle.
fn place_m(volume: &Volume, voxel: Vec3) -> Vec3 {
    volume.grid().volume_from_voxel().transform_point3(voxel)
}

/// The cell that holds a voxel.
fn cell_at(body: &ElasticBody, lattice: &DeformLattice, volume: &Volume, voxel: Vec3) -> usize {
    let place = lattice.box_from_body().transform_point3(place_m(volume, voxel));
    body.tree().patch_at(place.as_dvec3())
}

#[test]
fn stiff_and_soft_halves_bend_differently() {
    // A column of cartilage, a column of soft tissue, and nothing between them.
    let half = |voxel: UVec3| match voxel.x / (SIZE / 4) {
        0 => (1, 255),
        3 => (2, 255),
        _ => (0, 0),
    };
    let volume = volume_of(&[Tissue::Cartilage, Tissue::Soft], half);
    let lattice = volume.grid().lattice(2).expect("a level that can be");
    let body = ElasticBody::of_volume(&lattice, &volume).expect("a body");
    let (stiff_voxel, soft_voxel) = (Vec3::new(4.0, 16.0, 16.0), Vec3::new(28.0, 16.0, 16.0));
    for (voxel, tissue) in [(stiff_voxel, ElasticTissue::CARTILAGE), (soft_voxel, ElasticTissue::MUSCLE)] {
        let cell = body.cell(cell_at(&body, &lattice, &volume, voxel));
        assert!((cell.fill - 1.0).abs() < 1e-6, "{cell:?}");
        assert_eq!(cell.tissue, tissue, "around voxel {voxel}");
    }
    // Held below, both lean aside: the soft one farther, by far.
    let least_y = (0..body.tree().vertex_count()).map(|vertex| body.rest_m(vertex).y).fold(f32::MAX, f32::min);
    let mut body = body.pinned_where(|rest_m| rest_m.y < least_y + 1e-4);
    let aside = Vec3::Z * 9.81;
    (0..240).for_each(|_| drop(body.step(1.0 / 60.0, aside, &[], &[])));
    let top = |voxel: Vec3| {
        let mut rest_m = place_m(&volume, voxel);
        rest_m.y = -least_y;
        (body.moved_m(rest_m) - rest_m).dot(aside.normalize())
    };
    let (stiff_m, soft_m) = (top(stiff_voxel), top(soft_voxel));
    println!("cartilage {stiff_m} m, soft tissue {soft_m} m");
    assert!(soft_m > 5e-3, "soft tissue sways: {soft_m} m");
    assert!(stiff_m > 0.0 && stiff_m < 0.3 * soft_m, "cartilage by {stiff_m} m, soft tissue by {soft_m} m");
}

#[test]
fn cells_hold_what_their_voxels_are_filled_with() {
    // The lower half of the voxels' k is bone, a quarter of which is missing in each voxel; nothing is above.
    let volume = volume_of(&[Tissue::CorticalBone], |voxel| if voxel.z < SIZE / 2 { (1, 191) } else { (0, 0) });
    let lattice = volume.grid().lattice(2).expect("a level that can be");
    let body = ElasticBody::of_volume(&lattice, &volume).expect("a body");
    let filled = body.cell(cell_at(&body, &lattice, &volume, Vec3::new(16.0, 16.0, 4.0)));
    assert!((filled.fill - 191.0 / 255.0).abs() < 1e-6 && filled.tissue == ElasticTissue::BONE, "{filled:?}");
    let empty = body.cell(cell_at(&body, &lattice, &volume, Vec3::new(16.0, 16.0, 28.0)));
    assert_eq!(empty.fill, 0.0);
    // What there is weighs as much as its voxels; froth in empty cells adds next to nothing.
    let mass_kg: f64 = (0..body.tree().vertex_count()).map(|vertex| f64::from(body.mass_kg(vertex))).sum();
    let bone_m3 = volume.grid().voxel_mm3() * 1e-9 * volume.grid().count() as f64 * 0.5 * 191.0 / 255.0;
    let bone_kg = bone_m3 * f64::from(ElasticTissue::BONE.density_kg_per_m3);
    assert!((mass_kg / bone_kg - 1.0).abs() < 2e-3, "{mass_kg} kg instead of {bone_kg} kg");
    let far = (0..body.tree().vertex_count()).filter(|&vertex| {
        let place = volume.grid().volume_from_voxel().inverse().transform_point3(body.rest_m(vertex));
        place.z > 0.8 * SIZE as f32
    });
    assert!(far.map(|vertex| f64::from(body.mass_kg(vertex))).fold(0.0, f64::max) < 1e-4 * bone_kg);
    // A volume in which nothing is has no body.
    let nothing = volume_of(&[], |_| (0, 0));
    assert!(ElasticBody::of_volume(&lattice, &nothing).is_err());
}

#[test]
fn mixed_cells_are_as_stiff_as_their_parts() {
    // A quarter of each cell along i is a vessel, the rest soft: stiffness and density are the mean.
    let mixed = |voxel: UVec3| (if voxel.x % 8 < 2 { 1 } else { 2 }, 255);
    let volume = volume_of(&[Tissue::Vessel, Tissue::Soft], mixed);
    let lattice = volume.grid().lattice(2).expect("a level that can be");
    let body = ElasticBody::of_volume(&lattice, &volume).expect("a body");
    let [vessel, soft] = [Tissue::Vessel, Tissue::Soft].map(Tissue::typical_elasticity);
    let mean = |of: fn(&ElasticTissue) -> f32| 0.25 * of(&vessel) + 0.75 * of(&soft);
    for number in 0..body.tree().patches().len() {
        let tissue = body.cell(number).tissue;
        assert!((tissue.youngs_modulus_pa / mean(|of| of.youngs_modulus_pa) - 1.0).abs() < 1e-5, "{tissue:?}");
        assert!((tissue.density_kg_per_m3 / mean(|of| of.density_kg_per_m3) - 1.0).abs() < 1e-5, "{tissue:?}");
        // The rest is that of what fills most.
        assert_eq!(tissue.tears_at_stretch, soft.tears_at_stretch);
    }
}

#[test]
fn without_structures_all_is_soft() {
    let grid = VolumeGrid::upright(UVec3::splat(8), DVec3::splat(2.0));
    let volume = Volume::new(grid, Voxels::U8((0..512).map(|n| (n % 251) as u8).collect()), 1.0, 0.0);
    let volume = volume.expect("a volume");
    let lattice = volume.grid().lattice(1).expect("a level that can be");
    let body = ElasticBody::of_volume(&lattice, &volume).expect("a body");
    for number in 0..8 {
        let cell = body.cell(number);
        assert!(cell.fill == 1.0 && cell.tissue == Tissue::Soft.typical_elasticity(), "{cell:?}");
    }
}

#[test]
fn typical_tissues_are_in_the_order_of_nature() {
    let order = [
        Tissue::Nerve,
        Tissue::Soft,
        Tissue::Vessel,
        Tissue::Dura,
        Tissue::Cartilage,
        Tissue::CancellousBone,
        Tissue::CorticalBone,
    ];
    let elastic = order.map(Tissue::typical_elasticity);
    for pair in elastic.windows(2) {
        assert!(pair[0].youngs_modulus_pa < pair[1].youngs_modulus_pa, "{pair:?}");
        assert!(pair[0].tears_at_stretch >= pair[1].tears_at_stretch || pair[1].youngs_modulus_pa < 1e7, "{pair:?}");
    }
    assert_eq!(Tissue::Tooth.typical_elasticity(), ElasticTissue::BONE);
    // Numbers that need no bounding.
    assert!(elastic.iter().all(|tissue| *tissue == tissue.bounded()));
}

/// A block of soft tissue with a lattice and a body, held at its lower side, in an app without gravity.
fn pressed_scene() -> (TestApp, Entity, Transform) {
    let volume = volume_of(&[Tissue::Soft], |_| (1, 255));
    let lattice = volume.grid().lattice(3).expect("a level that can be");
    let body = ElasticBody::of_volume(&lattice, &volume).expect("a body").pinned_where(|rest_m| rest_m.y < -0.031);
    let at = Transform::from_xyz(0.1, -0.05, 0.2).with_rotation(Quat::from_rotation_z(0.6));
    let mut app = TestApp::cpu();
    let handle = app.world_mut().resource_mut::<Assets<Volume>>().add(volume);
    let entity = app.world_mut().spawn((CtVolume(handle), lattice, body, at)).id();
    app.world_mut().insert_resource(SurgeryGravity { world_m_per_s2: Vec3::ZERO });
    app.step(2);
    (app, entity, at)
}

/// Presses a ball this deep into the middle of the upper side for some steps; returns the last contact.
fn press(app: &mut TestApp, body: Entity, at: &Transform, depth_m: f32, steps: u32) -> Option<BodyContact> {
    let radius_m = 0.016;
    let mut last = None;
    for step in 1..=steps {
        let sunk_m = depth_m * (2.0 * step as f32 / steps as f32).min(1.0);
        let centre_m = at.transform_point(Vec3::new(0.0, 0.032 + radius_m - sunk_m, 0.0));
        let shape = ToolShape::Sphere { centre_m, radius_m };
        app.world_mut().write_message(PressBody { body, tool: 0, shape, friction: 0.1 });
        app.step(1);
        let contacts = app.world_mut().resource_mut::<Messages<BodyContact>>().drain().last();
        last = contacts.or(last);
    }
    last
}

#[test]
fn a_pressed_volume_gives_way_and_comes_back() {
    let (mut app, entity, at) = pressed_scene();
    let top_m = Vec3::new(0.0, 0.0319, 0.0);
    let middle = |app: &TestApp| app.world().get::<ElasticBody>(entity).expect("a body").moved_m(top_m);
    let shown = |app: &TestApp| {
        // The voxel that rests below the upper side: where volumes, pickers and burrs see it.
        let field = app.world().get::<DeformedVolume>(entity).expect("it follows its lattice");
        let volume = app.world().get::<CtVolume>(entity).expect("a volume");
        let grid = *app.world().resource::<Assets<Volume>>().get(&volume.0).expect("loaded").grid();
        let rest = grid.volume_from_voxel().inverse().transform_point3(top_m);
        grid.volume_from_voxel().transform_point3(field.lattice().shown_from_rest(rest))
    };
    assert!(middle(&app).distance(top_m) < 1e-6 && shown(&app).distance(top_m) < 1e-5);
    let depth_m = 0.006;
    let contact = press(&mut app, entity, &at, depth_m, 60).expect("it touches");
    let up = at.rotation * Vec3::Y;
    assert!(contact.body == entity && contact.depth_m > 0.7 * depth_m, "{contact:?}");
    assert!(contact.force_world_n.dot(up) > 0.05, "it pushes back: {contact:?}");
    assert!(contact.force_world_n.reject_from(up).length() < 0.1 * contact.force_world_n.length(), "{contact:?}");
    let dent_m = top_m.y - middle(&app).y;
    // The surface is as coarse as the cells: where it bends round the ball, its corner lies deeper than the ball.
    assert!((0.7 * depth_m..1.5 * depth_m).contains(&dent_m), "dented by {dent_m} m");
    // What is drawn, picked and drilled goes along. The lattice has the way back at its vertices only.
    let off_m = shown(&app).distance(middle(&app));
    assert!(off_m < 0.2 * dent_m, "shown {off_m} m from where the body has it");
    // Without the probe all of it comes back.
    app.step(300);
    let body = app.world().get::<ElasticBody>(entity).expect("a body");
    let vertices = 0..body.tree().vertex_count();
    let off_m = vertices.map(|vertex| body.displacement_m(vertex).length()).fold(0.0, f32::max);
    assert!(off_m < 1e-4 && shown(&app).distance(top_m) < 2e-4, "still {off_m} m off");
    assert_eq!(body.faults(), default());
}

#[test]
fn a_lattice_with_nothing_to_deform_is_told_of_once() {
    let reason = "nothing that it could deform";
    told(reason);
    let mut app = TestApp::cpu();
    let lattice = || DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a box");
    let named = app.world_mut().spawn((lattice(), Name::new("lonely lattice"))).id();
    let unnamed = app.world_mut().spawn(lattice()).id();
    let organ = OrganModel::procedural_liver(&OrganOptions { table_width_px: 64, ..default() }).expect("a liver");
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(organ);
    let organ = app.world_mut().spawn((Organ(organ), lattice(), Name::new("liver with a lattice"))).id();
    let late = app.world_mut().spawn((CtVolume::default(), lattice(), Name::new("volume with a lattice"))).id();
    app.step(5);
    // Moving it is no reason to say it again.
    for entity in [named, unnamed, organ, late] {
        app.world_mut().get_mut::<DeformLattice>(entity).expect("nothing is lost").set_changed();
    }
    app.step(5);
    let about = |entity: Entity| -> Vec<String> {
        told(reason).into_iter().filter(|text| text.contains(&format!("{entity}"))).collect()
    };
    // Apps of other tests number their entities alike: names tell them apart.
    let of_named: Vec<String> = told(reason).into_iter().filter(|text| text.contains("lonely lattice")).collect();
    assert_eq!(of_named.len(), 1, "{of_named:?}");
    assert!(of_named[0].contains(&named.to_string()) && of_named[0].contains("CtVolume"), "{of_named:?}");
    assert!(of_named[0].contains("Organ"), "it says what to add: {of_named:?}");
    assert!(!about(unnamed).is_empty(), "{:?}", told(reason));
    assert!(told("with a lattice").is_empty(), "{:?}", told("with a lattice"));
    let kept = app.world().get::<DeformLattice>(named).expect("nothing is lost");
    assert!(kept.is_at_rest());
}
