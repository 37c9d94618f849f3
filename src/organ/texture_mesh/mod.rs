//! The texture mesh: nearly equilateral triangles all over the organ, each of which carries one tile of the skin.
//!
//! The skin of Neyret and Cani's tiles (2002 paper, section 4.1) needs a regular triangulation of the surface whose
//! vertices need not be those of the geometric mesh. It is made in four steps:
//!
//! 1. [`build`] spreads vertices evenly over the surface, triangulates them as Delaunay in the organ's chart, and
//!    relaxes them along the surface until the triangles are nearly equilateral.
//! 2. The texture triangles are laid over the geometric faces. Every piece lies in one face and one texture triangle,
//!    so drawing the pieces shows exactly the geometric surface.
//! 3. Every corner of a piece gets its place in the tile so that the tile is stretched as evenly as possible.
//! 4. The extra vertices are [`SecondaryVertices`]: fixed combinations of primary ones. When the organ moves, they
//!    follow; nothing is re-meshed.
//!
//! An organ with its own planar texture coordinates uses [`build_planar`] instead.

mod overlay;
mod planar;
mod predicates;
mod remesh;
mod report;
mod sample;
mod secondary;
mod sizing;
mod straighten;
mod stretch;
mod tile_coords;
mod tile_relax;
mod triangulation;
mod walk;

pub use overlay::OverlayVertex;
pub use planar::build_planar;
pub use report::TextureMeshReport;
pub use secondary::{SecondaryError, SecondaryVertices};
pub use tile_coords::OverlayCorner;

use super::{
    mesh::{NO_FACE, SurfaceMesh},
    sphere::{SphereMesh, SurfacePoint},
};
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use straighten::Straightener;
use walk::ChartedSurface;

/// Texture triangles on a compact organ where no edge length is asked for; thin parts get more, smaller ones.
pub const DEFAULT_TRIANGLES: u32 = 400;
/// Most texture triangles that are made.
pub const MOST_TRIANGLES: u32 = 200_000;
/// Fewest texture triangles that make sense: with fewer, edges near half circles of the chart.
pub const FEWEST_TRIANGLES: u32 = 20;

/// Iterations of the first remeshing that may add and remove vertices.
const RESAMPLING_ITERATIONS: u32 = 18;
/// Sweeps of straightening before each later remeshing.
const STRAIGHTENING_SWEEPS: [u32; 3] = [4; 3];
/// Sweeps of straightening after the last remeshing.
const LAST_STRAIGHTENING_SWEEPS: u32 = 8;

/// How to make a texture mesh.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct TextureMeshOptions {
    /// Wanted edge length of the texture triangles along the surface, metres; `None` chooses it from the organ's area
    /// such that about [`DEFAULT_TRIANGLES`] cover it.
    pub edge_length_m: Option<f32>,
    /// Rounds of splitting, collapsing, flipping and relaxing at first; later ones, in which the edges are
    /// straightened too, are three quarters as many together.
    pub iterations: u32,
    /// Rounds of relaxing the places in the tiles.
    pub tile_sweeps: u32,
    /// Seed of the first vertices' places.
    pub seed: u64,
}

impl Default for TextureMeshOptions {
    fn default() -> Self {
        Self { edge_length_m: None, iterations: 30, tile_sweeps: 14, seed: 1 }
    }
}

impl TextureMeshOptions {
    /// The edge length for an organ of a given area, checked.
    fn edge_length_for(&self, area_m2: f64) -> Result<f64, TextureMeshError> {
        let area_of = |edge: f64| edge * edge * 0.75f64.sqrt() / 2.0;
        if !(area_m2.is_finite() && area_m2 > 0.0) {
            return Err(TextureMeshError::NoArea);
        }
        let Some(edge_length_m) = self.edge_length_m else {
            return Ok((area_m2 / f64::from(DEFAULT_TRIANGLES) / area_of(1.0)).sqrt());
        };
        let edge_length = f64::from(edge_length_m);
        if !(edge_length.is_finite() && edge_length > 0.0) {
            return Err(TextureMeshError::InvalidEdgeLength { edge_length_m });
        }
        let triangles = area_m2 / area_of(edge_length);
        if triangles > f64::from(MOST_TRIANGLES) {
            return Err(TextureMeshError::TooFine { edge_length_m, triangles });
        }
        if triangles < f64::from(FEWEST_TRIANGLES) {
            return Err(TextureMeshError::TooCoarse { edge_length_m, triangles });
        }
        Ok(edge_length)
    }
}

