//! Which rectangles of a reaction map travel to the GPU (paper of 2002, section 4.2.5).
//!
//! Sprites of a snake overlap, so sending each one's box sends texels twice; one box round a whole snake sends texels
//! that nothing touched. [`group_snake`] finds runs of sprites in between, [`coalesce`] and [`limit`] tidy up what
//! several snakes give, and an [`UploadLog`] tells any number of renderers what changed since each last looked.

use super::texels::{MapSize, TexelRect};
use bevy::reflect::Reflect;
use std::collections::VecDeque;

/// Rectangles that one upload has at most. Each costs a call of its own (some microseconds), which is as much as a few
/// thousand texels cost; beyond this number they are merged although that adds texels.
pub const MOST_RECTS: usize = 256;

/// Steps that an [`UploadLog`] remembers: about a second of 60 steps. Who was away for longer takes the whole map.
pub const KEPT_STEPS: usize = 64;

/// Rectangles that [`coalesce`] compares each rectangle with at most.
const MOST_COMPARED: usize = 64;

/// Sweeps of [`coalesce`] at most; nearly all merging happens in the first two.
const MOST_SWEEPS: usize = 4;

/// Texels in all of these rectangles; those in several count as often.
pub fn texel_count(rects: &[TexelRect]) -> u64 {
    rects.iter().map(|rect| rect.area()).sum()
}

/// How many texels more the rectangle around both has than the two together; negative where merging saves some.
fn excess(a: TexelRect, b: TexelRect) -> i64 {
    a.union(b).area() as i64 - a.area() as i64 - b.area() as i64
}

/// Groups the sprites of a snake and pushes the rectangles around the groups to `groups`.
///
/// Each sprite has one rectangle, or several where the map's border cuts it up (date line, poles). Rectangles of
/// consecutive sprites form a portion as long as the box around two neighbours is no larger than the two together, and
/// each portion is grouped by itself ([`group`]). So the parts of a snake on both sides of the date line never share a
/// box, also where it crosses it often, nor do the sprites before and after a pole or a jump. Empty rectangles are
/// left out. Takes time in proportion to the number of rectangles.
pub fn group_snake<'a>(sprites: impl IntoIterator<Item = &'a [TexelRect]>, groups: &mut Vec<TexelRect>) {
    let mut portions: Vec<Portion> = Vec::new();
    for (sprite, rects) in sprites.into_iter().enumerate() {
        for &rect in rects.iter().filter(|rect| !rect.is_empty()) {
            let joined = portions
                .iter_mut()
                .filter(|portion| portion.last_sprite != sprite)
                .map(|portion| (excess(portion.last_box, rect), portion))
                .min_by_key(|(excess, _)| *excess)
                .filter(|(excess, _)| *excess <= 0);
            match joined {
                Some((_, portion)) => portion.extend(sprite, rect),
                None => portions.push(Portion { last_sprite: sprite, last_box: rect, boxes: vec![rect] }),
            }
        }
        if portions.iter().any(|portion| portion.last_sprite == sprite) {
            portions.retain(|portion| {
                let goes_on = portion.last_sprite == sprite;
                if !goes_on {
                    group(&portion.boxes, groups);
                }
                goes_on
            });
        }
    }
    for portion in portions {
        group(&portion.boxes, groups);
    }
}

/// Part of a snake that lies in one piece on the map.
struct Portion {
    last_sprite: usize,
    last_box: TexelRect,
    boxes: Vec<TexelRect>,
}

impl Portion {
    fn extend(&mut self, sprite: usize, rect: TexelRect) {
        (self.last_sprite, self.last_box) = (sprite, rect);
        self.boxes.push(rect);
    }
}

/// Groups the boxes of consecutive sprites and pushes the rectangles around the groups to `groups`.
///
/// The paper's estimate of the best number of groups (`estimated_groups`) assumes sprites of one size on a straight
/// line at even distances, and its optimum is flat but not exact. Real drops turn, so runs that are as equal as
/// possible are tried for the estimate, its neighbours and its double, and for a single group (a path that curls up
/// fills its box); in each, neighbouring groups are joined where that costs nothing, which undoes cuts on the straight
/// parts. The fewest texels win, then the fewest rectangles. Takes time in proportion to the number of boxes.
pub fn group(boxes: &[TexelRect], groups: &mut Vec<TexelRect>) {
    let base = groups.len();
    let estimate = estimated_groups(boxes);
    let mut tried = 0;
    for count in [1, estimate.saturating_sub(1), estimate, estimate + 1, 2 * estimate] {
        // The counts rise, so that one tried twice comes twice in a row.
        let count = count.clamp(1, boxes.len().max(1));
        if count <= tried {
            continue;
        }
        tried = count;
        let best_end = groups.len();
        for index in 0..count {
            let run = &boxes[index * boxes.len() / count..(index + 1) * boxes.len() / count];
            let rect = run.iter().fold(TexelRect::default(), |sum, &rect| sum.union(rect));
            push_joined(groups, best_end, rect);
        }
        let (best, trial) = groups[base..].split_at(best_end - base);
        if best.is_empty() || (texel_count(trial), trial.len()) < (texel_count(best), best.len()) {
            groups.drain(base..best_end);
        } else {
            groups.truncate(best_end);
        }
    }
}

