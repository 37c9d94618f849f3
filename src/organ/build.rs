//! From a surface to everything that is known of an organ before it moves.

use super::atlas::{Atlas, FaceTable};
use super::cache::OrganCache;
use super::chart::{self, ChartError, ChartOptions, ChartReport};
use super::error::MeshError;
use super::load::{LoadOptions, MeshUnit};
use super::mesh::{NO_FACE, SurfaceMesh};
use super::planar::{PlanarChart, PlanarError};
use super::procedural::ProceduralLiver;
use super::source::OrganSource;
use super::sphere::SphereMesh;
use super::texture_mesh::{self, SkinMesh, TextureMesh, TextureMeshError, TextureMeshOptions, TextureMeshReport};
use bevy::asset::Asset;
use bevy::ecs::VariantDefaults;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
#[cfg(feature = "render")]
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::ops::Deref;
use std::sync::Arc;

/// How an organ gets its texture coordinates.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum ChartKind {
    /// The bijective spherical chart of a closed surface of genus 0.
    Sphere(ChartOptions),
    /// The file's own texture coordinates, which must be bijective: for open surfaces and handles. Load such meshes
    /// with [`Weld::ByPositionAndUv`](super::clean::Weld) and [`Topology::Any`](super::clean::Topology).
    OwnUvs,
}

impl Default for ChartKind {
    fn default() -> Self {
        Self::Sphere(ChartOptions::default())
    }
}

/// How to make an organ from a mesh; also the settings of [`OrganModelLoader`](super::OrganModelLoader).
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct OrganOptions {
    /// What to read from the file.
    pub load: LoadOptions,
    /// Whether the middle of the organ's box is moved to its origin. Off by default: the organs of one patient keep
    /// their places.
    pub centre: bool,
    /// How it gets its texture coordinates.
    pub chart: ChartKind,
    /// The triangles that carry its skin.
    pub texture_mesh: TextureMeshOptions,
    /// Width of the table from (u,v) to faces, in texels; its height is half of that.
    pub table_width_px: u32,
}

impl Default for OrganOptions {
    fn default() -> Self {
        Self {
            load: LoadOptions::default(),
            centre: false,
            chart: ChartKind::default(),
            texture_mesh: TextureMeshOptions::default(),
            table_width_px: 1024,
        }
    }
}

impl OrganOptions {
    /// The largest side of the organ's box is to measure this many metres, whatever the file's unit.
    pub fn with_largest_extent_m(mut self, extent_m: f32) -> Self {
        self.load.unit = MeshUnit::LargestExtent(extent_m);
        self
    }

    /// The middle of the organ's box is to be its origin.
    pub fn centred(mut self) -> Self {
        self.centre = true;
        self
    }
}

/// Why a file is no organ.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum OrganError {
    /// The file could not be read from its place.
    #[error("{file}: {error}")]
    Io {
        /// The file.
        file: String,
        /// What the reader said.
        error: String,
    },
    /// The file holds no usable surface.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The surface has no spherical chart.
    #[error("{file}: {error}")]
    Chart {
        /// The file.
        file: String,
        /// The reason.
        error: ChartError,
    },
    /// The file's own texture coordinates cannot be used.
    #[error("{file}: {error}")]
    OwnUvs {
        /// The file.
        file: String,
        /// The reason.
        error: PlanarError,
    },
    /// The surface cannot carry a texture mesh.
    #[error("{file}: {error}")]
    TextureMesh {
        /// The file.
        file: String,
        /// The reason.
        error: TextureMeshError,
    },
    /// The table's width is not usable.
    #[error("{file}: table_width_px is {width_px}; it must be between 16 and 8192")]
    TableWidth {
        /// The file.
        file: String,
        /// What was asked for.
        width_px: u32,
    },
}

/// How well the parts of an organ turned out.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct OrganReport {
    /// The spherical chart; `None` for an organ with its own texture coordinates.
    pub chart: Option<ChartReport>,
    /// The texture mesh.
    pub texture_mesh: TextureMeshReport,
}

/// What is made of a surface once and kept on disk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BuiltOrgan {
    chart: SphereMesh,
    texture_mesh: TextureMesh,
    skin_mesh: SkinMesh,
    report: OrganReport,
}

/// Everything that is known of an organ before it moves.
#[derive(Clone, Debug, Reflect)]
pub struct OrganParts {
    /// The surface at rest.
    pub mesh: SurfaceMesh,
    /// Its chart, between places of the surface and texture coordinates.
    pub atlas: Atlas,
    /// Which face each texel of the reaction map lies in.
    pub table: FaceTable,
    /// The near-regular triangles that carry the skin.
    pub texture_mesh: TextureMesh,
    /// These triangles laid over the surface.
    pub skin_mesh: SkinMesh,
    /// How well it all turned out.
    pub report: OrganReport,
}

