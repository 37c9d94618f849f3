//! Organs by what they are made of: files with options, and organs that the crate makes.

use super::build::{OrganError, OrganModel, OrganOptions};
use super::cache::OrganCache;
use super::error::{MeshError, MeshFault};
use super::load::{check_unit, scale_to_metres};
use super::procedural::{ProceduralLiver, procedural_liver};
use super::{Organ, ShapeOrgans, procedural_ellipsoid};
use bevy::asset::{AssetLoadError, LoadState};
use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};
use tracing::error;

/// Gives its entity an [`Organ`], made or read off the main thread, or an [`OrganLoadFailed`]. It stays beside the organ, and what
/// is changed in it is made anew.
///
/// A handle alone says neither how its file was read nor, for an organ that a program made, what it was: saved scenes keep this
/// component instead.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform)]
#[cfg_attr(feature = "render", require(Visibility))]
pub struct LoadOrgan {
    /// What it is made of.
    pub source: OrganSource,
    /// How. The options count when a file is first read: Bevy keeps one asset per path.
    pub options: OrganOptions,
}

/// What an organ is made of.
#[derive(Clone, Debug, PartialEq, Reflect, VariantDefaults)]
#[reflect(Default)]
pub enum OrganSource {
    /// The liver that ships with the crate. The options' unit is that of the box's sides.
    Liver(ProceduralLiver),
    /// An ellipsoid about the origin: a phantom, or the wall of a cavity.
    Ellipsoid {
        /// Half its length along each axis, metres.
        semi_axes_m: Vec3,
        /// Parts of each edge of the icosahedron that it is made of, 1 to 64.
        subdivisions: u32,
    },
    /// An asset path: `liver.obj`, `mods://liver.glb`.
    File(String),
}

impl Default for OrganSource {
    fn default() -> Self {
        Self::Liver(ProceduralLiver::default())
    }
}

impl OrganSource {
    /// Makes the organ.
    ///
    /// # Errors
    /// [`OrganError`] for axes or options that make no sense, and for a file: those are read by the asset server.
    pub fn make(&self, options: &OrganOptions, cache: &OrganCache) -> Result<OrganModel, OrganError> {
        let (name, mut mesh) = match self {
            Self::Liver(liver) => ("procedural liver", procedural_liver(liver)),
            Self::Ellipsoid { semi_axes_m, subdivisions } => {
                if !(semi_axes_m.is_finite() && semi_axes_m.cmpgt(Vec3::ZERO).all()) {
                    let reason = format!("{semi_axes_m} m; each must be a positive number");
                    let fault = MeshFault::BadOption { field: "semi_axes_m".into(), reason };
                    return Err(MeshError::new("ellipsoid", fault).into());
                }
                ("ellipsoid", procedural_ellipsoid(*semi_axes_m, *subdivisions))
            }
            Self::File(path) => {
                let error = "a file is read by the asset server".into();
                return Err(OrganError::Io { file: path.clone(), error });
            }
        };
        let unit = options.load.unit;
        let scaled = check_unit(unit).and_then(|()| scale_to_metres(&mut mesh, unit));
        scaled.map_err(|fault| MeshError::new(name, fault))?;
        OrganModel::from_mesh_cached(mesh, name, options, cache)
    }
}

/// A [`LoadOrgan`] came to nothing.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone)]
pub struct OrganLoadFailed(pub OrganError);

/// An organ that is being made.
#[derive(Component)]
struct Making(Task<Result<OrganModel, OrganError>>);

/// Where organs are kept that were made.
#[derive(Resource)]
struct MadeIn(OrganCache);

pub(super) fn build(app: &mut App, cache: OrganCache) {
    app.insert_resource(MadeIn(cache))
        .register_type::<LoadOrgan>()
        .register_type::<OrganSource>()
        .register_type::<OrganLoadFailed>()
        .add_systems(PreUpdate, (begin_making, finish_making, tell_of_files).chain().before(ShapeOrgans));
}

fn begin_making(
    mut commands: Commands,
    wanted: Query<(Entity, &LoadOrgan), Changed<LoadOrgan>>,
    assets: Res<AssetServer>,
    cache: Res<MadeIn>,
) {
    for (entity, LoadOrgan { source, options }) in &wanted {
        let mut entity = commands.entity(entity);
        entity.try_remove::<(OrganLoadFailed, Making)>();
        if let OrganSource::File(path) = source {
            let options = options.clone();
            let set = move |settings: &mut OrganOptions| *settings = options.clone();
            entity.try_insert(Organ(assets.load_builder().with_settings(set).load(path.clone())));
            continue;
        }
        let (source, options, cache) = (source.clone(), options.clone(), cache.0.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move { source.make(&options, &cache) });
        entity.try_insert(Making(task));
    }
}

fn finish_making(
    mut commands: Commands,
    mut making: Query<(Entity, &mut Making, Has<LoadOrgan>)>,
    mut models: ResMut<Assets<OrganModel>>,
) {
    for (entity, mut task, is_wanted) in &mut making {
        let mut entity = commands.entity(entity);
        if !is_wanted {
            entity.try_remove::<Making>();
            continue;
        }
        let Some(made) = block_on(poll_once(&mut task.0)) else { continue };
        entity.try_remove::<Making>();
        match made {
            Ok(model) => entity.try_insert(Organ(models.add(model))),
            Err(reason) => {
                error!("{reason}");
                entity.try_insert(OrganLoadFailed(reason))
            }
        };
    }
}

/// Files that the asset server could not read; it has logged them itself.
fn tell_of_files(
    mut commands: Commands,
    organs: Query<(Entity, &LoadOrgan, &Organ), Without<OrganLoadFailed>>,
    assets: Res<AssetServer>,
) {
    for (entity, wanted, organ) in &organs {
        if let OrganSource::File(path) = &wanted.source
            && let Some(LoadState::Failed(error)) = assets.get_load_state(&organ.0)
        {
            // What the loader says of the file; Bevy wraps it in the loader's name.
            let told = match &*error {
                AssetLoadError::AssetLoaderError(error) => error.error().downcast_ref::<OrganError>().cloned(),
                _ => None,
            };
            let failed = told.unwrap_or_else(|| OrganError::Io { file: path.clone(), error: error.to_string() });
            commands.entity(entity).try_insert(OrganLoadFailed(failed));
        }
    }
}
