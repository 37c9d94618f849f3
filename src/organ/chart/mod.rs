//! The bijective spherical chart of a closed organ: every place of its surface has one direction, and every direction
//! one place.
//!
//! Two ways lead to it. Where the organ is star-shaped, it is projected from a point inside, as Neyret, Heiss and
//! Senegas (2002, section 4.2.2) do for a liver, provided that no part of it is starved of texels. All others are laid
//! out coarse to fine with the least stretch that keeps every face positive (Praun and Hoppe 2003). Either way the
//! result is checked: no face is flipped or degenerate, and the sphere is covered once.
//!
//! The sphere is then turned so that its poles, where longitude and latitude have no Jacobian, fall on places that are
//! not worked on: see [`Poles`]. By default these are the places that face away most from the side instruments come
//! from; [`ChartReport`] says where the poles went.

mod central;
mod poles;
mod progressive;
mod relax;
mod report;
mod topology;

pub use poles::Poles;
pub use report::{ChartMethod, ChartReport, Distortion, PoleReport};

use super::mesh::SurfaceMesh;
use super::sphere::SphereMesh;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use relax::Effort;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How to chart an organ.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct ChartOptions {
    /// Where the poles go.
    pub poles: Poles,
    /// How much equal area counts against true angles: exponent of the area term of the stretch, 1 to 4. Higher gives
    /// even texels, lower gives less shear.
    pub area_exponent: f64,
    /// Whether the central projection may be used. Needs a star-shaped organ and area ratios within
    /// [`ChartOptions::central_area_ratios`].
    pub allow_central: bool,
    /// Least and greatest area ratio (1st and 99th percentile of all faces) with which the central projection is good
    /// enough.
    pub central_area_ratios: [f64; 2],
    /// Sweeps of the optimiser over the full surface at most.
    pub sweeps: u32,
}

impl Default for ChartOptions {
    fn default() -> Self {
        Self {
            poles: Poles::default(),
            area_exponent: 1.5,
            allow_central: true,
            central_area_ratios: [0.2, 5.0],
            sweeps: 40,
        }
    }
}

/// Why a surface has no spherical chart.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum ChartError {
    /// There are no faces.
    #[error("the surface has no faces")]
    Empty,
    /// A position is infinite or not a number.
    #[error("the position of vertex {vertex} is not finite")]
    NotFinite {
        /// The vertex.
        vertex: u32,
    },
    /// All faces together have no area, or one too large to compute with.
    #[error("the surface has no finite area")]
    NoArea,
    /// A face refers to a vertex that is not there.
    #[error("face {face} refers to vertex {vertex}, which does not exist")]
    NoSuchVertex {
        /// The face.
        face: u32,
        /// The vertex.
        vertex: u32,
    },
    /// A face has the same vertex twice.
    #[error("face {face} uses a vertex twice")]
    RepeatedCorner {
        /// The face.
        face: u32,
    },
    /// A vertex belongs to no face.
    #[error("vertex {vertex} belongs to no face")]
    UnusedVertex {
        /// The vertex.
        vertex: u32,
    },
    /// Two faces run along the same edge in the same direction.
    #[error("two faces use the edge from vertex {} to vertex {} in the same direction", edge[0], edge[1])]
    NotManifold {
        /// The edge's vertices.
        edge: [u32; 2],
    },
    /// The surface has a border.
    #[error(
        "the surface is open at the edge of vertices {} and {}: a spherical chart needs a closed one; \
         its own texture coordinates can be used instead",
        edge[0], edge[1]
    )]
    Open {
        /// The edge's vertices.
        edge: [u32; 2],
    },
    /// Several sheets meet in one vertex.
    #[error("several sheets of the surface meet at vertex {vertex}")]
    PinchedVertex {
        /// The vertex.
        vertex: u32,
    },
    /// The surface falls apart into several closed ones.
    #[error("the surface consists of {count} separate parts: chart them one by one")]
    Parts {
        /// How many.
        count: usize,
    },
    /// The surface has handles.
    #[error(
        "the surface has genus {genus}: a spherical chart needs genus 0; \
         its own texture coordinates can be used instead"
    )]
    Genus {
        /// Number of handles.
        genus: i64,
    },
    /// An option is out of range.
    #[error("area_exponent must lie between 1 and 4, not at {area_exponent}")]
    Options {
        /// The value given.
        area_exponent: f64,
    },
    /// Rounding left no room for a vertex on the sphere; happens to surfaces with an extreme range of edge lengths.
    #[error("the surface could not be laid out on the sphere within the precision of the numbers")]
    Unplaceable,
}

/// Charts a closed surface of genus 0.
///
/// The result has the faces and vertices of the mesh, in its order. Same input, same bits.
///
/// # Errors
/// Says so when the surface is open, of higher genus, in several parts or not a manifold; see [`ChartError`].
pub fn build(mesh: &SurfaceMesh, options: &ChartOptions) -> Result<(SphereMesh, ChartReport), ChartError> {
    if !(1.0..=4.0).contains(&options.area_exponent) {
        return Err(ChartError::Options { area_exponent: options.area_exponent });
    }
    topology::check_sphere(mesh)?;
    let area_m2 = mesh.area_m2();
    if !(area_m2 > 0.0 && area_m2.is_finite()) {
        return Err(ChartError::NoArea);
    }
    let star_centre_m = central::star_centre(mesh);
    let [least, most] = options.central_area_ratios;
    let projected = star_centre_m
        .filter(|_| options.allow_central)
        .and_then(|centre_m| central::project(mesh, centre_m))
        .filter(|chart| Distortion::measure(mesh, chart).is_within(least, most));
    let (method, chart) = match projected {
        Some(chart) => (ChartMethod::CentralProjection, chart),
        None => (ChartMethod::Relaxed, relaxed(mesh, area_m2, options)?),
    };
    let (chart, [north, south]) = poles::aim(mesh, chart, options.poles);
    if !chart.is_positive() {
        return Err(ChartError::Unplaceable);
    }
    let distortion = Distortion::measure(mesh, &chart);
    Ok((chart, ChartReport { method, is_star_shaped: star_centre_m.is_some(), distortion, north, south }))
}

fn relaxed(mesh: &SurfaceMesh, area_m2: f64, options: &ChartOptions) -> Result<SphereMesh, ChartError> {
    // With the organ as large as the unit sphere, lengths on the two compare directly.
    let scale = (4.0 * PI / area_m2).sqrt();
    let positions = mesh.positions_m.iter().map(|position| position.as_dvec3() * scale).collect();
    let mut surface = progressive::Progressive::new(positions, mesh.triangles.clone());
    let effort = Effort {
        theta: options.area_exponent,
        sweeps: 4,
        growth: 1.35,
        final_sweeps: options.sweeps as usize,
        settled: 1e-6,
    };
    let directions = relax::lay_out(&mut surface, &effort).ok_or(ChartError::Unplaceable)?;
    Ok(SphereMesh::new(directions, mesh.triangles.clone()))
}
