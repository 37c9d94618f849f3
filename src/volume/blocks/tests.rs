use super::*;
use crate::volume::grid::linear_index;
use crate::volume::transfer::{TABLE_ENTRIES, TransferTable};
use crate::volume::{Volume, VolumeGrid, Voxels};
use glam::{DVec3, Vec3Swizzles};
use proptest::prelude::*;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;

#[test]
fn blocks_and_their_voxels_belong_to_each_other() {
    let size = UVec3::new(10, 4, 1);
    let blocks = blocks_of(size);
    assert_eq!(blocks, UVec3::new(3, 1, 1));
    for first in 0..10 {
        for last in first..10 {
            let voxels = VoxelBox { min: UVec3::new(first, 0, 0), max: UVec3::new(last + 1, 4, 1) };
            let touched = touched_by(voxels, size);
            for x in 0..3 {
                let block = VoxelBox { min: UVec3::new(x, 0, 0), max: UVec3::new(x + 1, 1, 1) };
                let shared = !support_of(block, size).intersection(&voxels).is_empty();
                assert_eq!(shared, (touched.min.x..touched.max.x).contains(&x), "{first}..={last}, block {x}");
            }
        }
    }
    let nothing = VoxelBox { min: UVec3::splat(3), max: UVec3::splat(3) };
    assert!(touched_by(nothing, size).is_empty());
    let outside = VoxelBox { min: UVec3::splat(30), max: UVec3::splat(40) };
    assert!(touched_by(outside, size).is_empty());
}

fn volume(size: UVec3, voxels: Voxels, slope: f64) -> Volume {
    Volume::new(VolumeGrid::upright(size, DVec3::ONE), voxels, slope, 3.0).expect("a good volume")
}

fn boxes(size: UVec3) -> impl Iterator<Item = UVec3> {
    (0..size.z).flat_map(move |z| (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec3::new(x, y, z))))
}

fn check_ranges(volume: &Volume) {
    let ranges = BlockRanges::new(volume);
    let grid = volume.grid();
    for block in boxes(ranges.blocks()) {
        let support = support_of(VoxelBox { min: block, max: block + 1 }, grid.size);
        let (mut first, mut last) = (TABLE_ENTRIES - 1, 0);
        for voxel in boxes(support.size()) {
            let entry = TransferTable::index(volume.normalized(grid.index(support.min + voxel)));
            (first, last) = (first.min(entry), last.max(entry));
        }
        let margin = if matches!(volume.voxels(), Voxels::U8(_)) { 3 } else { 1 };
        let expected = [first.saturating_sub(margin) as u16, (last + margin).min(TABLE_ENTRIES - 1) as u16];
        assert_eq!(ranges.entries(block), Some(expected), "{block}");
    }
    assert_eq!(ranges.entries(ranges.blocks()), None);
}

#[test]
fn ranges_are_those_of_all_voxels_that_samples_take_part_in() {
    let size = UVec3::new(13, 8, 6);
    let count = size.element_product() as usize;
    let mut random = Pcg32::new(7, 1);
    let numbers: Vec<u32> = (0..count).map(|_| random.next_u32()).collect();
    let bytes = |number: &u32| number.to_le_bytes();
    check_ranges(&volume(size, Voxels::U8(numbers.iter().map(|n| (n >> 24) as u8).collect()), 1.0));
    check_ranges(&volume(size, Voxels::I16(numbers.iter().map(|n| (n >> 16) as i16).collect()), -0.5));
    check_ranges(&volume(size, Voxels::U16(numbers.iter().map(|n| (n >> 20) as u16).collect()), 2.0));
    check_ranges(&volume(size, Voxels::F32(numbers.iter().map(|n| (n >> 8) as f32).collect()), 1.0));
    check_ranges(&volume(size, Voxels::Rgba(numbers.iter().map(bytes).collect()), 1.0));
    check_ranges(&volume(size, Voxels::U8(vec![9; count]), 1.0));
}

/// A table that shows what lies above a share of the range.
fn table_above(least: f32) -> Vec<[f32; 4]> {
    (0..TABLE_ENTRIES).map(|entry| [1.0, 1.0, 1.0, if entry as f32 > least * 1023.0 { 0.3 } else { 0.0 }]).collect()
}

/// A few bright voxels in the dark.
fn sparse(size: UVec3, bright: &[usize]) -> Volume {
    let mut voxels = vec![0; size.element_product() as usize];
    for &place in bright {
        let count = voxels.len();
        voxels[place % count] = 200;
    }
    // Spans the range, and shows itself.
    voxels[0] = 255;
    volume(size, Voxels::U8(voxels), 1.0)
}

