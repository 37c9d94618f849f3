//! How far each block is from the nearest one that shows.

use super::{BlockRanges, MAX_BLOCK_DISTANCE, support_of, touched_by};
use crate::volume::VoxelBox;
use crate::volume::grid::linear_index;
use crate::volume::transfer::TABLE_ENTRIES;
use bevy::reflect::Reflect;
use glam::UVec3;

/// Chebyshev distance from every block to the nearest block that may show something, up to [`MAX_BLOCK_DISTANCE`].
///
/// 0 where a sample of the block can have an opacity above 0, `d` where all blocks closer than `d` show nothing: a ray in such
/// a block may go on where it leaves the cube of `(2 d - 1)^3` blocks around it. What lies outside the grid shows nothing.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct BlockDistances {
    size: UVec3,
    blocks: UVec3,
    /// Blocks whose values have an opacity in the transfer function.
    visible: BlockBits,
    /// Blocks without any remaining opacity.
    gone: BlockBits,
    distances: Vec<u8>,
}

impl BlockDistances {
    /// The distances of an uncut volume with a transfer function: straight colour and opacity for each of the
    /// [`TABLE_ENTRIES`] values. Missing entries have no opacity.
    pub fn new(ranges: &BlockRanges, table: &[[f32; 4]]) -> Self {
        let blocks = ranges.blocks();
        let count = blocks.x as usize * blocks.y as usize * blocks.z as usize;
        let mut made = Self {
            size: ranges.size(),
            blocks,
            visible: visible_blocks(ranges, table),
            gone: BlockBits::none(blocks),
            distances: vec![MAX_BLOCK_DISTANCE; count],
        };
        made.measure(VoxelBox { min: UVec3::ZERO, max: blocks });
        made
    }

    /// Blocks along each axis.
    pub fn blocks(&self) -> UVec3 {
        self.blocks
    }

    /// The distances, x fastest.
    pub fn distances(&self) -> &[u8] {
        &self.distances
    }

    /// The distance of a block; [`MAX_BLOCK_DISTANCE`] outside the grid.
    pub fn distance(&self, block: UVec3) -> u8 {
        if block.cmplt(self.blocks).all() {
            self.distances[linear_index(self.blocks, block)]
        } else {
            MAX_BLOCK_DISTANCE
        }
    }

    /// Goes over to another transfer function of the same volume. Returns the blocks whose distances changed, `None` if no
    /// distance did or the ranges belong to a volume of another size.
    pub fn set_table(&mut self, ranges: &BlockRanges, table: &[[f32; 4]]) -> Option<VoxelBox> {
        if ranges.size() != self.size {
            return None;
        }
        let visible = visible_blocks(ranges, table);
        if visible == self.visible {
            return None;
        }
        self.visible = visible;
        self.measure(VoxelBox { min: UVec3::ZERO, max: self.blocks })
    }

    /// Takes over a change of the cut in a box of voxels. `remaining` writes the remaining opacities of a box, 0 to 255 with x
    /// fastest, as the picture sees them. Returns the blocks whose distances changed, `None` if none did.
    ///
    /// Only blocks are looked at whose samples the changed voxels take part in; distances are measured anew only around blocks
    /// that began or ceased to show.
    pub fn update(&mut self, changed: VoxelBox, mut remaining: impl FnMut(VoxelBox, &mut [u8])) -> Option<VoxelBox> {
        let touched = touched_by(changed, self.size);
        let mut turned = VoxelBox { min: UVec3::ZERO, max: UVec3::ZERO };
        let mut opacities = Vec::new();
        for z in touched.min.z..touched.max.z {
            let layer = VoxelBox { min: touched.min.with_z(z), max: touched.max.with_z(z + 1) };
            let voxels = support_of(layer, self.size);
            opacities.resize(voxels.count(), 0);
            remaining(voxels, &mut opacities);
            for y in layer.min.y..layer.max.y {
                for x in layer.min.x..layer.max.x {
                    let block = UVec3::new(x, y, z);
                    let one = VoxelBox { min: block, max: block + 1 };
                    let is_gone = all_zero(&opacities, voxels, support_of(one, self.size));
                    if self.gone.set(block, is_gone) && self.visible.holds(block) {
                        turned = turned.union(&one);
                    }
                }
            }
        }
        if turned.is_empty() { None } else { self.measure(turned.grown(REACH, self.blocks)) }
    }

