//! The edges of the lattice's patches, as they go through the matter that is shown.

use crate::Patient;
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::NoFrustumCulling;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_surgery::prelude::*;

/// Whether they are drawn.
#[derive(Resource, Default, PartialEq)]
pub struct ShowsEdges(pub bool);

/// Corners of a patch at the ends of its edges; bit `n` of a corner is its side along axis `n`.
const EDGES: [(usize, usize); 12] =
    [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)];

#[derive(Component)]
struct Lines;

pub fn build(app: &mut App) {
    app.init_resource::<ShowsEdges>().add_systems(Startup, spawn).add_systems(Update, draw);
}

/// A line of no length, as meshes without vertices are none.
fn empty() -> Mesh {
    Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![Vec3::ZERO; 2])
}

fn spawn(
    mut commands: Commands,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    // Without a renderer there is nothing to see.
    let (Some(mut meshes), Some(mut materials)) = (meshes, materials) else { return };
    let teal = StandardMaterial { base_color: Color::srgb(0.1, 0.75, 0.7), unlit: true, ..default() };
    let (mesh, material) = (Mesh3d(meshes.add(empty())), MeshMaterial3d(materials.add(teal)));
    commands.spawn((Lines, mesh, material, NoFrustumCulling, Visibility::Hidden));
}

fn draw(
    shows: Res<ShowsEdges>,
    patients: Query<(Ref<DeformLattice>, &GlobalTransform), With<Patient>>,
    mut lines: Query<(&Mesh3d, &mut Transform, &mut Visibility), With<Lines>>,
    meshes: Option<ResMut<Assets<Mesh>>>,
) -> Result {
    let Some(mut meshes) = meshes else { return Ok(()) };
    let (Ok((lattice, world_from_volume)), Ok((mesh, mut place, mut visibility))) =
        (patients.single(), lines.single_mut())
    else {
        return Ok(());
    };
    visibility.set_if_neq(if shows.0 { Visibility::Inherited } else { Visibility::Hidden });
    // A wave may fold what is wound up; the lines stay then as they were.
    let Some(inverse) = lattice.inverse().ok().filter(|_| shows.0 && (lattice.is_changed() || shows.is_changed()))
    else {
        return Ok(());
    };
    let tree = lattice.tree();
    let rests: Vec<_> = (0..tree.vertex_count()).map(|vertex| tree.place_of(vertex)).collect();
    let shown: Vec<Vec3> = inverse.all_shown_from_rest(&rests).into_iter().map(|at| at.as_vec3()).collect();
    let mut ends: Vec<(usize, usize)> = (0..tree.patches().len())
        .map(|number| tree.corners(number))
        .flat_map(|corners| EDGES.map(|(a, b)| (corners[a], corners[b])))
        .collect();
    ends.sort_unstable();
    ends.dedup();
    let positions: Vec<Vec3> = ends.iter().flat_map(|&(a, b)| [shown[a], shown[b]]).collect();
    if let Some(mut mesh) = meshes.get_mut(&mesh.0) {
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, positions);
    }
    *place = Transform::from_matrix(Mat4::from(world_from_volume.affine() * lattice.body_from_box()));
    Ok(())
}