/// Pushes a rectangle, joined with those before it (from `start` on) as long as that adds no texels.
fn push_joined(rects: &mut Vec<TexelRect>, start: usize, mut rect: TexelRect) {
    if rect.is_empty() {
        return;
    }
    while let Some(last) = rects[start..].last()
        && excess(*last, rect) <= 0
    {
        rect = rect.union(*last);
        rects.pop();
    }
    rects.push(rect);
}

/// The paper's number of groups: the integer part of `N / sqrt(a b - (a + b) + 1)`, brought to 1 to N.
///
/// `a` and `b` are the boxes' mean width and height over the mean offsets of consecutive boxes. An offset is taken
/// between edges, not middles, so that it also tells how a snake tapers. The root is `sqrt((a - 1) (b - 1))`:
/// - without an offset along one axis (standing still, straight along a row or column) it is infinite: one group,
///   which has no useless texel;
/// - where the boxes do not overlap along one axis (`a <= 1` or `b <= 1`) nothing is sent twice, so each box is a
///   group. There the root is zero, imaginary, or, along both axes, real but without meaning.
fn estimated_groups(boxes: &[TexelRect]) -> usize {
    let count = boxes.len();
    if count < 2 {
        return count.max(1);
    }
    let mean_side =
        |side: fn(&TexelRect) -> u32| boxes.iter().map(|rect| f64::from(side(rect))).sum::<f64>() / count as f64;
    let mean_offset = |low: fn(TexelRect) -> u32, high: fn(TexelRect) -> u32| {
        let offset = |pair: &[TexelRect]| low(pair[0]).abs_diff(low(pair[1])) + high(pair[0]).abs_diff(high(pair[1]));
        boxes.windows(2).map(|pair| f64::from(offset(pair))).sum::<f64>() / (2 * (count - 1)) as f64
    };
    let (width, height) = (mean_side(|rect| rect.width), mean_side(|rect| rect.height));
    let (dx, dy) = (mean_offset(|rect| rect.x, TexelRect::right), mean_offset(|rect| rect.y, TexelRect::bottom));
    if dx >= width || dy >= height {
        return count;
    }
    let root = ((width - dx) * (height - dy)).sqrt();
    // a and b times their offsets, so that an offset of zero divides nothing.
    ((count as f64 * (dx * dy).sqrt() / root) as usize).clamp(1, count)
}

/// Removes rectangles that lie in others and merges those whose common box is no larger than the two together, so that
/// what overlaps is not sent twice. Covers all texels that were covered, with no greater total. The order of the input
/// does not matter; the result comes row by row.
///
/// At most four sweeps along columns and rows in turn, each comparing a rectangle with the last 64 that reach as far:
/// `n log n` for sorting and at most some `200 n` comparisons a sweep. Of up to 64 rectangles no pair is left that
/// could be merged unless the sweeps run out; of more, some may be.
pub fn coalesce(rects: &mut Vec<TexelRect>) {
    rects.retain(|rect| !rect.is_empty());
    let mut quiet_sweeps = 0;
    for index in 0..MOST_SWEEPS {
        let before = rects.len();
        if index % 2 == 0 {
            rects.sort_unstable_by_key(|rect| (rect.x, rect.y, rect.width, rect.height));
            sweep(rects, |rect| rect.x, TexelRect::right);
        } else {
            sort_by_rows(rects);
            sweep(rects, |rect| rect.y, TexelRect::bottom);
        }
        quiet_sweeps = if rects.len() == before { quiet_sweeps + 1 } else { 0 };
        // One along each axis: nothing is left to find.
        if quiet_sweeps == 2 {
            break;
        }
    }
    sort_by_rows(rects);
}

fn sort_by_rows(rects: &mut [TexelRect]) {
    rects.sort_unstable_by_key(|rect| (rect.y, rect.x, rect.height, rect.width));
}

