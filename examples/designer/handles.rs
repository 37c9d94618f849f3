//! Vertices of a chosen lattice, to be dragged.

use crate::Designer;
use crate::pointer::{Pointing, ray};
use crate::view::OwnView;
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_egui::input::EguiWantsInput;
use bevy_surgery::panels::note_change;
use bevy_surgery::prelude::*;
use std::any::TypeId;

/// How near the pointer must be to seize a vertex, points.
const REACH: f32 = 10.0;
/// Lattices of more vertices show no handles: nobody could tell them apart.
const MOST: usize = 1000;

/// A vertex that is held.
struct Held {
    entity: Entity,
    vertex: usize,
    /// How far along the ray, metres.
    distance_m: f32,
    was_world_m: Vec3,
    before: Box<DeformLattice>,
}

pub fn build(app: &mut App) {
    app.add_systems(Startup, draw_over_all).add_systems(Update, (drag, draw));
}

fn draw_over_all(mut store: ResMut<GizmoConfigStore>) {
    let (config, _) = store.config_mut::<DefaultGizmoConfigGroup>();
    config.depth_bias = -1.0;
}

/// Where the vertices of a lattice are seen: matter that rests at a vertex moves against its translation.
fn shown(lattice: &DeformLattice, world_from_body: &GlobalTransform) -> Vec<(usize, Vec3)> {
    let tree = lattice.tree();
    let world_from_box = world_from_body.affine() * lattice.body_from_box();
    let vertices = (0..tree.vertex_count()).filter(|vertex| !tree.is_constrained(*vertex));
    vertices
        .map(|vertex| {
            let place = tree.place_of(vertex).as_vec3() - lattice.translations()[vertex];
            (vertex, world_from_box.transform_point3(place))
        })
        .collect()
}

fn drag(
    designer: Res<Designer>,
    mut pointing: ResMut<Pointing>,
    mut held: Local<Option<Held>>,
    buttons: Res<ButtonInput<MouseButton>>,
    windows: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(Entity, &Camera, &GlobalTransform, Has<OwnView>), With<Camera3d>>,
    wants: Option<Res<EguiWantsInput>>,
    mut lattices: Query<(&mut DeformLattice, &GlobalTransform)>,
    mut commands: Commands,
) {
    if !buttons.pressed(MouseButton::Left) {
        pointing.is_taken = false;
        if let Some(Held { entity, before, .. }) = held.take() {
            commands.queue(move |world: &mut World| {
                note_change(world, entity, TypeId::of::<DeformLattice>(), Some(before), "Drag the lattice");
            });
        }
        return;
    }
    let Some((at, ray)) = ray(&designer, &windows, &cameras) else { return };
    if buttons.just_pressed(MouseButton::Left) && !wants.is_some_and(|wants| wants.wants_any_pointer_input()) {
        let Some(chosen) = designer.chosen else { return };
        let Ok((lattice, place)) = lattices.get(chosen) else { return };
        let own = cameras.iter().find(|(entity, .., is_own)| match designer.through {
            Some(through) => *entity == through,
            None => *is_own,
        });
        let Some((_, camera, eye, _)) = own else { return };
        let far = |world_m: Vec3| camera.world_to_viewport(eye, world_m).map_or(f32::MAX, |seen| seen.distance(at));
        let nearest = shown(lattice, place)
            .into_iter()
            .filter(|(_, world_m)| far(*world_m) < REACH)
            .min_by(|one, other| one.1.distance(eye.translation()).total_cmp(&other.1.distance(eye.translation())));
        if let Some((vertex, world_m)) = nearest {
            let distance_m = (world_m - ray.origin).dot(*ray.direction);
            let before = Box::new(lattice.clone());
            *held = Some(Held { entity: chosen, vertex, distance_m, was_world_m: world_m, before });
            pointing.is_taken = true;
        }
        return;
    }
    let Some(held) = &mut *held else { return };
    let Ok((mut lattice, place)) = lattices.get_mut(held.entity) else { return };
    let now = ray.origin + *ray.direction * held.distance_m;
    let box_from_world = lattice.box_from_body() * place.affine().inverse();
    let by = box_from_world.transform_vector3(now - held.was_world_m);
    // As far as matter can go without folding over itself.
    let was = lattice.clone();
    for share in [1.0, 0.5, 0.25, 0.125] {
        if lattice.drag_vertex(held.vertex, share * by).is_ok() && lattice.check_folds().is_ok() {
            held.was_world_m += share * (now - held.was_world_m);
            return;
        }
        lattice.clone_from(&was);
    }
}

/// Draws the vertices and the lattice's box.
fn draw(
    designer: Res<Designer>,
    lattices: Query<(&DeformLattice, &GlobalTransform)>,
    cameras: Query<&GlobalTransform, With<OwnView>>,
    mut gizmos: Gizmos,
) {
    let Some((lattice, place)) = designer.chosen.and_then(|chosen| lattices.get(chosen).ok()) else { return };
    let eye = cameras.iter().next().map_or(Vec3::ZERO, GlobalTransform::translation);
    let world_from_box = place.affine() * lattice.body_from_box();
    let corner = |bits: usize| {
        world_from_box.transform_point3(Vec3::from([0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { 1.0 } else { 0.0 })))
    };
    for bits in 0..8usize {
        for axis in (0..3).filter(|axis| bits >> axis & 1 == 0) {
            gizmos.line(corner(bits), corner(bits | 1 << axis), Color::srgba(0.6, 0.7, 0.8, 0.5));
        }
    }
    let vertices = shown(lattice, place);
    if vertices.len() > MOST {
        return;
    }
    for (_, world_m) in vertices {
        let radius_m = 0.006 * world_m.distance(eye);
        gizmos.cross(Isometry3d::from_translation(world_m), radius_m, Color::srgb(1.0, 0.85, 0.3));
    }
}
