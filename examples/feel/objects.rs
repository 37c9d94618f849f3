//! What is to be felt.

use crate::common::Args;
use bevy::prelude::*;
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::prelude::*;

/// What lies before the hand.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub enum Object {
    Wall,
    #[default]
    Ball,
    Bone,
    Liver,
}

/// How much harder than by itself it feels.
#[derive(Resource, Clone, Copy, PartialEq)]
pub struct Hardness(pub f64);

/// The one that is there.
#[derive(Component)]
pub struct Felt(pub SurfaceFeel);

pub fn build(app: &mut App) {
    app.init_resource::<Object>()
        .insert_resource(Hardness(1.0))
        .add_systems(PreUpdate, (choose, (exchange, soften).chain(), harden).chain());
}

fn choose(keys: Option<Res<ButtonInput<KeyCode>>>, mut object: ResMut<Object>, mut hardness: ResMut<Hardness>) {
    let Some(keys) = keys else { return };
    let objects = [
        (KeyCode::Digit1, Object::Wall),
        (KeyCode::Digit2, Object::Ball),
        (KeyCode::Digit3, Object::Bone),
        (KeyCode::Digit4, Object::Liver),
    ];
    for (key, chosen) in objects {
        if keys.just_pressed(key) {
            object.set_if_neq(chosen);
        }
    }
    for (key, factor) in [(KeyCode::Comma, 0.8), (KeyCode::Period, 1.25)] {
        if keys.just_pressed(key) {
            hardness.0 = (hardness.0 * factor).clamp(0.01, 100.0);
        }
    }
}

/// A box with round edges: a ball whose places are drawn out towards the corners.
fn wall() -> bevy_surgery::organ::SurfaceMesh {
    let mut mesh = procedural_ellipsoid(Vec3::ONE, 24);
    for position in &mut mesh.positions_m {
        let out = position.normalize();
        let round = out.abs().powf(6.0).element_sum().powf(-1.0 / 6.0);
        *position = out * round * Vec3::new(0.08, 0.06, 0.03);
    }
    mesh
}

fn exchange(
    mut commands: Commands,
    object: Res<Object>,
    there: Query<Entity, With<Felt>>,
    mut models: ResMut<Assets<OrganModel>>,
    mut volumes: ResMut<Assets<Volume>>,
    args: Res<Args>,
) -> Result {
    if !object.is_changed() {
        return Ok(());
    }
    there.iter().for_each(|entity| commands.entity(entity).despawn());
    let options = OrganOptions::default();
    let skin = |preset: OrganPreset| Skin { seed: args.seed, ..preset.skin() };
    match *object {
        Object::Wall => {
            let feel = SurfaceFeel { stiffness_n_per_m: 800.0, ..SurfaceFeel::BONE };
            let model = models.add(OrganModel::from_mesh_cached(wall(), "wall", &options, &default())?);
            let skin = Skin { tint: Color::srgb(0.75, 0.8, 0.9), ..skin(OrganPreset::Mucosa) };
            commands.spawn((Felt(feel), feel, Organ(model), skin));
        }
        Object::Ball => {
            let feel = SurfaceFeel { stiffness_n_per_m: 500.0, ..SurfaceFeel::BONE };
            let mesh = procedural_ellipsoid(Vec3::splat(0.04), 16);
            let model = models.add(OrganModel::from_mesh_cached(mesh, "ball", &options, &default())?);
            commands.spawn((Felt(feel), feel, Organ(model), skin(OrganPreset::Kidney), Highlights::default()));
        }
        Object::Bone => {
            let bone = phantom(&PhantomOptions { size: 128, seed: args.seed, ..default() })?;
            let feel = SurfaceFeel::BONE;
            commands.spawn((Felt(feel), feel, CtVolume(volumes.add(bone))));
        }
        Object::Liver => {
            let options = options.with_largest_extent_m(0.16).centred();
            let model = models.add(OrganModel::procedural_liver(&options)?);
            let feel = SurfaceFeel::LIVER;
            let look = (skin(OrganPreset::Liver), Reactions::default(), Highlights::default());
            commands.spawn((Felt(feel), feel, Organ(model), look));
        }
    }
    Ok(())
}

type Stiff = (Entity, &'static Organ, &'static OrganShape);

/// The liver gives way.
fn soften(
    mut commands: Commands,
    object: Res<Object>,
    models: Res<Assets<OrganModel>>,
    gravity: Res<SurgeryGravity>,
    organs: Query<Stiff, (With<Felt>, Without<ElasticBody>)>,
) -> Result {
    for (entity, organ, shape) in organs.iter().filter(|_| *object == Object::Liver) {
        let Some(model) = models.get(&organ.0).filter(|model| shape.is_of(model)) else { continue };
        let lattice = DeformLattice::around_organ(model, 3, 0.02)?;
        let (low, high) = model.mesh.bounds_m();
        let body = ElasticBody::of_organ(&lattice, model, ElasticTissue::LIVER)?;
        let mut body = body.pinned_where(|rest_m| rest_m.z < low.z + 0.35 * (high.z - low.z));
        (body.rests_under_m_per_s2, body.publishes) = (gravity.world_m_per_s2, false);
        commands.entity(entity).insert((lattice, body));
    }
    Ok(())
}

/// Makes it feel as hard as was asked for.
fn harden(hardness: Res<Hardness>, mut felt: Query<(&Felt, &mut SurfaceFeel)>) {
    for (Felt(own), mut feel) in &mut felt {
        feel.set_if_neq(SurfaceFeel { stiffness_n_per_m: own.stiffness_n_per_m * hardness.0, ..*own });
    }
}