    /// Measures the distances in a box of blocks; returns the part of it where they changed.
    ///
    /// The blocks that show are grown by one block at a time, 64 blocks to a word; what a step adds has the step's distance.
    fn measure(&mut self, region: VoxelBox) -> Option<VoxelBox> {
        let within = region.grown(REACH, self.blocks);
        let mut reached = Window::cut_from(&self.visible, &self.gone, within);
        let mut changed = VoxelBox { min: UVec3::ZERO, max: UVec3::ZERO };
        self.store(0, &reached.words, &reached, region, &mut changed);
        for distance in 1..MAX_BLOCK_DISTANCE {
            let before = reached.words.clone();
            reached.grow();
            let added: Vec<u64> = reached.words.iter().zip(&before).map(|(after, before)| after & !before).collect();
            if added.iter().all(|&word| word == 0) {
                break;
            }
            self.store(distance, &added, &reached, region, &mut changed);
        }
        let never: Vec<u64> = reached.words.iter().map(|word| !word).collect();
        self.store(MAX_BLOCK_DISTANCE, &never, &reached, region, &mut changed);
        (!changed.is_empty()).then_some(changed)
    }

    /// Gives a distance to the blocks of a region whose bits are set in a window, and adds those that changed to a box.
    fn store(&mut self, distance: u8, words: &[u64], window: &Window, region: VoxelBox, changed: &mut VoxelBox) {
        for z in region.min.z..region.max.z {
            for y in region.min.y..region.max.y {
                let row = window.row(y, z);
                let start = linear_index(self.blocks, UVec3::new(0, y, z));
                for (place, &word) in words[row..row + window.words_per_row].iter().enumerate() {
                    let first = (window.first_word + place) as u32 * 64;
                    let mut word = word & bits_of_range(region.min.x, region.max.x, first);
                    while word != 0 {
                        let x = first + word.trailing_zeros();
                        word &= word - 1;
                        let stored = &mut self.distances[start + x as usize];
                        if *stored != distance {
                            *stored = distance;
                            let block = UVec3::new(x, y, z);
                            *changed = changed.union(&VoxelBox { min: block, max: block + 1 });
                        }
                    }
                }
            }
        }
    }
}

/// Blocks up to which another block's turning can change a distance.
const REACH: u32 = MAX_BLOCK_DISTANCE as u32 - 1;

/// Whether the opacities of a box are all zero; `opacities` belong to a box around it.
fn all_zero(opacities: &[u8], of: VoxelBox, within: VoxelBox) -> bool {
    let size = of.size();
    let (from, to) = (within.min - of.min, within.max - of.min);
    (from.z..to.z).all(|z| {
        (from.y..to.y).all(|y| {
            let start = (z as usize * size.y as usize + y as usize) * size.x as usize;
            opacities[start + from.x as usize..start + to.x as usize].iter().all(|&opacity| opacity == 0)
        })
    })
}

/// The blocks with a value that a transfer function gives an opacity.
fn visible_blocks(ranges: &BlockRanges, table: &[[f32; 4]]) -> BlockBits {
    // Number of entries with an opacity before each entry: two look-ups tell whether a range has any.
    let mut before = [0_u32; TABLE_ENTRIES + 1];
    for entry in 0..TABLE_ENTRIES {
        let opaque = table.get(entry).is_some_and(|[.., opacity]| *opacity > 0.0);
        before[entry + 1] = before[entry] + u32::from(opaque);
    }
    let blocks = ranges.blocks();
    let mut bits = BlockBits::none(blocks);
    for (row, entries) in ranges.all().chunks_exact(blocks.x as usize).enumerate() {
        let words = &mut bits.words[row * bits.words_per_row..][..bits.words_per_row];
        for (x, &[first, last]) in entries.iter().enumerate() {
            let shows = before[usize::from(last) + 1] > before[usize::from(first)];
            words[x / 64] |= u64::from(shows) << (x % 64);
        }
    }
    bits
}

