//! Reads organ meshes: OBJ, STL, PLY and glTF into one clean [`SurfaceMesh`] in metres.
//!
//! Every reader takes the whole file as bytes, checks what a header claims against what is there before it allocates,
//! and reports what it cannot use as one [`MeshError`]. [`crate::organ::clean`] does the rest.

mod gltf;
mod obj;
mod ply;
mod stl;

use crate::files::excerpt;
use crate::organ::clean::{self, CleanReport, MAX_FACES, MAX_VERTICES, RawMesh, Topology, Weld};
use crate::organ::error::{MeshError, MeshFault};
use crate::organ::mesh::SurfaceMesh;
use bevy::ecs::VariantDefaults;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Largest organ that is believed, metres; anything beyond is a mistaken unit.
pub const MAX_EXTENT_M: f32 = 10.0;
/// Smallest organ that is believed, metres.
pub const MIN_EXTENT_M: f32 = 0.001;

/// How the numbers in a file become metres.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum MeshUnit {
    /// Metres per file unit: 0.001 for millimetres, 0.01 for centimetres.
    Metres(f32),
    /// The largest side of the bounding box is to measure this many metres, whatever the file's unit.
    LargestExtent(f32),
}

impl Default for MeshUnit {
    fn default() -> Self {
        Self::Metres(1.0)
    }
}

/// What to read from a mesh file and what it must satisfy.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct LoadOptions {
    /// How the file's numbers become metres.
    pub unit: MeshUnit,
    /// Use only what lies under this glTF node (or mesh), OBJ object or group, or STL solid. `None`: everything.
    /// Of several unconnected pieces the one with the largest area is kept in either case.
    pub node: Option<String>,
    /// Whether texture seams are kept.
    pub weld: Weld,
    /// What the surface must be.
    pub topology: Topology,
}

/// Reads a mesh whose data are all in `bytes`; the format follows from the name's extension.
///
/// # Errors
/// Everything in [`MeshFault`]; a glTF file with external buffers needs [`parse_with`].
pub fn parse(bytes: &[u8], file_name: &str, options: &LoadOptions) -> Result<SurfaceMesh, MeshError> {
    let mut no_siblings = |_: &str| Err("other files are not read here".to_string());
    parse_with(bytes, file_name, options, &mut no_siblings).map(|(mesh, _)| mesh)
}

/// Reads a mesh, fetching sibling files (glTF buffers) through `fetch`, and tells what cleaning did to it.
///
/// `fetch` gets paths relative to the file's folder, percent-decoded, never absolute and never with `..`.
///
/// # Errors
/// Everything in [`MeshFault`].
pub fn parse_with(
    bytes: &[u8],
    file_name: &str,
    options: &LoadOptions,
    fetch: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<(SurfaceMesh, CleanReport), MeshError> {
    let mut read = || -> Result<(SurfaceMesh, CleanReport), MeshFault> {
        check_unit(options.unit)?;
        let wanted = options.node.as_deref();
        let extension = file_name.rsplit_once('.').map_or("", |(_, extension)| extension);
        let raw = match extension.to_ascii_lowercase().as_str() {
            "obj" => obj::read(bytes, wanted, options.weld)?,
            "stl" => stl::read(bytes, wanted)?,
            "ply" => ply::read(bytes, wanted)?,
            "gltf" | "glb" => gltf::read(bytes, wanted, options.weld, fetch)?,
            _ => return Err(MeshFault::UnknownFormat { extension: excerpt(extension) }),
        };
        let (mut mesh, report) = clean::clean(raw, options.weld, options.topology)?;
        scale_to_metres(&mut mesh, options.unit)?;
        Ok((mesh, report))
    };
    read().map_err(|fault| MeshError::new(file_name, fault))
}

pub(super) fn check_unit(unit: MeshUnit) -> Result<(), MeshFault> {
    let (MeshUnit::Metres(value) | MeshUnit::LargestExtent(value)) = unit;
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(MeshFault::BadOption { field: "unit".into(), reason: format!("{value} is not a positive number of metres") })
}

pub(super) fn scale_to_metres(mesh: &mut SurfaceMesh, unit: MeshUnit) -> Result<(), MeshFault> {
    let (low, high) = mesh.bounds_m();
    let extent = (high.as_dvec3() - low.as_dvec3()).max_element();
    let metres_per_unit = match unit {
        MeshUnit::Metres(metres) => f64::from(metres),
        MeshUnit::LargestExtent(metres) => f64::from(metres) / extent,
    };
    let extent_m = (extent * metres_per_unit) as f32;
    if extent_m > MAX_EXTENT_M {
        return Err(MeshFault::TooLarge { extent_m, limit_m: MAX_EXTENT_M });
    }
    if extent_m < MIN_EXTENT_M {
        return Err(MeshFault::TooSmall { extent_m, limit_m: MIN_EXTENT_M });
    }
    if metres_per_unit != 1.0 {
        for position in &mut mesh.positions_m {
            *position = (position.as_dvec3() * metres_per_unit).as_vec3();
        }
    }
    Ok(())
}

/// Refuses a file that has, or claims, too many faces or vertices to be an organ.
fn check_counts(vertices: u64, faces: u64) -> Result<(), MeshFault> {
    if faces > MAX_FACES {
        return Err(MeshFault::TooMany { what: "faces".into(), count: faces, limit: MAX_FACES });
    }
    if vertices > MAX_VERTICES {
        return Err(MeshFault::TooMany { what: "vertices".into(), count: vertices, limit: MAX_VERTICES });
    }
    Ok(())
}

fn malformed(place: impl Into<String>, reason: impl Into<String>) -> MeshFault {
    MeshFault::Malformed { place: place.into(), reason: reason.into() }
}

/// Appends a polygon as a fan about its first corner; right for convex polygons, which is what exporters write.
fn push_fan(raw: &mut RawMesh, polygon: &[u32]) {
    for pair in polygon.windows(2).skip(1) {
        raw.triangles.push([polygon[0], pair[0], pair[1]]);
    }
}

fn finite(position: Vec3, place: impl FnOnce() -> String) -> Result<Vec3, MeshFault> {
    if position.is_finite() { Ok(position) } else { Err(MeshFault::NotFinite { place: place() }) }
}
