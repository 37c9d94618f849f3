//! Where there is anything to do: the cost of a step follows the cavity's area and not the grid's.

use super::field::FRAME;
use std::ops::Range;

/// Columns that are worked on together: whole vectors of the widest kind.
const SEGMENT: usize = FRAME;

/// Fewest rows of a band but the last.
const LEAST_ROWS: usize = 16;

/// Cells around a deep span that hold fluid: the sides of the neighbours of its sides are open.
pub(super) const DEEP: usize = 2;

/// Columns of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub start: usize,
    pub end: usize,
    /// Whether there is fluid all over it and [`DEEP`] cells around it.
    pub is_deep: bool,
}

/// The segments with fluid, joined to spans, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct Spans {
    rows: Vec<Vec<Span>>,
    /// Columns that spans of any row reach.
    pub columns: Range<usize>,
    /// Columns of the spans of all rows before each row, and at last of all.
    before: Vec<usize>,
}

impl Spans {
    pub fn none(rows: usize) -> Self {
        Self { rows: vec![Vec::new(); rows], columns: 0..0, before: vec![0; rows + 1] }
    }

    /// Cells of all spans.
    pub fn cells(&self) -> usize {
        self.before.last().copied().unwrap_or_default()
    }

    /// The spans of a row of cells.
    pub fn of_row(&self, y: usize) -> &[Span] {
        &self.rows[y]
    }

    /// The rows' lists, to [`join`] anew; then [`count`](Self::count) them.
    pub fn rows_mut(&mut self) -> &mut [Vec<Span>] {
        &mut self.rows
    }

    /// To be called when the lists have changed.
    pub fn count(&mut self) {
        let ends = self.rows.iter().filter_map(|row| Some((row.first()?.start, row.last()?.end)));
        self.columns = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).map_or(0..0, |(start, end)| start..end);
        let mut sum = 0;
        for (row, before) in self.rows.iter().zip(&mut self.before) {
            *before = sum;
            sum += row.iter().map(|span| span.end - span.start).sum::<usize>();
        }
        *self.before.last_mut().expect("one more than rows") = sum;
    }

    /// Bands of rows with about as much to do each, together all rows with spans: two for each thread, as some threads get less
    /// time than others.
    pub fn bands_for_threads(&self) -> Vec<Range<usize>> {
        let threads = rayon::current_num_threads();
        self.bands(if threads > 1 { 2 * threads } else { 1 })
    }

    fn bands(&self, most: usize) -> Vec<Range<usize>> {
        let all = *self.before.last().expect("one more than rows");
        let end = self.before.partition_point(|before| *before < all);
        let mut start = self.before.partition_point(|before| *before == 0).saturating_sub(1);
        let mut bands = Vec::with_capacity(most);
        for band in 1..=most {
            let wanted = self.before.partition_point(|before| *before < all * band / most);
            let stop = if band == most { end } else { wanted };
            // What lies around a band is worked out twice: short ones are not worth it.
            if stop >= start + LEAST_ROWS || (band == most && stop > start) {
                bands.push(start..stop);
                start = stop;
            }
        }
        bands
    }
}

/// The spans of a row of cells: segments with fluid, deep ones apart from others.
pub(super) fn join(wet: &[f32], clearance: &[u8], spans: &mut Vec<Span>) {
    spans.clear();
    for (segment, (wet, clearance)) in wet.chunks_exact(SEGMENT).zip(clearance.chunks_exact(SEGMENT)).enumerate() {
        if wet.iter().fold(0.0, |most: f32, wet| most.max(*wet)) == 0.0 {
            continue;
        }
        let is_deep = clearance.iter().fold(u8::MAX, |least, clearance| least.min(*clearance)) > DEEP as u8;
        let (start, end) = (segment * SEGMENT, (segment + 1) * SEGMENT);
        match spans.last_mut().filter(|last| last.end == start && last.is_deep == is_deep) {
            Some(last) => last.end = end,
            None => spans.push(Span { start, end, is_deep }),
        }
    }
}

/// Columns of some spans that no other ones have.
pub(super) fn left(old: &[Span], new: &[Span]) -> impl Iterator<Item = Range<usize>> {
    let segments = old.iter().flat_map(|span| (span.start..span.end).step_by(SEGMENT));
    segments
        .filter(|start| !new.iter().any(|span| (span.start..span.end).contains(start)))
        .map(|start| start..start + SEGMENT)
}