/// The bits of a word whose first bit stands for block `first` that belong to the blocks `from..to`.
fn bits_of_range(from: u32, to: u32, first: u32) -> u64 {
    let below = |end: u32| match end.saturating_sub(first) {
        count @ 0..64 => (1_u64 << count) - 1,
        _ => u64::MAX,
    };
    below(to) & !below(from)
}

/// One bit per block, 64 blocks along x to a word.
#[derive(Clone, Debug, PartialEq)]
struct BlockBits {
    blocks: UVec3,
    words_per_row: usize,
    words: Vec<u64>,
}

impl BlockBits {
    fn none(blocks: UVec3) -> Self {
        let words_per_row = blocks.x.div_ceil(64) as usize;
        Self { blocks, words_per_row, words: vec![0; words_per_row * blocks.y as usize * blocks.z as usize] }
    }

    fn word(&self, block: UVec3) -> usize {
        (block.z as usize * self.blocks.y as usize + block.y as usize) * self.words_per_row + block.x as usize / 64
    }

    fn holds(&self, block: UVec3) -> bool {
        self.words[self.word(block)] >> (block.x % 64) & 1 == 1
    }

    /// Sets a bit; returns whether it was otherwise.
    fn set(&mut self, block: UVec3, value: bool) -> bool {
        let changes = self.holds(block) != value;
        let word = self.word(block);
        self.words[word] ^= u64::from(changes) << (block.x % 64);
        changes
    }
}

/// Bits of a box of blocks, in whole words.
struct Window {
    min: UVec3,
    rows: UVec3,
    first_word: usize,
    words_per_row: usize,
    words: Vec<u64>,
    /// Intermediate result of growing, kept to save an allocation per step.
    grown: Vec<u64>,
}

impl Window {
    /// The blocks of a box that are visible and not gone.
    fn cut_from(visible: &BlockBits, gone: &BlockBits, within: VoxelBox) -> Self {
        let first_word = within.min.x as usize / 64;
        let words_per_row = (within.max.x.div_ceil(64) as usize).saturating_sub(first_word);
        let rows = within.size();
        let mut words = Vec::with_capacity(words_per_row * rows.y as usize * rows.z as usize);
        for z in within.min.z..within.max.z {
            for y in within.min.y..within.max.y {
                let start = visible.word(UVec3::new(first_word as u32 * 64, y, z));
                let range = start..start + words_per_row;
                words.extend(
                    visible.words[range.clone()].iter().zip(&gone.words[range]).map(|(shows, gone)| shows & !gone),
                );
            }
        }
        Self { min: within.min, rows, first_word, words_per_row, grown: words.clone(), words }
    }

    /// Where the words of a row of blocks begin.
    fn row(&self, y: u32, z: u32) -> usize {
        ((z - self.min.z) as usize * self.rows.y as usize + (y - self.min.y) as usize) * self.words_per_row
    }

    /// Adds all neighbours, also those across edges and corners. Blocks before and after the window stay unknown.
    fn grow(&mut self) {
        let width = self.words_per_row;
        for (row, grown) in self.words.chunks_exact(width).zip(self.grown.chunks_exact_mut(width)) {
            for place in 0..width {
                let before = if place > 0 { row[place - 1] >> 63 } else { 0 };
                let after = row.get(place + 1).map_or(0, |word| word << 63);
                grown[place] = row[place] | row[place] << 1 | row[place] >> 1 | before | after;
            }
        }
        let layer = width * self.rows.y as usize;
        for (from, to) in self.grown.chunks_exact(layer).zip(self.words.chunks_exact_mut(layer)) {
            or_neighbours(from, to, width);
        }
        self.grown.copy_from_slice(&self.words);
        or_neighbours(&self.grown, &mut self.words, layer);
    }
}

/// `to` = `from` or what lies one `stride` before or after it.
fn or_neighbours(from: &[u64], to: &mut [u64], stride: usize) {
    to.copy_from_slice(from);
    if from.len() > stride {
        to[stride..].iter_mut().zip(from).for_each(|(to, from)| *to |= from);
        to.iter_mut().zip(&from[stride..]).for_each(|(to, from)| *to |= from);
    }
}
