//! Moving the secondary vertices along with the primary ones, every frame.

use super::overlay::OverlayVertex;
use bevy::reflect::Reflect;
use glam::Vec3;

/// The secondary vertices of an organ, ready to follow its primary ones.
///
/// Primary vertices that are drawn are among the results too, with a single weight of one, so the results are all that
/// drawing needs. Nothing is allocated, and no thread is woken: a few thousand vertices take some ten microseconds.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct SecondaryVertices {
    vertices: Vec<OverlayVertex>,
    least_primaries: usize,
}

impl SecondaryVertices {
    /// Prepares vertices for [`SecondaryVertices::update`].
    pub fn new(vertices: &[OverlayVertex]) -> Self {
        let least_primaries = vertices.iter().flat_map(|v| v.primary).max().map_or(0, |p| p as usize + 1);
        Self { vertices: vertices.to_vec(), least_primaries }
    }

    /// Number of results.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Whether there are no results.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Combines the primary vertices' positions (metres) and normals into those of every overlay vertex.
    ///
    /// Normals are combined like positions and not normalised: normalising once per pixel then shades the skin
    /// exactly like the geometric mesh.
    ///
    /// # Errors
    /// [`SecondaryError`] where a slice is shorter than needed; nothing is written then.
    pub fn update(
        &self,
        primary_positions: &[Vec3],
        primary_normals: &[Vec3],
        out_positions: &mut [Vec3],
        out_normals: &mut [Vec3],
    ) -> Result<(), SecondaryError> {
        let primaries = primary_positions.len().min(primary_normals.len());
        let results = out_positions.len().min(out_normals.len());
        if primaries < self.least_primaries || results < self.vertices.len() {
            return Err(SecondaryError {
                primaries_needed: self.least_primaries,
                primaries,
                results_needed: self.vertices.len(),
                results,
            });
        }
        for ((vertex, position), normal) in self.vertices.iter().zip(out_positions).zip(out_normals) {
            let [a, b, c] = vertex.primary.map(|p| p as usize);
            let [u, v, w] = vertex.weights;
            *position = primary_positions[a] * u + primary_positions[b] * v + primary_positions[c] * w;
            *normal = primary_normals[a] * u + primary_normals[b] * v + primary_normals[c] * w;
        }
        Ok(())
    }
}

/// Buffers too short for the secondary vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect, thiserror::Error)]
#[error(
    "secondary vertices need {primaries_needed} primary vertices and room for {results_needed} results, \
     but got {primaries} and {results}"
)]
pub struct SecondaryError {
    /// Primary positions and normals needed.
    pub primaries_needed: usize,
    /// Primary positions and normals given.
    pub primaries: usize,
    /// Room needed in the results.
    pub results_needed: usize,
    /// Room given.
    pub results: usize,
}
