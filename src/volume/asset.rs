//! Volumes as Bevy assets, and volumes of the file system.

use super::error::VolumeError;
use super::load::{VolumeLoadOptions, load_path, parse_with};
use super::phantom::{PhantomOptions, phantom};
use super::structures::Structures;
use super::{CtVolume, Volume};
use crate::files::{Fetch, parse_with_siblings};
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};
use std::path::PathBuf;
use std::time::Instant;
use tracing::{error, info};

/// Loads a [`Volume`] from NRRD, NIfTI, MetaImage or a single DICOM file, with the structures that
/// [`Structures::for_volume`] finds in it. Folders of slices are read by [`LoadVolume`].
#[derive(TypePath, Default)]
pub struct VolumeLoader;

impl AssetLoader for VolumeLoader {
    type Asset = Volume;
    type Settings = VolumeLoadOptions;
    type Error = VolumeError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        options: &VolumeLoadOptions,
        context: &mut LoadContext<'_>,
    ) -> Result<Volume, VolumeError> {
        let file = context.path().to_string();
        let mut bytes = Vec::new();
        let unreadable = |reason: String| VolumeError::new(&*file, super::error::VolumeFault::Unreadable { reason });
        reader.read_to_end(&mut bytes).await.map_err(|error| unreadable(error.to_string()))?;
        // A header may name the files with its voxels only inside.
        let parse = |fetch: Fetch<'_>| parse_with(&bytes, &file, options, fetch);
        let (volume, _) = parse_with_siblings(context, parse).await?;
        structured(volume, &file)
    }

    fn extensions(&self) -> &[&str] {
        &["nrrd", "nhdr", "nii", "nii.gz", "hdr", "mhd", "mha", "dcm"]
    }
}

fn structured(volume: Volume, file: &str) -> Result<Volume, VolumeError> {
    let named = |fault| VolumeError::new(file, fault);
    let structures = Structures::for_volume(&volume).map_err(named)?;
    volume.with_structures(structures).map_err(named)
}

/// Loads a volume from a path of the file system, off the main thread: a file of any format, or a folder that holds a DICOM
/// series or a stack of pictures. Its entity gets a [`CtVolume`], or a [`VolumeLoadFailed`]. It stays beside the volume, so that
/// saved scenes know where that came from, and what is changed in it is loaded anew.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform)]
#[cfg_attr(feature = "render", require(Visibility))]
pub struct LoadVolume {
    /// The file or folder.
    pub path: PathBuf,
    /// What to read from it.
    pub options: VolumeLoadOptions,
}

/// Makes a [`phantom`] off the main thread. Its entity gets a [`CtVolume`], or a [`VolumeLoadFailed`]; beside a [`LoadVolume`] it
/// does nothing. It stays beside the volume, as [`LoadVolume`] does.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform)]
#[cfg_attr(feature = "render", require(Visibility))]
pub struct MakePhantom(pub PhantomOptions);

/// A [`LoadVolume`] or [`MakePhantom`] came to nothing.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone)]
pub struct VolumeLoadFailed(pub VolumeError);

#[derive(Component)]
struct Loading(Task<Result<Volume, VolumeError>>);

pub(super) fn build(app: &mut App) {
    app.init_asset::<Volume>()
        .register_asset_reflect::<Volume>()
        .register_type::<VolumeLoadOptions>()
        .register_type::<LoadVolume>()
        .register_type::<MakePhantom>()
        .register_type::<VolumeLoadFailed>()
        .register_asset_loader(VolumeLoader)
        .add_systems(PreUpdate, (begin_loading, begin_phantoms, finish_loading).chain().before(super::PrepareCuts));
}

fn begin_loading(mut commands: Commands, wanted: Query<(Entity, &LoadVolume), Changed<LoadVolume>>) {
    for (entity, LoadVolume { path, options }) in &wanted {
        let (path, options) = (path.clone(), options.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let started = Instant::now();
            let (volume, report) = load_path(&path, &options)?;
            let file = path.display().to_string();
            let volume = structured(volume, &file)?;
            let (size, seconds) = (volume.grid().size, started.elapsed().as_secs_f32());
            info!("{file}: {size} voxels after {seconds:.2} s; {report:?}");
            Ok(volume)
        });
        commands.entity(entity).try_remove::<VolumeLoadFailed>().try_insert(Loading(task));
    }
}

type Unmade = (Changed<MakePhantom>, Without<LoadVolume>);

fn begin_phantoms(mut commands: Commands, wanted: Query<(Entity, &MakePhantom), Unmade>) {
    for (entity, &MakePhantom(options)) in &wanted {
        let task = async move { phantom(&options).map_err(|fault| VolumeError::new("phantom", fault)) };
        let task = AsyncComputeTaskPool::get().spawn(task);
        commands.entity(entity).try_remove::<VolumeLoadFailed>().try_insert(Loading(task));
    }
}

type Awaited = Or<(With<LoadVolume>, With<MakePhantom>)>;

fn finish_loading(
    mut commands: Commands,
    mut loading: Query<(Entity, &mut Loading), Awaited>,
    given_up: Query<Entity, (With<Loading>, Without<LoadVolume>, Without<MakePhantom>)>,
    mut volumes: ResMut<Assets<Volume>>,
) {
    for entity in &given_up {
        commands.entity(entity).try_remove::<Loading>();
    }
    for (entity, mut task) in &mut loading {
        let Some(loaded) = block_on(poll_once(&mut task.0)) else { continue };
        let mut entity = commands.entity(entity);
        entity.try_remove::<Loading>();
        match loaded {
            Ok(volume) => entity.try_insert(CtVolume(volumes.add(volume))),
            Err(reason) => {
                error!("{reason}");
                entity.try_insert(VolumeLoadFailed(reason))
            }
        };
    }
}