/// An organ before it moves; cheap to clone.
#[derive(Asset, Clone, Debug, Reflect)]
#[reflect(opaque)]
pub struct OrganModel(Arc<OrganParts>);

impl Deref for OrganModel {
    type Target = OrganParts;

    fn deref(&self) -> &OrganParts {
        &self.0
    }
}

impl OrganModel {
    /// Makes an organ from a surface. `name` is what errors call it. A closed surface whose faces look inward is turned
    /// outward, as in files.
    ///
    /// # Errors
    /// [`OrganError`] where the surface has no chart of the asked kind or an option makes no sense.
    pub fn from_mesh(mesh: SurfaceMesh, name: &str, options: &OrganOptions) -> Result<Self, OrganError> {
        Self::from_mesh_cached(mesh, name, options, &OrganCache::off())
    }

    /// Like [`OrganModel::from_mesh`], but looks into a cache first and leaves what it made there.
    ///
    /// # Errors
    /// As [`OrganModel::from_mesh`]; a cache that cannot be read or written is no error, only slow.
    pub fn from_mesh_cached(
        mut mesh: SurfaceMesh,
        name: &str,
        options: &OrganOptions,
        cache: &OrganCache,
    ) -> Result<Self, OrganError> {
        let width_px = options.table_width_px;
        if !(16..=8192).contains(&width_px) {
            return Err(OrganError::TableWidth { file: name.into(), width_px });
        }
        turn_outward(&mut mesh);
        if options.centre {
            let (low, high) = mesh.bounds_m();
            mesh.positions_m.iter_mut().for_each(|position| *position -= (low + high) * 0.5);
        }
        let key = cache.key(&mesh, options);
        let built = match cache.load(&key).filter(|built| built.chart.triangles == mesh.triangles) {
            Some(built) => built,
            None => {
                let built = build_parts(&mesh, name, options)?;
                cache.store(&key, &built);
                built
            }
        };
        let atlas = match options.chart {
            ChartKind::Sphere(_) => Atlas::Spherical(built.chart),
            ChartKind::OwnUvs => Atlas::Planar(own_uvs(&mesh, name)?),
        };
        let table = atlas.table(width_px, width_px / 2);
        let (texture_mesh, skin_mesh, report) = (built.texture_mesh, built.skin_mesh, built.report);
        Ok(Self(Arc::new(OrganParts { mesh, atlas, table, texture_mesh, skin_mesh, report })))
    }

    /// Whether this is the very same model, and not only an equal one.
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// What it is made of, in a line for the log: sizes, how it was charted and where the chart's poles went.
    pub fn describe(&self) -> String {
        let sizes = format!(
            "{} faces, {} texture triangles, {} skin triangles",
            self.mesh.triangles.len(),
            self.report.texture_mesh.triangles,
            self.report.texture_mesh.overlay_triangles
        );
        match &self.report.chart {
            None => format!("{sizes}, its own texture coordinates"),
            Some(chart) => format!(
                "{sizes}, chart {:?} with area ratios {:.2} to {:.2}, poles at {:.3} m (facing {:.2}) and {:.3} m \
                 (facing {:.2}), away from where instruments come from",
                chart.method,
                chart.distortion.area_p1,
                chart.distortion.area_p99,
                chart.north.position_m,
                chart.north.normal,
                chart.south.position_m,
                chart.south.normal
            ),
        }
    }

    /// The liver that ships with the crate: smooth, two-lobed, not star-shaped, some 22 cm wide unless the options'
    /// unit says otherwise. Some tenths of a second the first time, then from the user's cache.
    ///
    /// # Errors
    /// As [`OrganModel::from_mesh`], for senseless options; as for files, a senseless unit is one.
    pub fn procedural_liver(options: &OrganOptions) -> Result<Self, OrganError> {
        OrganSource::Liver(ProceduralLiver::default()).make(options, &OrganCache::default())
    }
}

