//! What the main world keeps of a volume for the picture of it: the baked table, what is empty, what changed.

use crate::volume::blocks::{BlockDistances, BlockRanges, blocks_of};
use crate::volume::transfer::{ColourSource, TransferFunction, TransferTable};
use crate::volume::{CtVolume, CutVolume, Volume, VolumeLook, VoxelBox};
use bevy::prelude::*;

/// The state of a volume's picture. Inserted beside a [`CutVolume`].
#[derive(Component)]
pub(super) struct ShownVolume {
    source: AssetId<Volume>,
    /// Whether the asset was replaced since.
    is_stale: bool,
    ranges: BlockRanges,
    pub distances: BlockDistances,
    pub table: TransferTable,
    pub colours: ColourSource,
    cut_revision: u64,
    /// Grows when anything in here changes: by one for [`ShownVolume::changes`], by more where all of it is new.
    pub revision: u64,
    /// What the last revision changed.
    pub changes: ShownChanges,
    /// What can be seen at all, voxel coordinates.
    pub bounds: (Vec3, Vec3),
}

/// What one revision changed.
#[derive(Clone, Debug, Default)]
pub(super) struct ShownChanges {
    /// Voxels that were cut, or restored.
    pub voxels: Vec<VoxelBox>,
    /// Blocks whose distances changed.
    pub blocks: Option<VoxelBox>,
    /// Whether the table changed.
    pub table: bool,
}

impl ShownVolume {
    fn new(
        id: AssetId<Volume>,
        volume: &Volume,
        cut: &CutVolume,
        transfer: &TransferFunction,
        step_m: f64,
        revision: u64,
    ) -> Self {
        let ranges = BlockRanges::new(volume);
        let table = transfer.bake(volume.range(), step_m);
        let mut distances = BlockDistances::new(&ranges, table.entries());
        if !cut.is_untouched(volume.grid().bounds()) {
            distances.update(volume.grid().bounds(), |of, into| cut.copy_remaining(of, into));
        }
        let bounds = visible_bounds(&distances, volume);
        Self {
            source: id,
            is_stale: false,
            ranges,
            distances,
            table,
            colours: transfer.colour_source,
            cut_revision: cut.revision(),
            revision,
            changes: ShownChanges::default(),
            bounds,
        }
    }

    /// Whether this is the state of an asset with so many voxels.
    pub fn is_of(&self, id: AssetId<Volume>, size: UVec3) -> bool {
        self.source == id && !self.is_stale && self.ranges.size() == size
    }
}

/// Box around the blocks that show something, voxel coordinates.
fn visible_bounds(distances: &BlockDistances, volume: &Volume) -> (Vec3, Vec3) {
    let blocks = distances.blocks();
    let (mut low, mut high) = (blocks, UVec3::ZERO);
    for (line, row) in distances.distances().chunks(blocks.x as usize).enumerate() {
        let (y, z) = (line as u32 % blocks.y, line as u32 / blocks.y);
        let (Some(first), Some(last)) = (row.iter().position(|&d| d == 0), row.iter().rposition(|&d| d == 0)) else {
            continue;
        };
        low = low.min(UVec3::new(first as u32, y, z));
        high = high.max(UVec3::new(last as u32, y, z) + 1);
    }
    let size = volume.grid().size.as_vec3();
    let voxel = |block: UVec3| (block.as_vec3() * 4.0).min(size) - 0.5;
    (voxel(low), voxel(high))
}

type Showing = (
    Entity,
    &'static CtVolume,
    Ref<'static, CutVolume>,
    Ref<'static, TransferFunction>,
    Ref<'static, VolumeLook>,
    Option<&'static mut ShownVolume>,
);

/// Follows what changed since the last frame.
pub(super) fn follow_changes(
    mut commands: Commands,
    volumes: Res<Assets<Volume>>,
    mut changed: MessageReader<AssetEvent<Volume>>,
    mut showing: Query<Showing>,
    mut born: Local<u64>,
) {
    let replaced: Vec<AssetId<Volume>> = changed
        .read()
        .filter_map(|event| match event {
            AssetEvent::Modified { id } | AssetEvent::Removed { id } => Some(*id),
            _ => None,
        })
        .collect();
    for (entity, source, cut, transfer, look, mut shown) in &mut showing {
        if let Some(shown) = &mut shown
            && replaced.contains(&shown.source)
        {
            shown.is_stale = true;
        }
        let Some(volume) = volumes.get(&source.0).filter(|volume| volume.grid().size == cut.size()) else { continue };
        let id = source.0.id();
        let step_m = f64::from(look.sane_step_voxels()) * volume.grid().spacing_mm().min_element() * 1e-3;
        let Some(mut shown) = shown.filter(|shown| shown.is_of(id, volume.grid().size)) else {
            // No two of them ever have the same revision.
            *born += 1;
            let revision = *born << 32;
            commands.entity(entity).try_insert(ShownVolume::new(id, volume, &cut, &transfer, step_m, revision));
            continue;
        };
        let mut changes = ShownChanges::default();
        if cut.revision() != shown.cut_revision {
            changes.voxels = cut.changes_since(shown.cut_revision).unwrap_or_else(|| vec![volume.grid().bounds()]);
        }
        let is_retold = transfer.is_changed() || look.is_changed();
        let table = is_retold.then(|| transfer.bake(volume.range(), step_m));
        changes.table =
            table.as_ref().is_some_and(|table| *table != shown.table) || transfer.colour_source != shown.colours;
        if changes.voxels.is_empty() && !changes.table {
            continue;
        }
        let shown = &mut *shown;
        for &of in &changes.voxels {
            let blocks = shown.distances.update(of, |of, into| cut.copy_remaining(of, into));
            changes.blocks = united(changes.blocks, blocks);
        }
        if let Some(table) = table.filter(|_| changes.table) {
            let blocks = shown.distances.set_table(&shown.ranges, table.entries());
            changes.blocks = united(changes.blocks, blocks);
            (shown.table, shown.colours) = (table, transfer.colour_source);
        }
        if changes.blocks.is_some() {
            shown.bounds = visible_bounds(&shown.distances, volume);
        }
        shown.cut_revision = cut.revision();
        shown.revision += 1;
        shown.changes = changes;
    }
}

fn united(a: Option<VoxelBox>, b: Option<VoxelBox>) -> Option<VoxelBox> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}

/// All blocks of a volume, as a box.
pub(super) fn all_blocks(size: UVec3) -> VoxelBox {
    VoxelBox { min: UVec3::ZERO, max: blocks_of(size) }
}
