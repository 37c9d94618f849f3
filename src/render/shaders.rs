//! Every WGSL file of `shaders/`, embedded in the binary.
//!
//! The folder tree is the module tree: `shaders/skin/skin.wgsl` is `embedded://bevy_surgery/skin/skin.wgsl`. With
//! the feature `dev` Bevy watches the files on disk and reloads them while the app runs.

use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::prelude::*;
use std::path::{Path, PathBuf};

/// A shader file that travels in the binary.
pub struct EmbeddedShader {
    /// Path below `shaders/`.
    pub path: &'static str,
    /// The WGSL text, before Bevy's imports are resolved.
    pub source: &'static str,
    /// Whether other files import it (it has `#define_import_path`), so that it must be kept loaded.
    pub is_library: bool,
}

macro_rules! shader {
    ($path:literal, $is_library:literal) => {
        EmbeddedShader {
            path: $path,
            source: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $path)),
            is_library: $is_library,
        }
    };
}

/// All shaders of the crate; a test compares this list with the folder.
pub const SHADERS: &[EmbeddedShader] = &[
    shader!("highlights/highlights.wgsl", false),
    shader!("lights.wgsl", true),
    shader!("organ.wgsl", true),
    shader!("pool/composite.wgsl", false),
    shader!("pool/foam.wgsl", true),
    shader!("pool/pool.wgsl", true),
    shader!("pool/surroundings.wgsl", true),
    shader!("pool/act.wgsl", false),
    shader!("pool/carry.wgsl", false),
    shader!("pool/diffuse.wgsl", false),
    shader!("pool/flow.wgsl", true),
    shader!("pool/project.wgsl", false),
    shader!("pool/publish.wgsl", false),
    shader!("pool/settle.wgsl", false),
    shader!("pool/sums.wgsl", false),
    shader!("reactions/reactions.wgsl", false),
    shader!("skin/skin.wgsl", false),
    shader!("view/mask.wgsl", false),
    shader!("view/tool_shadow_map.wgsl", false),
    shader!("view/tool_shadows.wgsl", false),
    shader!("volume/aligned.wgsl", false),
    shader!("volume/composite.wgsl", false),
    shader!("volume/deform.wgsl", true),
    shader!("volume/field.wgsl", true),
    shader!("volume/hidden.wgsl", false),
    shader!("volume/march.wgsl", false),
    shader!("volume/patches.wgsl", true),
    shader!("volume/resolve.wgsl", false),
    shader!("volume/slices.wgsl", false),
    shader!("volume/smooth.wgsl", false),
    shader!("volume/start.wgsl", false),
    shader!("volume/volume.wgsl", true),
    shader!("volume/walk.wgsl", true),
    shader!("volume/wet.wgsl", false),
];

/// The asset path of an embedded shader.
pub fn shader_path(path: &str) -> String {
    format!("embedded://{}/{path}", env!("CARGO_PKG_NAME"))
}

/// Importers wait for ever for a library whose handle was dropped.
#[derive(Resource)]
struct KeptLibraries(#[expect(dead_code, reason = "held, never read")] Vec<Handle<Shader>>);

pub(super) fn embed(app: &mut App) {
    let registry = app.world_mut().resource_mut::<EmbeddedAssetRegistry>();
    for shader in SHADERS {
        registry.insert_asset(
            // The file that the watcher of feature `dev` looks at.
            PathBuf::from("shaders").join(shader.path),
            &Path::new(env!("CARGO_PKG_NAME")).join(shader.path),
            shader.source.as_bytes(),
        );
    }
    let assets = app.world().resource::<AssetServer>();
    let libraries =
        SHADERS.iter().filter(|shader| shader.is_library).map(|shader| assets.load(shader_path(shader.path))).collect();
    app.insert_resource(KeptLibraries(libraries));
}
