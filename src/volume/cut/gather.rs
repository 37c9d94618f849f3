//! Which voxels a body takes something of, what that costs, and how far it has to shrink for a budget.

use super::super::grid::{VoxelBox, linear_index};
use super::bricks::{Bricks, LANES, Lanes, SIDE};
use super::frame::GridFrame;
use super::sweep::{Body, Tube};
use glam::UVec3;

/// Neighbours of which at least one may lose something.
#[derive(Clone)]
pub(super) struct Chunk {
    /// Place among the bricks around the piece.
    pub brick: u32,
    /// Place in the brick.
    pub place: u16,
    pub voxel: [u16; 3],
    pub remaining: Lanes,
    pub keep: Lanes,
    /// mm³ of cortical bone that the whole voxel costs.
    cost: Lanes,
}

/// What drilling needs for a moment, kept to save allocating it each step.
#[derive(Default)]
pub(super) struct Scratch {
    pub chunks: Vec<Chunk>,
    /// What each lane may keep more per millimetre, where that is not the same for all.
    pub per_mm: Vec<Lanes>,
    /// Bricks around the piece that a chunk lies in.
    pub is_touched: Vec<bool>,
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// What does not change during a step.
pub(super) struct Field<'a> {
    pub frame: GridFrame,
    pub size: UVec3,
    pub labels: &'a [u8],
    pub solid: &'a [u8],
    /// mm³ of cortical bone for a filled voxel over 255, by label.
    pub cost: [f32; 256],
}

/// Whether numbers, none of them negative, are all 0.
#[inline(always)]
pub(super) fn is_nothing(lanes: &Lanes) -> bool {
    let half: [f32; LANES / 2] = std::array::from_fn(|lane| lanes[lane] + lanes[lane + LANES / 2]);
    (half[0] + half[1]) + (half[2] + half[3]) == 0.0
}

/// What a voxel may keep once the body is shrunk.
#[inline(always)]
pub(super) fn keep_after(keep: f32, per_mm: f32, inset_mm: f32) -> f32 {
    let keep = keep + per_mm * inset_mm;
    let keep = if keep > 0.0 { keep } else { 0.0 };
    if keep < 1.0 { keep } else { 1.0 }
}