/// Merges in one pass over rectangles that are sorted by where they start along an axis.
fn sweep(rects: &mut Vec<TexelRect>, start: fn(TexelRect) -> u32, end: fn(TexelRect) -> u32) {
    // Rectangles with a gap between them never merge, so only those that reach the present one need be compared.
    let mut reaching: Vec<TexelRect> = Vec::with_capacity(MOST_COMPARED + 1);
    let mut done = Vec::with_capacity(rects.len());
    for &next in rects.iter() {
        reaching.retain(|&rect| {
            let reaches = end(rect) >= start(next);
            if !reaches {
                done.push(rect);
            }
            reaches
        });
        let mut merged = next;
        while let Some(index) = reaching.iter().position(|&rect| excess(rect, merged) <= 0) {
            merged = merged.union(reaching.remove(index));
        }
        reaching.push(merged);
        if reaching.len() > MOST_COMPARED {
            done.push(reaching.remove(0));
        }
    }
    done.append(&mut reaching);
    *rects = done;
}

/// Merges rectangles until at most `most` (at least one) are left, at the price of texels that none of them held.
///
/// They are put in the order of a Z-curve, where neighbours in the list are mostly neighbours on the map, and the
/// neighbours that cost least are merged first, each with one other per round. `n log n` per round, and every round
/// takes a third of the surplus or more. What then overlaps is coalesced.
pub fn limit(rects: &mut Vec<TexelRect>, most: usize) {
    let most = most.max(1);
    if rects.len() <= most {
        return;
    }
    rects.sort_unstable_by_key(|&rect| (z_order(rect), rect));
    while rects.len() > most {
        let mut pairs: Vec<(i64, usize)> =
            rects.windows(2).enumerate().map(|(index, pair)| (excess(pair[0], pair[1]), index)).collect();
        pairs.sort_unstable();
        let mut surplus = rects.len() - most;
        let mut is_taken = vec![false; rects.len()];
        for (_, index) in pairs {
            if surplus == 0 {
                break;
            }
            if !is_taken[index] && !is_taken[index + 1] {
                (is_taken[index], is_taken[index + 1]) = (true, true);
                rects[index] = rects[index].union(rects[index + 1]);
                rects[index + 1] = TexelRect::default();
                surplus -= 1;
            }
        }
        rects.retain(|rect| !rect.is_empty());
    }
    coalesce(rects);
}

/// Place of a rectangle's middle on a Z-curve: the bits of column and row in turn.
fn z_order(rect: TexelRect) -> u64 {
    let spread = |value: u32| (0..32).fold(0u64, |sum, bit| sum | u64::from(value >> bit & 1) << (2 * bit));
    spread(rect.x + rect.width / 2) | spread(rect.y + rect.height / 2) << 1
}

/// What a reader of an [`UploadLog`] has to take over.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub enum Changes {
    /// The whole map.
    All,
    /// These rectangles, which hardly overlap; none if nothing changed.
    Rects(Vec<TexelRect>),
}

impl Changes {
    /// As rectangles of a map of this size.
    pub fn into_rects(self, size: MapSize) -> Vec<TexelRect> {
        match self {
            Self::All => vec![size.rect()],
            Self::Rects(rects) => rects,
        }
    }
}

/// Which rectangles of a map changed in which step, for any number of readers that look at different times.
///
/// Every change has a revision. A reader asks for what changed since the revision that it knows, uploads that, and
/// remembers [`UploadLog::revision`]. Who knows nothing asks with 0 and gets all. The log holds [`KEPT_STEPS`] changes
/// of at most [`MOST_RECTS`] rectangles each, so its size is bounded.
#[derive(Clone, Debug, Reflect)]
pub struct UploadLog {
    size: MapSize,
    revision: u64,
    /// Rectangles of the latest changes; the last are those of `revision`.
    #[reflect(ignore)]
    steps: VecDeque<Vec<TexelRect>>,
}

impl Default for UploadLog {
    /// For a map without texels.
    fn default() -> Self {
        Self::new(MapSize::default())
    }
}

impl UploadLog {
    /// For a map of this size that no one has seen yet.
    pub fn new(size: MapSize) -> Self {
        Self { size, revision: 1, steps: VecDeque::new() }
    }

    /// Number of the latest change; 1 for a new map.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Size of the map.
    pub fn size(&self) -> MapSize {
        self.size
    }