/// Why no texture mesh could be made.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum TextureMeshError {
    /// The edge length is not a positive number.
    #[error("the edge length of texture triangles must be a positive number of metres, not {edge_length_m}")]
    InvalidEdgeLength {
        /// What was asked for, metres.
        edge_length_m: f32,
    },
    /// More than [`MOST_TRIANGLES`] would be needed.
    #[error("texture triangles with edges of {edge_length_m} m would be {triangles:.0}, more than {MOST_TRIANGLES}")]
    TooFine {
        /// What was asked for, metres.
        edge_length_m: f32,
        /// Triangles needed.
        triangles: f64,
    },
    /// Fewer than [`FEWEST_TRIANGLES`] would cover the organ.
    #[error("texture triangles with edges of {edge_length_m} m are too large: {triangles:.1} would cover the organ")]
    TooCoarse {
        /// What was asked for, metres.
        edge_length_m: f32,
        /// Triangles needed.
        triangles: f64,
    },
    /// The organ has no faces, no area or positions that are not numbers.
    #[error("the organ's surface has no area")]
    NoArea,
    /// The chart is not one of this mesh, or not bijective.
    #[error("the chart does not belong to the mesh, or some of its faces are flipped or degenerate")]
    InvalidChart,
    /// No valid texture triangulation was found.
    #[error("the texture triangulation does not cover the organ exactly once")]
    InvalidTexture,
}

/// A triangulation of the organ by nearly equilateral triangles of one size.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct TextureMesh {
    /// Where each texture vertex lies on the geometric mesh. With [`build_planar`], vertices off the organ have the
    /// face [`super::mesh::NO_FACE`].
    pub vertices: Vec<SurfacePoint>,
    /// The triangulation of these vertices, with their directions in the organ's chart. On the surface its edges run
    /// as straight as the overlay could make them, which is not exactly along the arcs between these directions.
    pub triangulation: SphereMesh,
    /// The edge length that was aimed at, metres.
    pub edge_length_m: f32,
}

/// The overlay of the texture mesh on the geometric mesh, ready to be drawn: the geometric surface, cut along the
/// texture triangles' edges.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SkinMesh {
    /// Every vertex of the overlay: the geometric vertices first, in their order, then the texture vertices, then the
    /// crossings of texture edges with geometric edges.
    pub secondary: Vec<OverlayVertex>,
    /// Vertices for drawing: one for every overlay vertex and texture triangle that meet.
    pub corners: Vec<OverlayCorner>,
    /// Three corners per sub-triangle, counter-clockwise seen from outside, ordered by texture triangle.
    pub indices: Vec<u32>,
    /// The geometric face that each sub-triangle is part of.
    pub faces: Vec<u32>,
}