/// Distances as their definition has them.
fn brute_force(ranges: &BlockRanges, table: &[[f32; 4]], remaining: &[u8]) -> Vec<u8> {
    let size = ranges.size();
    let shows: Vec<UVec3> = boxes(ranges.blocks())
        .filter(|&block| {
            let [first, last] = ranges.entries(block).expect("a block of the grid");
            let support = support_of(VoxelBox { min: block, max: block + 1 }, size);
            let opaque = (first..=last).any(|entry| table[usize::from(entry)][3] > 0.0);
            opaque && boxes(support.size()).any(|voxel| remaining[linear_index(size, support.min + voxel)] > 0)
        })
        .collect();
    boxes(ranges.blocks())
        .map(|block| {
            let far = |other: &UVec3| (block.as_ivec3() - other.as_ivec3()).abs().max_element();
            shows.iter().map(far).min().map_or(MAX_BLOCK_DISTANCE, |far| far.min(15) as u8)
        })
        .collect()
}

fn copy_from(remaining: &[u8], size: UVec3) -> impl FnMut(VoxelBox, &mut [u8]) + '_ {
    move |of, into| {
        for (voxel, into) in boxes(of.size()).zip(into) {
            *into = remaining[linear_index(size, of.min + voxel)];
        }
    }
}

#[test]
fn distances_are_chebyshev_distances_up_to_the_cap() {
    // Wider than a word of 64 blocks.
    let size = UVec3::new(290, 37, 9);
    let volume = sparse(size, &[5, 40_000, 90_000]);
    let ranges = BlockRanges::new(&volume);
    let table = table_above(0.5);
    let distances = BlockDistances::new(&ranges, &table);
    let untouched = vec![255; volume.grid().count()];
    assert_eq!(distances.distances(), brute_force(&ranges, &table, &untouched));
    assert!(distances.distances().contains(&0) && distances.distances().contains(&MAX_BLOCK_DISTANCE));
    assert_eq!(distances.distance(distances.blocks()), MAX_BLOCK_DISTANCE);
}

#[test]
fn nothing_shows_without_opacity_and_everything_with_it() {
    let volume = sparse(UVec3::splat(20), &[5, 3_000]);
    let ranges = BlockRanges::new(&volume);
    assert!(BlockDistances::new(&ranges, &[]).distances().iter().all(|&d| d == MAX_BLOCK_DISTANCE));
    let mut distances = BlockDistances::new(&ranges, &table_above(-1.0));
    assert!(distances.distances().iter().all(|&d| d == 0));
    assert_eq!(distances.set_table(&ranges, &table_above(-1.0)), None);
    let all = VoxelBox { min: UVec3::ZERO, max: UVec3::splat(5) };
    assert_eq!(distances.set_table(&ranges, &[]), Some(all));
    let other = BlockRanges::new(&sparse(UVec3::splat(21), &[]));
    assert_eq!(distances.set_table(&other, &table_above(-1.0)), None);
}

/// A long grid: distances beyond the cap, and few blocks that show at all.
const LONG: UVec3 = UVec3::new(171, 11, 9);

/// What one step does to the cut: a box, and the opacity it is set to.
fn step() -> impl Strategy<Value = (VoxelBox, u8)> {
    let corner = (0..LONG.x, 0..LONG.y, 0..LONG.z).prop_map(|(x, y, z)| UVec3::new(x, y, z));
    let extent = (1..30_u32, 1..12_u32, 1..12_u32).prop_map(|(x, y, z)| UVec3::new(x, y, z));
    let opacity = prop_oneof![3 => Just(0_u8), 1 => Just(255_u8), 1 => Just(1_u8)];
    (corner, extent, opacity).prop_map(|(at, extent, opacity)| {
        (VoxelBox { min: at.saturating_sub(extent), max: (at + extent).min(LONG) }, opacity)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn local_updates_give_what_a_rebuild_gives(
        bright in proptest::collection::vec(0_usize..100_000, 0..5),
        steps in proptest::collection::vec(step(), 1..10),
        turns in 0..3,
    ) {
        let turned = |v: UVec3| (0..turns).fold(v, |v, _| v.yzx());
        let size = turned(LONG);
        let ranges = BlockRanges::new(&sparse(size, &bright));
        let table = table_above(0.5);
        let mut distances = BlockDistances::new(&ranges, &table);
        let mut remaining = vec![255; size.element_product() as usize];
        for (changed, opacity) in steps {
            let changed = VoxelBox { min: turned(changed.min), max: turned(changed.max) };
            for voxel in boxes(changed.size()) {
                remaining[linear_index(size, changed.min + voxel)] = opacity;
            }
            let before = distances.clone();
            let told = distances.update(changed, copy_from(&remaining, size));
            prop_assert_eq!(distances.distances(), &brute_force(&ranges, &table, &remaining)[..]);
            // The box that is told is the smallest one around all changes.
            let mut differs = VoxelBox { min: UVec3::ZERO, max: UVec3::ZERO };
            for block in boxes(distances.blocks()) {
                if distances.distance(block) != before.distance(block) {
                    differs = differs.union(&VoxelBox { min: block, max: block + 1 });
                }
            }
            prop_assert_eq!(told, (!differs.is_empty()).then_some(differs));
        }
        // What is hidden by the table now may show with the next one, but what is cut away stays away.
        let all = table_above(-1.0);
        distances.set_table(&ranges, &all);
        prop_assert_eq!(distances.distances(), &brute_force(&ranges, &all, &remaining)[..]);
    }
}