/// Turns a closed surface that encloses a negative volume: its skin would be drawn from inside, and lit there.
///
/// Open surfaces have no outside, and faulty ones are left to whoever names the fault.
fn turn_outward(mesh: &mut SurfaceMesh) {
    let count = mesh.positions_m.len();
    let is_sound = mesh.triangles.as_flattened().iter().all(|&vertex| (vertex as usize) < count);
    // Finding borders sorts all edges: asked last, because files were turned when they were read.
    if is_sound && mesh.volume_m3() < 0.0 && !mesh.neighbours().as_flattened().contains(&NO_FACE) {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
}

fn own_uvs(mesh: &SurfaceMesh, name: &str) -> Result<PlanarChart, OrganError> {
    PlanarChart::new(mesh).map_err(|error| OrganError::OwnUvs { file: name.into(), error })
}

fn build_parts(mesh: &SurfaceMesh, name: &str, options: &OrganOptions) -> Result<BuiltOrgan, OrganError> {
    let file = || name.to_string();
    let texture_error = |error| OrganError::TextureMesh { file: file(), error };
    let (chart, chart_report, (texture_mesh, skin_mesh, texture_report)) = match &options.chart {
        ChartKind::Sphere(chart_options) => {
            let (chart, report) =
                chart::build(mesh, chart_options).map_err(|error| OrganError::Chart { file: file(), error })?;
            let texture = texture_mesh::build(mesh, &chart, &options.texture_mesh).map_err(texture_error)?;
            (chart, Some(report), texture)
        }
        ChartKind::OwnUvs => {
            let chart = own_uvs(mesh, name)?.chart().clone();
            let texture = texture_mesh::build_planar(mesh, &chart, &options.texture_mesh).map_err(texture_error)?;
            (chart, None, texture)
        }
    };
    let report = OrganReport { chart: chart_report, texture_mesh: texture_report };
    Ok(BuiltOrgan { chart, texture_mesh, skin_mesh, report })
}

#[cfg(feature = "render")]
impl OrganModel {
    /// Vertices of the skin as the GPU reads them.
    pub(crate) fn corner_vertices(&self) -> Vec<super::render::CornerVertex> {
        let corners = self.skin_mesh.corners.iter();
        corners
            .map(|corner| {
                let vertex = &self.skin_mesh.secondary[corner.vertex as usize];
                let rest = self.skin_mesh.position_m(corner.vertex, &self.mesh.positions_m);
                let directions = &self.atlas.chart().directions;
                let along: DVec3 =
                    (0..3).map(|k| directions[vertex.primary[k] as usize] * f64::from(vertex.weights[k])).sum();
                let on_chart =
                    if self.atlas.is_spherical() { along } else { self.atlas.uv_from_direction(along).extend(1.0) };
                super::render::CornerVertex {
                    primaries: vertex.primary,
                    weights: vertex.weights,
                    tile_barycentric: [corner.tile_barycentric[0], corner.tile_barycentric[1]],
                    texture_triangle: corner.texture_triangle,
                    rest_position_m: rest.as_vec3().to_array(),
                    chart_direction: on_chart.as_vec3().to_array(),
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::organ::procedural_ellipsoid;
    use glam::Vec3;

    fn options() -> OrganOptions {
        OrganOptions { table_width_px: 64, ..OrganOptions::default() }
    }

    #[test]
    fn a_surface_that_looks_inward_is_turned() {
        let outward = procedural_ellipsoid(Vec3::new(0.1, 0.08, 0.12), 6);
        let mut inward = outward.clone();
        inward.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        assert!(inward.volume_m3() < 0.0);
        let organ = OrganModel::from_mesh(inward, "inside out", &options()).expect("it can be turned");
        assert_eq!(organ.mesh, outward);
        let straight = OrganModel::from_mesh(outward, "straight", &options()).expect("an ellipsoid is an organ");
        assert_eq!(organ.skin_mesh, straight.skin_mesh);
    }

    #[test]
    fn turning_leaves_faulty_surfaces_to_those_who_name_the_fault() {
        let mut open = procedural_ellipsoid(Vec3::splat(0.1), 2);
        open.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        open.triangles.pop();
        let mut beyond = open.clone();
        beyond.triangles.push([0, 1, 9_999]);
        for faulty in [open, beyond, SurfaceMesh::default()] {
            let mut turned = faulty.clone();
            turn_outward(&mut turned);
            assert_eq!(turned, faulty);
            assert!(matches!(OrganModel::from_mesh(faulty, "faulty", &options()), Err(OrganError::Chart { .. })));
        }
    }

    #[test]
    fn a_senseless_unit_is_an_error_for_the_crates_own_liver_too() {
        let senseless = [f32::NAN, f32::INFINITY, 0.0, -0.2, 1e-9, 1e9];
        let units = senseless.into_iter().flat_map(|value| [MeshUnit::Metres(value), MeshUnit::LargestExtent(value)]);
        for unit in units {
            let options = OrganOptions { load: LoadOptions { unit, ..LoadOptions::default() }, ..options() };
            let made = OrganModel::procedural_liver(&options);
            assert!(matches!(made, Err(OrganError::Mesh(_))), "{unit:?}: {made:?}");
        }
    }
}