/// Makes the texture mesh of an organ and lays it over the geometric mesh.
///
/// `chart` is the organ's spherical chart: the same triangles, all positive. The same input gives the same bits.
///
/// # Errors
/// [`TextureMeshError`] for senseless edge lengths, for an organ without area and for an invalid chart.
pub fn build(
    mesh: &SurfaceMesh,
    chart: &SphereMesh,
    options: &TextureMeshOptions,
) -> Result<(TextureMesh, SkinMesh, TextureMeshReport), TextureMeshError> {
    let edge_length_m = options.edge_length_for(mesh.area_m2())?;
    check_chart(mesh, chart)?;
    if !chart.is_positive() {
        return Err(TextureMeshError::InvalidChart);
    }
    let positions_m: Vec<DVec3> = mesh.positions_m.iter().map(|p| p.as_dvec3()).collect();
    let mut straightened = chart.clone();
    let surface = ChartedSurface { positions_m: &positions_m, chart };
    let vertices = mesh.area_m2() / (edge_length_m * edge_length_m * 0.75f64.sqrt()) + 2.0;
    let mut triangulation = sample::sample(&surface, edge_length_m, vertices as usize, options.seed);
    remesh::remesh(&surface, &mut triangulation, edge_length_m, options.iterations, RESAMPLING_ITERATIONS);
    // Vertices are spread for the edges as they run; straightening moves the edges, so the two take turns.
    let iterations = options.iterations.div_ceil(4);
    for sweeps in STRAIGHTENING_SWEEPS {
        Straightener::new(&mut straightened, &positions_m).straighten(&triangulation.sphere(), edge_length_m, sweeps);
        triangulation.relocate(&straightened);
        let surface = ChartedSurface { positions_m: &positions_m, chart: &straightened };
        remesh::remesh(&surface, &mut triangulation, edge_length_m, iterations, 1);
    }
    let texture = triangulation.sphere();
    Straightener::new(&mut straightened, &positions_m).straighten(&texture, edge_length_m, LAST_STRAIGHTENING_SWEEPS);
    let cells = overlay::overlay(&straightened, &texture)?;
    Ok(finish(&positions_m, chart, texture, cells, edge_length_m, options))
}

fn check_chart(mesh: &SurfaceMesh, chart: &SphereMesh) -> Result<(), TextureMeshError> {
    let fits = mesh.triangles == chart.triangles
        && mesh.positions_m.len() == chart.directions.len()
        && chart.neighbours.len() == chart.triangles.len()
        && chart.triangles.iter().flatten().all(|&v| (v as usize) < chart.directions.len());
    if fits { Ok(()) } else { Err(TextureMeshError::InvalidChart) }
}

/// Places in the tiles, measurements, and everything in its final form.
fn finish(
    positions_m: &[DVec3],
    chart: &SphereMesh,
    mut texture: SphereMesh,
    mut cells: overlay::Cells,
    edge_length_m: f64,
    options: &TextureMeshOptions,
) -> (TextureMesh, SkinMesh, TextureMeshReport) {
    let map = tile_coords::map_tiles(&mut cells, &texture, positions_m, edge_length_m, options.tile_sweeps);
    let corner_positions_m: Vec<DVec3> =
        map.corners.iter().map(|corner| cells.vertices[corner.vertex as usize].position_m(positions_m)).collect();
    let report = TextureMeshReport::measure(&texture, &map, &corner_positions_m, cells.vertices.len(), edge_length_m);
    for (direction, &point) in texture.directions.iter_mut().zip(&cells.texture_points) {
        if point.face != NO_FACE {
            *direction = chart.direction(point);
        }
    }
    let skin = SkinMesh {
        secondary: cells.vertices,
        corners: map.corners,
        indices: map.sub_triangles.into_iter().flatten().collect(),
        faces: map.faces,
    };
    let texture_mesh =
        TextureMesh { vertices: cells.texture_points, triangulation: texture, edge_length_m: edge_length_m as f32 };
    (texture_mesh, skin, report)
}

impl OverlayVertex {
    /// Where the vertex lies, given the primary vertices, metres.
    fn position_m(&self, positions_m: &[DVec3]) -> DVec3 {
        (0..3).map(|k| positions_m[self.primary[k] as usize] * f64::from(self.weights[k])).sum()
    }
}

impl SkinMesh {
    /// Where an overlay vertex lies, given the primary vertices' positions (metres). For whole meshes every frame use
    /// [`SecondaryVertices`].
    pub fn position_m(&self, vertex: u32, primary_positions_m: &[Vec3]) -> DVec3 {
        let vertex = &self.secondary[vertex as usize];
        (0..3).map(|k| primary_positions_m[vertex.primary[k] as usize].as_dvec3() * f64::from(vertex.weights[k])).sum()
    }
}
