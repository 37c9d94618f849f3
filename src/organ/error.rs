//! What can be wrong with a mesh file, said to the person who has to fix it.

use crate::files::excerpt;
use bevy::reflect::Reflect;
use glam::Vec3;

/// A mesh file that cannot be used: which file, and why.
///
/// Positions in the message are in the file's own units (glTF: after the node transforms), so that they can be
/// looked up in the program that made it.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
#[error("{file}: {fault}")]
pub struct MeshError {
    /// The file as it was named to the loader.
    pub file: String,
    /// What is wrong with it.
    pub fault: MeshFault,
}

impl MeshError {
    /// Names the file that a fault was found in.
    pub fn new(file: impl Into<String>, fault: MeshFault) -> Self {
        Self { file: file.into(), fault }
    }
}

/// Why a mesh cannot be used. One variant per reason; numbers are counts over the whole mesh, places are the first.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum MeshFault {
    /// The name ends in nothing that a reader exists for.
    #[error("`{extension}` is not a mesh format that can be read; use obj, stl, ply, gltf or glb")]
    UnknownFormat {
        /// What follows the last dot of the name.
        extension: String,
    },
    /// No faces at all.
    #[error("there are no faces in it")]
    Empty,
    /// The file ends before what it announces.
    #[error("{what}: {found} found where at least {expected} belong; the file is cut off or its header is wrong")]
    Truncated {
        /// What falls short, with its unit ("bytes of facets").
        what: String,
        /// How many there ought to be.
        expected: u64,
        /// How many there are.
        found: u64,
    },
    /// Something in the file does not follow its format.
    #[error("{place}: {reason}")]
    Malformed {
        /// Line, element or index.
        place: String,
        /// What is wrong there.
        reason: String,
    },
    /// Valid, but not read here.
    #[error("{what} is not supported; {advice}")]
    Unsupported {
        /// The feature.
        what: String,
        /// What to do instead.
        advice: String,
    },
    /// A file that belongs to this one could not be fetched.
    #[error("its buffer `{path}` cannot be read: {reason}")]
    MissingFile {
        /// Path as the file gives it.
        path: String,
        /// Why not.
        reason: String,
    },
    /// A file refers to something outside its own folder.
    #[error("its buffer `{path}` lies outside the file's own folder; put it beside the file and name it relatively")]
    ForbiddenPath {
        /// Path as the file gives it.
        path: String,
    },
    /// The wanted node, object or group is not there.
    #[error("there is no node, object or group `{wanted}`; there are: {}", list(.names))]
    NoSuchNode {
        /// What was asked for.
        wanted: String,
        /// The names in the file, in its order.
        names: Vec<String>,
    },
    /// NaN or infinite position or texture coordinate.
    #[error("{place}: a coordinate is not a finite number")]
    NotFinite {
        /// Line, element or index.
        place: String,
    },
    /// A face uses a vertex that is not there.
    #[error("{place}: {what} {index} is used, but there are only {count}")]
    IndexOutOfRange {
        /// Line, element or index of the face.
        place: String,
        /// "vertex" or "texture coordinate".
        what: String,
        /// The index as the file has it.
        index: i64,
        /// How many there are.
        count: u64,
    },
    /// More faces or vertices than anything sensible has.
    #[error("it has {count} {what}, the limit is {limit}; decimate it first (a few thousand faces are plenty)")]
    TooMany {
        /// "faces" or "vertices".
        what: String,
        /// How many the file has (or has at least).
        count: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// All vertices lie in one point, on one line or in one plane, or the surface encloses nothing.
    #[error("it is flat: its box measures {:?} file units and it encloses no volume", .extent.to_array())]
    Flat {
        /// Sides of the bounding box in file units.
        extent: Vec3,
    },
    /// Larger than anything on an operating table.
    #[error(
        "it would be {extent_m} m across, the limit is {limit_m} m; set the unit (`MeshUnit::Metres(0.001)` for \
         millimetres, `MeshUnit::LargestExtent(0.2)` for 0.2 m across)"
    )]
    TooLarge {
        /// Largest side of the box after scaling, metres.
        extent_m: f32,
        /// Limit in metres.
        limit_m: f32,
    },
    /// Too small to be an organ.
    #[error(
        "it would be {extent_m} m across, the least is {limit_m} m; set the unit (`MeshUnit::Metres(1.0)` for \
         metres, `MeshUnit::LargestExtent(0.2)` for 0.2 m across)"
    )]
    TooSmall {
        /// Largest side of the box after scaling, metres.
        extent_m: f32,
        /// Limit in metres.
        limit_m: f32,
    },
    /// A load option that makes no sense.
    #[error("load option `{field}`: {reason}")]
    BadOption {
        /// Name of the option.
        field: String,
        /// What is wrong with its value.
        reason: String,
    },
    /// Texture coordinates are asked for and missing.
    #[error(
        "{place}: there are no texture coordinates, but the file's own are to be used; unwrap it or set `weld: ByPosition`"
    )]
    NoUvs {
        /// Where they are missing.
        place: String,
    },
    /// Too many faces without area.
    #[error(
        "{degenerate} of {faces} faces have no area, the first at {}; merge doubled vertices and dissolve degenerate \
         faces",
        place(*.at)
    )]
    Degenerate {
        /// Faces without area.
        degenerate: u64,
        /// All faces.
        faces: u64,
        /// A corner of the first one.
        at: Vec3,
    },
    /// The surface has a border.
    #[error(
        "{border_edges} border edges, the first from {} to {}: the surface must be closed; fill the holes or use its \
         own texture coordinates (`chart: OwnUvs`, `weld: ByPositionAndUv`, `topology: Any`)",
        place(*.from),
        place(*.to)
    )]
    NotClosed {
        /// Edges with a face on one side only.
        border_edges: u64,
        /// One end of the first.
        from: Vec3,
        /// The other end.
        to: Vec3,
    },
    /// Edges with more than two faces.
    #[error(
        "{edges} edges have more than two faces (the first, from {} to {}, has {faces_there}); remove inner walls and \
         doubled faces",
        place(*.from),
        place(*.to)
    )]
    NotManifoldEdge {
        /// Edges with more than two faces.
        edges: u64,
        /// Faces at the first of them.
        faces_there: u64,
        /// One end of the first.
        from: Vec3,
        /// The other end.
        to: Vec3,
    },
    /// Vertices where two sheets touch in one point.
    #[error("{vertices} vertices join parts that touch in one point only, the first at {}; separate them", place(*.at))]
    NotManifoldVertex {
        /// How many.
        vertices: u64,
        /// The first.
        at: Vec3,
    },
    /// A Moebius band or Klein bottle.
    #[error(
        "it has no inside and outside (like a Moebius band): the faces at the edge from {} to {} cannot be made to \
         agree",
        place(*.from),
        place(*.to)
    )]
    NotOrientable {
        /// One end of an edge where they disagree.
        from: Vec3,
        /// The other end.
        to: Vec3,
    },
    /// Handles (tunnels) in a surface that must be a deformed sphere.
    #[error(
        "it has {genus} handle(s) or tunnel(s), a chart over the sphere needs none; close them or use its own texture \
         coordinates (`chart: OwnUvs`, `weld: ByPositionAndUv`, `topology: Any`)"
    )]
    Genus {
        /// Number of handles.
        genus: u64,
    },
}

/// A position as a reader can search for it.
fn place(at: Vec3) -> String {
    format!("({}, {}, {})", at.x, at.y, at.z)
}

/// Names for a message; the tail of a long list only adds noise.
fn list(names: &[String]) -> String {
    const SHOWN: usize = 12;
    if names.is_empty() {
        return "none with a name".into();
    }
    let shown: Vec<String> = names.iter().take(SHOWN).map(|name| format!("`{}`", excerpt(name))).collect();
    match names.len().saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}
