//! What the render world takes of pools each frame.

use super::textures::PoolTextures;
use crate::pool::{FoamPatch, PoolGrid, PoolLook, PoolSurface, SURFACE_TILE};
use bevy::camera::visibility::RenderLayers;
use bevy::light::EnvironmentMapLight;
use bevy::math::Affine3A;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::{MainEntity, RenderEntity};

/// A pool of this frame.
pub(super) struct ExtractedPool {
    pub entity: MainEntity,
    pub grid: PoolGrid,
    pub level_m: f32,
    pub look: PoolLook,
    pub foam: Vec<FoamPatch>,
    pub layers: RenderLayers,
    /// Rotation and place only.
    pub world_from_pool: Affine3A,
    /// What the tiles cover, metres in the pool's plane.
    pub wet_m: Rect,
    pub revision: u64,
    /// Where the GPU's copy is old.
    pub changed: Option<PoolUpload>,
}

/// Texels on their way to the GPU.
pub(super) struct PoolUpload {
    /// Rows from the first one on.
    pub first_row: u32,
    pub texels: Vec<[u16; 4]>,
    pub tiles: Vec<UVec2>,
    /// Rows of tiles that hold fluid.
    pub wet_rows: [u32; 2],
}

/// The surroundings that a camera brings.
pub(super) struct ExtractedSurroundings {
    pub map: AssetId<Image>,
    pub intensity: f32,
    pub rotation: Quat,
}

/// Every pool of this frame, in order of their entities, and the surroundings of the views.
#[derive(Resource, Default)]
pub(super) struct ExtractedPools {
    pub pools: Vec<ExtractedPool>,
    /// By view.
    pub surroundings: HashMap<Entity, ExtractedSurroundings>,
}

type Shown = (
    Entity,
    &'static PoolSurface,
    &'static PoolLook,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static RenderLayers>,
);

pub(super) fn extract_pools(
    mut extracted: ResMut<ExtractedPools>,
    textures: Res<PoolTextures>,
    pools: Extract<Query<Shown>>,
    cameras: Extract<Query<(RenderEntity, &EnvironmentMapLight), With<Camera3d>>>,
) {
    extracted.pools.clear();
    extracted.surroundings.clear();
    for (entity, surface, look, transform, visible, layers) in pools.iter() {
        let (_, rotation, translation) = transform.to_scale_rotation_translation();
        let has_place = translation.length_squared().is_finite() && rotation.is_normalized();
        if !visible.get() || !has_place || !surface.is_good() || surface.wet_tiles.is_empty() {
            continue;
        }
        let entity = MainEntity::from(entity);
        extracted.pools.push(ExtractedPool {
            entity,
            grid: surface.grid,
            level_m: surface.level_m,
            look: look.sane(),
            foam: surface.good_foam().copied().collect(),
            layers: layers.cloned().unwrap_or_default(),
            world_from_pool: Affine3A::from_rotation_translation(rotation, translation),
            wet_m: wet_area_m(surface),
            revision: surface.revision,
            changed: textures.needs(entity, &surface.grid, surface.revision).map(|was_wet| upload(surface, was_wet)),
        });
    }
    extracted.pools.sort_by_key(|pool| pool.entity);
    if extracted.pools.is_empty() {
        return;
    }
    for (view, light) in cameras.iter() {
        let (map, intensity, rotation) = (light.specular_map.id(), light.intensity, light.rotation);
        extracted.surroundings.insert(view, ExtractedSurroundings { map, intensity, rotation });
    }
}

fn wet_area_m(surface: &PoolSurface) -> Rect {
    let grid = &surface.grid;
    let corner_m = |cell: UVec2| grid.pool_from_cell(cell.min(grid.size())) - 0.5 * grid.cell_m();
    surface.wet_tiles.iter().fold(Rect::EMPTY, |area, tile| {
        area.union(Rect::from_corners(corner_m(*tile * SURFACE_TILE), corner_m((*tile + 1) * SURFACE_TILE)))
    })
}

/// The rows in which there is or was fluid.
fn upload(surface: &PoolSurface, was_wet: Option<[u32; 2]>) -> PoolUpload {
    let size = surface.grid.size();
    let tiles = &surface.wet_tiles;
    let [first, last] = [tiles.first(), tiles.last()].map(|tile| tile.map_or(0, |tile| tile.y));
    let wet_rows = [first * SURFACE_TILE, ((last + 1) * SURFACE_TILE).min(size.y)];
    // Nothing is known of a new texture.
    let rows = was_wet.map_or([0, size.y], |was| [wet_rows[0].min(was[0]), wet_rows[1].max(was[1])]);
    let [from, to] = rows.map(|row| row as usize * size.x as usize);
    PoolUpload { first_row: rows[0], texels: surface.texels[from..to].to_vec(), tiles: tiles.clone(), wet_rows }
}
