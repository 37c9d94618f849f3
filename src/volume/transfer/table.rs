//! The baked form of a transfer function.

use bevy::reflect::Reflect;
use std::ops::RangeInclusive;

/// Entries of a table.
pub const TABLE_ENTRIES: usize = 1024;

/// Colour and opacity per sample, ready for renderers; from [`super::TransferFunction::bake`].
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct TransferTable {
    entries: Vec<[f32; 4]>,
    /// Level `l` holds at `e` the greatest opacity of the entries `e .. e + 2^l`: any range is covered by two of them.
    greatest: Vec<Vec<f32>>,
}

impl TransferTable {
    pub(super) fn new(entries: &[[f32; 4]; TABLE_ENTRIES]) -> Self {
        let mut greatest = vec![entries.iter().map(|entry| entry[3]).collect::<Vec<f32>>()];
        let mut width = 1;
        while 2 * width <= TABLE_ENTRIES {
            let below = &greatest[greatest.len() - 1];
            let level = (0..=TABLE_ENTRIES - 2 * width).map(|start| below[start].max(below[start + width])).collect();
            greatest.push(level);
            width *= 2;
        }
        Self { entries: entries.to_vec(), greatest }
    }

    /// The entries: linear RGB not multiplied by the opacity, and the opacity of one step.
    pub fn entries(&self) -> &[[f32; 4]] {
        &self.entries
    }

    /// Number of the entry of a normalized value ([`crate::volume::Volume::normalized`]): the nearest one. Values beyond 0..=1
    /// and NaN take the nearest end, NaN the first.
    #[inline]
    pub fn index(normalized: f32) -> usize {
        // A cast saturates and turns NaN into 0.
        ((normalized * (TABLE_ENTRIES - 1) as f32 + 0.5) as usize).min(TABLE_ENTRIES - 1)
    }

    /// Colour and opacity at a normalized value.
    #[inline]
    pub fn entry(&self, normalized: f32) -> [f32; 4] {
        self.entries[Self::index(normalized)]
    }

    /// Greatest opacity of one step that any normalized value in a range has, in constant time: 0 means that nothing in a block
    /// with these values is visible. 0 for an empty range.
    pub fn greatest_opacity(&self, normalized: RangeInclusive<f32>) -> f32 {
        let (first, last) = (Self::index(*normalized.start()), Self::index(*normalized.end()));
        if first > last {
            return 0.0;
        }
        let level = (last - first + 1).ilog2() as usize;
        let row = &self.greatest[level];
        row[first].max(row[last + 1 - (1 << level)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greatest_opacity_of_every_kind_of_range_is_found() {
        let entries = std::array::from_fn(|e| [0.0, 0.0, 0.0, ((e * 7919) % 1009) as f32 / 1009.0]);
        let table = TransferTable::new(&entries);
        let share = |entry: usize| entry as f32 / (TABLE_ENTRIES - 1) as f32;
        for first in (0..TABLE_ENTRIES).step_by(13) {
            for last in (first..TABLE_ENTRIES).step_by(17).chain([first, TABLE_ENTRIES - 1]) {
                let direct = entries[first..=last].iter().map(|entry| entry[3]).fold(0.0, f32::max);
                assert_eq!(table.greatest_opacity(share(first)..=share(last)), direct, "{first}..={last}");
            }
        }
        assert_eq!(table.greatest_opacity(RangeInclusive::new(0.6, 0.2)), 0.0);
    }

    #[test]
    fn any_number_finds_an_entry() {
        assert_eq!(
            [-1.0, f32::NAN, 0.0, 1.0, 2.0, f32::INFINITY].map(TransferTable::index),
            [0, 0, 0, 1023, 1023, 1023]
        );
    }
}
