//! An organ's own texture coordinates as its chart, for surfaces that no sphere fits: open ones and those with handles.
//!
//! They are usable where they are bijective: inside the unit square, every face the same way round, and no two faces
//! over the same texel. All three are checked exactly.

use super::mesh::SurfaceMesh;
use super::sphere::SphereMesh;
use bevy::reflect::Reflect;
use glam::{DVec2, DVec3, Vec2};
use serde::{Deserialize, Serialize};

/// Most cells along one side of the search grid.
const MOST_CELLS: usize = 1024;

/// Why a surface's own texture coordinates are no chart.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum PlanarError {
    /// There are no faces.
    #[error("the surface has no faces")]
    Empty,
    /// The file had none, or not one per vertex.
    #[error("the surface has no texture coordinates of its own")]
    NoCoordinates,
    /// Not one pair for each vertex.
    #[error("{coordinates} texture coordinates do not fit {vertices} vertices")]
    Count {
        /// Pairs given.
        coordinates: usize,
        /// Vertices of the surface.
        vertices: usize,
    },
    /// A face refers to a vertex that is not there.
    #[error("face {face} refers to vertex {vertex}, which does not exist")]
    NoSuchVertex {
        /// The face.
        face: u32,
        /// The vertex.
        vertex: u32,
    },
    /// A vertex lies beyond the texture.
    #[error("vertex {vertex} has texture coordinates {uv}, outside the unit square")]
    Outside {
        /// The vertex.
        vertex: u32,
        /// Its coordinates.
        uv: Vec2,
    },
    /// A face covers no area of the texture.
    #[error("face {face} has no area in the texture")]
    Degenerate {
        /// The face.
        face: u32,
    },
    /// Some faces are mirrored and others are not.
    #[error("the texture coordinates are not bijective: faces {first} and {second} are turned opposite ways")]
    Flipped {
        /// A face the one way round.
        first: u32,
        /// A face the other way round.
        second: u32,
    },
    /// Two faces share some of the texture.
    #[error("the texture coordinates are not bijective: faces {first} and {second} overlap")]
    Overlap {
        /// The one.
        first: u32,
        /// The other.
        second: u32,
    },
}

/// A bijective planar chart.
///
/// Its [`SphereMesh`] holds homogeneous directions `(u, v, 1)`, or `(u, -v, 1)` where the file's coordinates mirror
/// the surface, so that its faces are always positive. They are not unit vectors and cover no sphere.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct PlanarChart {
    chart: SphereMesh,
    is_mirrored: bool,
    grid: Grid,
}

impl PlanarChart {
    /// Takes a surface's own texture coordinates.
    ///
    /// # Errors
    /// Says why they are not bijective, and at which faces; see [`PlanarError`].
    pub fn new(mesh: &SurfaceMesh) -> Result<Self, PlanarError> {
        let uvs = mesh.uvs.as_ref().ok_or(PlanarError::NoCoordinates)?;
        if mesh.triangles.is_empty() {
            return Err(PlanarError::Empty);
        }
        if uvs.len() != mesh.positions_m.len() {
            return Err(PlanarError::Count { coordinates: uvs.len(), vertices: mesh.positions_m.len() });
        }
        // Written so that coordinates that are not numbers are outside too.
        let is_inside = |uv: Vec2| (0.0..=1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y);
        if let Some(vertex) = uvs.iter().position(|&uv| !is_inside(uv)) {
            return Err(PlanarError::Outside { vertex: vertex as u32, uv: uvs[vertex] });
        }
        for (face, triangle) in mesh.triangles.iter().enumerate() {
            if let Some(&vertex) = triangle.iter().find(|&&vertex| vertex as usize >= uvs.len()) {
                return Err(PlanarError::NoSuchVertex { face: face as u32, vertex });
            }
        }
        let directions: Vec<DVec3> = uvs.iter().map(|uv| DVec3::new(uv.x.into(), uv.y.into(), 1.0)).collect();
        let mut chart = SphereMesh::new(directions, mesh.triangles.clone());
        let is_mirrored = is_mirrored(&chart)?;
        if is_mirrored {
            for direction in &mut chart.directions {
                direction.y = -direction.y;
            }
        }
        let grid = Grid::new(&chart);
        if let Some((first, second)) = grid.first_overlap(&chart) {
            return Err(PlanarError::Overlap { first, second });
        }
        Ok(Self { chart, is_mirrored, grid })
    }

    /// Faces with their homogeneous directions.
    pub fn chart(&self) -> &SphereMesh {
        &self.chart
    }

    /// Whether the texture shows the surface as in a mirror (as `u` right and `v` up count).
    pub fn is_mirrored(&self) -> bool {
        self.is_mirrored
    }

    /// Homogeneous direction of a place in the texture.
    pub fn direction_from_uv(&self, uv: DVec2) -> DVec3 {
        DVec3::new(uv.x, if self.is_mirrored { -uv.y } else { uv.y }, 1.0)
    }