impl Field<'_> {
    /// The voxels that a tube can touch.
    pub fn around(&self, tube: &Tube) -> Option<VoxelBox> {
        let upper = &self.frame.upper;
        let reach = f64::from(tube.reach_mm);
        let other = tube.origin_mm + tube.along_mm.as_dvec3();
        let low_mm = tube.origin_mm.min(other) - reach;
        let high_mm = tube.origin_mm.max(other) + reach;
        // Back substitution with intervals.
        let within = |low: f64, high: f64, count: u32| {
            let (low, high) = (low.floor().max(0.0), high.ceil().min(f64::from(count) - 1.0));
            (low <= high).then_some([low, high])
        };
        let span = |axis: usize, shift: [f64; 2], count: u32| {
            let diagonal = upper.col(axis)[axis];
            within((low_mm[axis] - shift[1]) / diagonal, (high_mm[axis] - shift[0]) / diagonal, count)
        };
        let times = |factor: f64, [a, b]: [f64; 2]| {
            let (a, b) = (factor * a, factor * b);
            [a.min(b), a.max(b)]
        };
        let plus = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a + c, b + d];
        let z = span(2, [0.0; 2], self.size.z)?;
        let y = span(1, times(upper.z_axis.y, z), self.size.y)?;
        let x = span(0, plus(times(upper.z_axis.x, z), times(upper.y_axis.x, y)), self.size.x)?;
        let corner = |of: usize| UVec3::new(x[of] as u32, y[of] as u32, z[of] as u32);
        Some(VoxelBox { min: corner(0), max: corner(1) + 1 })
    }

    /// Whether no voxel of a box holds any tissue.
    pub fn is_air(&self, of: VoxelBox) -> bool {
        let length = of.size().x as usize;
        (of.min.z..of.max.z).all(|z| {
            (of.min.y..of.max.y).all(|y| {
                let first = self.index(UVec3::new(of.min.x, y, z));
                self.solid[first..first + length].iter().all(|&solid| solid == 0)
            })
        })
    }

    fn index(&self, voxel: UVec3) -> usize {
        linear_index(self.size, voxel)
    }

    /// Bytes of neighbours along x, 0 beyond the grid.
    #[inline(always)]
    pub fn lanes_of(&self, bytes: &[u8], voxel: UVec3) -> [u8; LANES] {
        let first = self.index(voxel);
        let inside = (self.size.x - voxel.x) as usize;
        match bytes[first..].first_chunk() {
            Some(lanes) if inside >= LANES => *lanes,
            _ => {
                let mut lanes = [0; LANES];
                let inside = inside.min(LANES);
                lanes[..inside].copy_from_slice(&bytes[first..first + inside]);
                lanes
            }
        }
    }

    /// Finds the chunks that a body takes something of, and what all of it costs.
    pub fn gather<B: Body, const ISOTROPIC: bool>(
        &self,
        bricks: &Bricks,
        body: &B,
        tube: &Tube,
        around: VoxelBox,
        scratch: &mut Scratch,
    ) -> f64 {
        let upper = &self.frame.upper;
        let step_mm = upper.x_axis.x;
        let per_step = (1.0 / step_mm) as f32;
        let lane_mm: Lanes = std::array::from_fn(|lane| (step_mm * lane as f64) as f32);
        let brick_min = around.min / SIDE as u32;
        let brick_counts = (around.max - 1) / SIDE as u32 - brick_min + 1;
        scratch.chunks.clear();
        scratch.per_mm.clear();
        scratch.is_touched.clear();
        scratch.is_touched.resize(brick_counts.element_product() as usize, false);
        let mut total = 0.0;
        for z in around.min.z..around.max.z {
            let z_mm = upper.z_axis * f64::from(z) - tube.origin_mm;
            let mut cost_of_plane: Lanes = [0.0; LANES];
            for y in around.min.y..around.max.y {
                let row_mm = z_mm + upper.y_axis * f64::from(y);
                let (row_y, row_z) = (row_mm.y as f32, row_mm.z as f32);
                let Some([low, high]) = tube.row_mm(row_y, row_z) else { continue };
                let start = row_mm.x as f32;
                let first = ((low - start) * per_step).max(around.min.x as f32) as usize;
                let last = ((high - start) * per_step).min((around.max.x - 1) as f32);
                if last < first as f32 {
                    continue;
                }
                let place_of_row = bricks.place(UVec3::new(0, y, z) / SIDE as u32);
                let number_of_row = ((z as usize / SIDE - brick_min.z as usize) * brick_counts.y as usize
                    + (y as usize / SIDE - brick_min.y as usize))
                    * brick_counts.x as usize;
                let chunk_of_row = Bricks::offset(0, y as usize, z as usize) / LANES;
                for chunk in first / LANES..=last as usize / LANES {
                    let brick = bricks.list[place_of_row + chunk / 2].as_deref();
                    let place = chunk_of_row + chunk % 2;
                    let remaining = brick.map_or([1.0; LANES], |brick| brick[place]);
                    if is_nothing(&remaining) {
                        continue;
                    }
                    let x = chunk * LANES;
                    let base = (row_mm.x + step_mm * x as f64) as f32;
                    let x_mm = lane_mm.map(|lane| base + lane);
                    let (mut keep, mut per_mm) = ([0.0; LANES], [0.0; LANES]);
                    body.keep(&x_mm, row_y, row_z, &mut keep, &mut per_mm);
                    if x + LANES > self.size.x as usize {
                        keep[self.size.x as usize - x..].fill(f32::MAX);
                    }
                    let mut lost: Lanes = [0.0; LANES];
                    for lane in 0..LANES {
                        let loss = remaining[lane] - keep_after(keep[lane], 0.0, 0.0);
                        lost[lane] = if loss > 0.0 { loss } else { 0.0 };
                    }
                    if is_nothing(&lost) {
                        continue;
                    }
                    let voxel = UVec3::new(x as u32, y, z);
                    let solid = self.lanes_of(self.solid, voxel);
                    let labels = self.lanes_of(self.labels, voxel);
                    let cost: Lanes = if labels == [labels[0]; LANES] {
                        let full = self.cost[usize::from(labels[0])];
                        solid.map(|solid| f32::from(solid) * full)
                    } else {
                        std::array::from_fn(|lane| f32::from(solid[lane]) * self.cost[usize::from(labels[lane])])
                    };
                    for lane in 0..LANES {
                        cost_of_plane[lane] += lost[lane] * cost[lane];
                    }
                    let brick = number_of_row + (chunk / 2 - brick_min.x as usize);
                    scratch.is_touched[brick] = true;
                    let voxel = [x as u16, y as u16, z as u16];
                    let (brick, place) = (brick as u32, place as u16);
                    scratch.chunks.push(Chunk { brick, place, voxel, remaining, keep, cost });
                    if !ISOTROPIC {
                        scratch.per_mm.push(per_mm);
                    }
                }
            }
            total += cost_of_plane.iter().map(|&cost| f64::from(cost)).sum::<f64>();
        }
        total
    }
}