    /// Notes that these rectangles changed, and returns the new revision. What lies beside the map is cut off; if
    /// nothing is left, nothing changed and the revision stays.
    pub fn push(&mut self, rects: &[TexelRect]) -> u64 {
        let mut changed: Vec<TexelRect> = rects.iter().map(|rect| rect.intersection(self.size.rect())).collect();
        coalesce(&mut changed);
        limit(&mut changed, MOST_RECTS);
        if changed.is_empty() {
            return self.revision;
        }
        if texel_count(&changed) >= self.size.area() as u64 {
            changed = vec![self.size.rect()];
        }
        if self.steps.len() == KEPT_STEPS {
            self.steps.pop_front();
        }
        self.steps.push_back(changed);
        self.revision += 1;
        self.revision
    }

    /// Notes that the whole map changed, to this size: all readers get [`Changes::All`].
    pub fn reset(&mut self, size: MapSize) -> u64 {
        self.size = size;
        self.steps.clear();
        self.revision += 1;
        self.revision
    }

    /// What changed after `revision`: all, where that is longer ago than the log remembers or is no revision of this
    /// log, or where the rectangles hold as many texels as the map.
    pub fn since(&self, revision: u64) -> Changes {
        let Some(count) = self.revision.checked_sub(revision).filter(|&count| count <= self.steps.len() as u64) else {
            return Changes::All;
        };
        let first = self.steps.len() - count as usize;
        let mut rects: Vec<TexelRect> = self.steps.iter().skip(first).flatten().copied().collect();
        if count > 1 {
            coalesce(&mut rects);
            limit(&mut rects, MOST_RECTS);
        }
        if texel_count(&rects) >= self.size.area() as u64 && count > 0 {
            return Changes::All;
        }
        Changes::Rects(rects)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(x: u32, y: u32, width: u32, height: u32) -> TexelRect {
        TexelRect { x, y, width, height }
    }

    fn line(count: u32, dx: u32, dy: u32, width: u32, height: u32) -> Vec<TexelRect> {
        (0..count).map(|index| rect(10 + index * dx, 10 + index * dy, width, height)).collect()
    }

    #[test]
    fn estimate_is_the_papers() {
        // a = 16 / 2, b = 12 / 3: 30 / sqrt(32 - 12 + 1) = 6.55.
        assert_eq!(estimated_groups(&line(30, 2, 3, 16, 12)), 6);
        // a = 3, b = 3: 30 / 2.
        assert_eq!(estimated_groups(&line(30, 4, 4, 12, 12)), 15);
        // The best of the paper's own cost k ((n - 1) dx + L) ((n - 1) dy + H) over all k that divide 30 is nearest.
        let cost = |k: i64| k * ((30 / k - 1) * 4 + 12) * ((30 / k - 1) * 4 + 12);
        assert_eq!([1, 2, 3, 5, 6, 10, 15, 30].into_iter().min_by_key(|&k| cost(k)), Some(15));
    }

    #[test]
    fn estimate_of_degenerate_snakes() {
        assert_eq!(estimated_groups(&[]), 1);
        assert_eq!(estimated_groups(&line(1, 0, 0, 5, 5)), 1);
        assert_eq!(estimated_groups(&line(30, 0, 0, 9, 9)), 1, "standing still");
        assert_eq!(estimated_groups(&line(30, 4, 0, 9, 9)), 1, "along a row");
        assert_eq!(estimated_groups(&line(30, 0, 4, 9, 9)), 1, "along a column");
        assert_eq!(estimated_groups(&line(30, 9, 2, 9, 9)), 30, "boxes side by side");
        assert_eq!(estimated_groups(&line(30, 20, 30, 9, 9)), 30, "boxes apart along both axes");
        assert_eq!(estimated_groups(&line(30, 8, 8, 9, 9)), 30, "boxes that share a corner");
    }

    #[test]
    fn groups_of_simple_snakes() {
        let grouped = |boxes: &[TexelRect]| {
            let mut groups = vec![rect(1, 2, 3, 4)];
            group(boxes, &mut groups);
            assert_eq!(groups.remove(0), rect(1, 2, 3, 4), "what was there stays");
            groups
        };
        assert_eq!(grouped(&[]), []);
        assert_eq!(grouped(&line(1, 0, 0, 5, 6)), line(1, 0, 0, 5, 6));
        assert_eq!(grouped(&line(30, 4, 0, 9, 9)), [rect(10, 10, 125, 9)]);
        assert_eq!(grouped(&line(30, 0, 0, 9, 9)), [rect(10, 10, 9, 9)]);
        assert_eq!(grouped(&line(5, 9, 0, 9, 9)), [rect(10, 10, 45, 9)], "tiles of a row cost nothing together");
        assert_eq!(grouped(&line(5, 20, 30, 9, 9)), line(5, 20, 30, 9, 9));
    }
}
