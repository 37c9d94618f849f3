//! Organs as Bevy assets.

use super::build::{OrganError, OrganModel, OrganOptions};
use super::cache::OrganCache;
use super::load;
use crate::files::{Fetch, parse_with_siblings};
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use std::time::Instant;
use tracing::info;

/// Loads an [`OrganModel`] from OBJ, STL, PLY, glTF or GLB.
///
/// The work is done off the main thread, and built organs are kept on disk ([`OrganCache`]). The settings are
/// [`OrganOptions`]:
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_surgery::prelude::*;
/// # fn setup(assets: Res<AssetServer>) {
/// let liver: Handle<OrganModel> = assets
///     .load_builder()
///     .with_settings(|options: &mut OrganOptions| *options = OrganOptions::default().with_largest_extent_m(0.22))
///     .load("liver.obj");
/// # }
/// ```
#[derive(TypePath, Default)]
pub struct OrganModelLoader {
    /// Where built organs are kept.
    pub cache: OrganCache,
}

impl AssetLoader for OrganModelLoader {
    type Asset = OrganModel;
    type Settings = OrganOptions;
    type Error = OrganError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        options: &OrganOptions,
        context: &mut LoadContext<'_>,
    ) -> Result<OrganModel, OrganError> {
        let file = context.path().to_string();
        let mut bytes = Vec::new();
        reader
            .read_to_end(&mut bytes)
            .await
            .map_err(|error| OrganError::Io { file: file.clone(), error: error.to_string() })?;
        // A .gltf file names the files with its numbers only inside.
        let parse = |fetch: Fetch<'_>| load::parse_with(&bytes, &file, &options.load, fetch);
        let (mesh, cleaned) = parse_with_siblings(context, parse).await?;
        let started = Instant::now();
        let model = OrganModel::from_mesh_cached(mesh, &file, options, &self.cache)?;
        info!("{file}: {} after {:.2} s; {cleaned:?}", model.describe(), started.elapsed().as_secs_f32());
        Ok(model)
    }

    fn extensions(&self) -> &[&str] {
        &["obj", "stl", "ply", "gltf", "glb"]
    }
}

pub(super) fn build(app: &mut App, cache: OrganCache) {
    app.init_asset::<OrganModel>()
        .register_asset_reflect::<OrganModel>()
        .register_type::<OrganOptions>()
        .register_asset_loader(OrganModelLoader { cache });
}