#[inline(always)]
fn sum_costs(chunks: &[Chunk], inset_mm: f32, per_mm: impl Fn(usize) -> Lanes) -> (f64, f64) {
    let (mut total, mut slope) = (0.0, 0.0);
    // Single precision within a group of chunks, double between groups.
    for (group, chunks) in chunks.chunks(64).enumerate() {
        let (mut cost, mut fall): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        for (number, chunk) in chunks.iter().enumerate() {
            let slopes = per_mm(group * 64 + number);
            for lane in 0..LANES {
                let keep = keep_after(chunk.keep[lane], slopes[lane], inset_mm);
                let lost = chunk.remaining[lane] - keep;
                let lost = if lost > 0.0 { lost } else { 0.0 };
                cost[lane] += lost * chunk.cost[lane];
                // Of the ramp only: 0 where all is lost or nothing.
                fall[lane] += if lost * keep > 0.0 { chunk.cost[lane] * slopes[lane] } else { 0.0 };
            }
        }
        total += cost.iter().map(|&cost| f64::from(cost)).sum::<f64>();
        slope += fall.iter().map(|&fall| f64::from(fall)).sum::<f64>();
    }
    (total, slope)
}

impl Scratch {
    /// Cost of what the body takes once it is shrunk, and how fast that falls with the inset.
    fn cost_at(&self, inset_mm: f32, per_mm: f32) -> (f64, f64) {
        if self.per_mm.is_empty() {
            sum_costs(&self.chunks, inset_mm, |_| [per_mm; LANES])
        } else {
            sum_costs(&self.chunks, inset_mm, |number| self.per_mm[number])
        }
    }

    /// By how much the body shrinks so that what it takes costs the budget; it is gone when shrunk by `reach_mm`.
    pub fn inset_mm(&self, budget: f64, reach_mm: f32, per_mm: f32) -> f32 {
        let (mut low, mut high) = (0.0, f64::from(reach_mm));
        let mut inset = f64::from(self.inset_by_histogram(budget, reach_mm, per_mm));
        for _ in 0..40 {
            let (cost, fall) = self.cost_at(inset as f32, per_mm);
            let excess = cost - budget;
            if excess.abs() <= 1e-4 * budget {
                return inset as f32;
            }
            if excess > 0.0 {
                low = inset
            } else {
                high = inset
            }
            let newton = inset + excess / fall;
            inset = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        // A budget so small that single precision has no inset for it: rather too little than too much.
        high as f32
    }

    /// The same, roughly: each voxel's whole cost in the middle of the insets at which its ramp is passed.
    fn inset_by_histogram(&self, budget: f64, reach_mm: f32, per_mm: f32) -> f32 {
        const BINS: usize = 64;
        let mut bins = [0.0_f32; BINS];
        let bins_per_mm = BINS as f32 / reach_mm;
        for (number, chunk) in self.chunks.iter().enumerate() {
            let slopes = self.per_mm.get(number).copied().unwrap_or([per_mm; LANES]);
            let (mut cost, mut middle): (Lanes, [i32; LANES]) = ([0.0; LANES], [0; LANES]);
            for lane in 0..LANES {
                let keep = keep_after(chunk.keep[lane], 0.0, 0.0);
                let lost = chunk.remaining[lane] - keep;
                cost[lane] = if lost > 0.0 { lost * chunk.cost[lane] } else { 0.0 };
                let first = if chunk.keep[lane] < 0.0 { -chunk.keep[lane] } else { 0.0 };
                let last = chunk.remaining[lane] - chunk.keep[lane];
                middle[lane] = ((first + last) * (0.5 * bins_per_mm) / slopes[lane]) as i32;
            }
            for (cost, middle) in cost.into_iter().zip(middle) {
                bins[(middle as usize).min(BINS - 1)] += cost;
            }
        }
        let mut rest = budget as f32;
        for (bin, &cost) in bins.iter().enumerate().rev() {
            if cost > rest {
                return (bin as f32 + 1.0 - rest / cost) / bins_per_mm;
            }
            rest -= cost;
        }
        0.0
    }
}