    /// Place in the texture of a homogeneous direction of any length.
    pub fn uv_from_direction(&self, direction: DVec3) -> DVec2 {
        let uv = direction.truncate() / direction.z;
        DVec2::new(uv.x, if self.is_mirrored { -uv.y } else { uv.y })
    }

    /// The face at a place in the texture; places on the border of the chart count as inside. `None` beside all faces.
    pub fn face_at(&self, uv: DVec2) -> Option<u32> {
        let direction = self.direction_from_uv(uv);
        let faces = self.grid.faces_at(direction.truncate())?;
        let is_on = |face: u32| {
            let triangle = self.chart.triangles[face as usize];
            (0..3).all(|k| self.chart.side(triangle[k], triangle[(k + 1) % 3], direction).is_ge())
        };
        faces
            .iter()
            .find(|&&face| self.chart.contains(face, direction))
            .or_else(|| faces.iter().find(|&&face| is_on(face)))
            .copied()
    }
}

/// Whether all faces turn the same way round, and which.
fn is_mirrored(chart: &SphereMesh) -> Result<bool, PlanarError> {
    let mut first_of = [None; 2];
    for face in 0..chart.triangles.len() as u32 {
        let orientation = chart.orientation(face);
        if orientation.is_eq() {
            return Err(PlanarError::Degenerate { face });
        }
        first_of[usize::from(orientation.is_lt())].get_or_insert(face);
    }
    match first_of {
        [Some(first), Some(second)] => {
            Err(PlanarError::Flipped { first: first.min(second), second: first.max(second) })
        }
        [upright, _] => Ok(upright.is_none()),
    }
}

/// Which faces come near each cell of a regular grid over the texture.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
struct Grid {
    low: DVec2,
    cells_per_unit: DVec2,
    side: usize,
    /// Where the faces of each cell start; one more than there are cells.
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Grid {
    fn new(chart: &SphereMesh) -> Self {
        let (low, high) = chart
            .directions
            .iter()
            .map(|direction| direction.truncate())
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let side = (chart.triangles.len() as f64).sqrt().ceil().clamp(1.0, MOST_CELLS as f64) as usize;
        let mut grid = Self {
            low,
            cells_per_unit: side as f64 / (high - low).max(DVec2::splat(f64::MIN_POSITIVE)),
            side,
            starts: vec![0; side * side + 1],
            faces: Vec::new(),
        };
        let boxes: Vec<[usize; 4]> = (0..chart.triangles.len() as u32)
            .map(|face| {
                let [a, b, c] = chart.corners(face).map(|corner| corner.truncate());
                let (x0, y0) = grid.cell(a.min(b).min(c));
                let (x1, y1) = grid.cell(a.max(b).max(c));
                [x0, y0, x1, y1]
            })
            .collect();
        let cells = |&[x0, y0, x1, y1]: &[usize; 4]| (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| y * side + x));
        for cell in boxes.iter().flat_map(cells) {
            grid.starts[cell + 1] += 1;
        }
        for cell in 0..side * side {
            grid.starts[cell + 1] += grid.starts[cell];
        }
        let mut next = grid.starts.clone();
        grid.faces = vec![0; grid.starts[side * side] as usize];
        for (face, covered) in boxes.iter().enumerate() {
            for cell in cells(covered) {
                grid.faces[next[cell] as usize] = face as u32;
                next[cell] += 1;
            }
        }
        grid
    }

    fn cell(&self, p: DVec2) -> (usize, usize) {
        let cell = ((p - self.low) * self.cells_per_unit).clamp(DVec2::ZERO, DVec2::splat(self.side as f64 - 1.0));
        (cell.x as usize, cell.y as usize)
    }

    /// Faces near a place, by index; `None` for what is no place.
    fn faces_at(&self, p: DVec2) -> Option<&[u32]> {
        p.is_finite().then(|| {
            let (x, y) = self.cell(p);
            let cell = y * self.side + x;
            &self.faces[self.starts[cell] as usize..self.starts[cell + 1] as usize]
        })
    }

    fn first_overlap(&self, chart: &SphereMesh) -> Option<(u32, u32)> {
        (0..self.side * self.side)
            .filter_map(|cell| {
                let faces = &self.faces[self.starts[cell] as usize..self.starts[cell + 1] as usize];
                faces.iter().enumerate().find_map(|(k, &first)| {
                    faces[k + 1..].iter().find(|&&second| overlap(chart, first, second)).map(|&second| (first, second))
                })
            })
            .min()
    }
}

/// Whether two positive faces share area: unless the line of one of their edges has the other face beyond it. Faces
/// that only touch do not overlap.
fn overlap(chart: &SphereMesh, first: u32, second: u32) -> bool {
    let separates = |face: u32, other: u32| {
        let triangle = chart.triangles[face as usize];
        let corners = chart.corners(other);
        (0..3).any(|k| corners.iter().all(|&corner| chart.side(triangle[k], triangle[(k + 1) % 3], corner).is_le()))
    };
    !separates(first, second) && !separates(second, first)
}
