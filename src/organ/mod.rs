//! The organ as geometry: a closed surface, its spherical chart, and the texture mesh that carries its skin.
//!
//! An [`OrganModel`] is everything that can be known of an organ before it moves: the [`SurfaceMesh`] that a file
//! held, the bijective chart ([`chart`]), the table from texture coordinates to faces ([`atlas`]) and the overlay of a
//! near-regular texture mesh ([`texture_mesh`]). It is loaded off the main thread and cached on disk. An entity with
//! the [`Organ`] component shows one; its [`OrganShape`] holds where the vertices are now.
//!
//! The models in here are plain Rust and know neither ECS nor GPU.

mod asset;
pub mod atlas;
mod build;
mod cache;
pub mod chart;
pub mod clean;
pub(crate) mod closest;
mod ellipsoid;
pub mod error;
pub mod load;
pub mod mesh;
pub mod pick;
mod pick_segment;
mod picking;
pub mod planar;
pub mod procedural;
#[cfg(feature = "render")]
pub mod render;
mod shape;
mod source;
pub mod sphere;
pub mod surface;
pub mod texture_mesh;

pub use asset::OrganModelLoader;
pub use build::{ChartKind, OrganError, OrganModel, OrganOptions, OrganParts, OrganReport};
pub use cache::OrganCache;
pub use ellipsoid::procedural_ellipsoid;
pub use mesh::SurfaceMesh;
pub use pick_segment::SegmentHit;
pub(crate) use picking::refit_pickers;
pub use picking::{OrganHit, OrganPicking};
pub use shape::{Hollow, Organ, OrganShape, ShapeOrgans, awaited_models};
pub use source::{LoadOrgan, OrganLoadFailed, OrganSource};
pub use sphere::{SphereMesh, SurfacePoint};

use bevy::prelude::*;

/// Loads organs and keeps their shapes. See the [module](self).
#[derive(Default)]
pub struct OrganPlugin {
    /// Where built organs are kept between runs.
    pub cache: OrganCache,
}

impl Plugin for OrganPlugin {
    fn build(&self, app: &mut App) {
        asset::build(app, self.cache.clone());
        shape::build(app);
        picking::build(app);
        source::build(app, self.cache.clone());
        app.register_type::<OrganParts>()
            .register_type::<OrganCache>()
            .register_type::<atlas::SurfaceFrame>()
            .register_type::<pick::OrganPicker>()
            .register_type::<pick::PickHit>()
            .register_type::<pick::NearestHit>()
            .register_type::<SegmentHit>()
            .register_type::<clean::CleanReport>()
            .register_type::<clean::RawMesh>()
            .register_type::<procedural::ProceduralLiver>()
            .register_type::<texture_mesh::SecondaryVertices>();
        app.register_type::<OrganError>()
            .register_type::<error::MeshError>()
            .register_type::<error::MeshFault>()
            .register_type::<chart::ChartError>()
            .register_type::<planar::PlanarError>()
            .register_type::<texture_mesh::TextureMeshError>()
            .register_type::<texture_mesh::SecondaryError>();
        #[cfg(feature = "render")]
        render::build(app);
    }
}
