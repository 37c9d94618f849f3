//! Removing what a burr passes.
//!
//! # Model
//!
//! **Rate.** Preston's equation, with which grinding is reckoned: per second a burr can remove
//! `k * force * surface speed` mm³ of cortical bone, `surface speed = pi * diameter * turns per second`
//! ([`Burr::cortical_mm3_per_s`](super::Burr::cortical_mm3_per_s)). Other tissue takes as many times longer as it is harder: a
//! voxel costs `hardness * solid * voxel volume` of the step's budget.
//!
//! **Place.** The body that the burr covers on its way, with a ramp of one voxel's width at its surface whose sum is the
//! body's volume (`sweep.rs`). A voxel keeps at most `1 - coverage`, so the same pose removes nothing twice, however many steps
//! it is held. What is empty costs nothing and is lowered as well: else interpolation would leave a veil on cut surfaces.
//!
//! **Both.** Where the budget does not suffice for the body, the body is shrunk by moving its surface inwards, evenly, until
//! what it removes costs the budget. The cost falls piecewise linearly with the distance by which the surface moves, and
//! Newton's method within an interval finds it to a hundred-thousandth. So the middle of the burr goes first and surfaces stay
//! crisp and round. Nothing is carried into the next step: budget that finds nothing to remove is lost, as it is for a burr
//! that turns in the air.
//!
//! All lengths are millimetres, in the frame of `frame.rs`: neither the voxels' size and shape nor the length of a step has a
//! say in how much is removed.

use super::super::data::Volume;
use super::super::grid::VoxelBox;
use super::super::structures::Structures;
use super::CutVolume;
use super::bricks::{Bricks, LANES, Lanes, SIDE, WHOLE};
use super::burr::{Burr, BurrShape, BurrStroke};
use super::frame::GridFrame;
use super::sweep::{Body, Capsule, Cylinder, Tube, pieces};
use bevy::reflect::Reflect;
use glam::{DVec3, UVec3, Vec3};
use std::sync::Arc;

/// What a step of drilling removed.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct Removal {
    /// Volume of tissue per structure, mm³: labels that lost something, ascending; 0 is what belongs to no structure.
    pub by_label_mm3: Vec<(u8, f64)>,
    /// Volume of all tissue, mm³.
    pub total_mm3: f64,
    /// Where it was in the mean, volume space, metres; none if no tissue was removed.
    pub centroid_m: Option<DVec3>,
    /// Around all voxels whose remaining opacity changed; none if none did.
    pub changed: Option<VoxelBox>,
}

/// Neighbours of which at least one may lose something.
#[derive(Clone)]
struct Chunk {
    /// Place among the bricks around the piece.
    brick: u32,
    /// Place in the brick.
    place: u16,
    voxel: [u16; 3],
    remaining: Lanes,
    keep: Lanes,
    /// mm³ of cortical bone that the whole voxel costs.
    cost: Lanes,
}

/// What drilling needs for a moment, kept to save allocating it each step.
#[derive(Default)]
pub(super) struct Scratch {
    chunks: Vec<Chunk>,
    per_mm: Vec<Lanes>,
    is_touched: Vec<bool>,
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// Sums of a step.
struct Tally {
    by_label_mm3: [f64; 256],
    /// Sum of volume times voxel coordinates.
    moment: DVec3,
    changed: Option<VoxelBox>,
}

/// What does not change during a step.
struct Field<'a> {
    frame: GridFrame,
    size: UVec3,
    labels: &'a [u8],
    solid: &'a [u8],
    /// mm³ of cortical bone for a filled voxel over 255, by label.
    cost: [f32; 256],
}

/// Removes what a stroke covers and what its force and time suffice for.
pub(super) fn drill(
    cut: &mut CutVolume,
    volume: &Volume,
    structures: &Structures,
    stroke: &BurrStroke,
    dt_s: f64,
) -> Removal {
    let BurrStroke { burr, from, to, .. } = stroke;
    let budget = burr.cortical_mm3_per_s(stroke.force_n, stroke.speed_rpm) * dt_s;
    let grid = volume.grid();
    let is_same_grid = grid.size == cut.size() && structures.labels().len() == grid.count();
    let is_placed = from.centre_m.is_finite() && to.centre_m.is_finite();
    if !(budget.is_finite() && budget > 0.0 && is_same_grid && is_placed && burr.check().is_ok()) {
        return Removal::default();
    }
    let frame = GridFrame::new(grid);
    let is_ball = matches!(burr.shape, BurrShape::Sphere);
    let place = |pose: &super::BurrPose| {
        let axis = if is_ball { Some(Vec3::Y) } else { pose.axis.try_normalize() };
        axis.map(|axis| [frame.point_mm(pose.centre_m), frame.direction(axis)])
    };
    let (Some(from), Some(to)) = (place(from), place(to)) else { return Removal::default() };
    let mut cost = [(frame.voxel_mm3 / 255.0) as f32; 256];
    for (cost, structure) in cost[1..].iter_mut().zip(structures.list()) {
        *cost *= structure.hardness;
    }
    let (labels, solid) = (structures.labels(), structures.solid());
    let field = Field { frame, size: grid.size, labels, solid, cost };
    let mut tally = Tally { by_label_mm3: [0.0; 256], moment: DVec3::ZERO, changed: None };
    for piece in pieces(&field.frame, grid.size.as_dvec3(), burr, from, to) {
        // The end that the burr goes on from is the origin, so that standing still there finds the same distances.
        let [other, origin_mm] = piece.ends_mm;
        let radius_mm = f64::from(burr.diameter_m) * 500.0;
        let along_mm = (other - origin_mm).as_vec3();
        // Half a voxel's diagonal is the most that a ramp can reach.
        let axes = [field.frame.upper.x_axis, field.frame.upper.y_axis, field.frame.upper.z_axis];
        let ramp_mm = if field.frame.is_isotropic {
            0.5 * field.frame.ramp_mm
        } else {
            axes.iter().map(|axis| axis.length()).fold(field.frame.ramp_mm, f64::max)
        };
        let tube = Tube { origin_mm, along_mm, reach_mm: (radius_mm + ramp_mm) as f32 };
        let budget = budget * piece.time_share;
        cut.cut_piece(&field, burr, radius_mm, &tube, budget, &mut tally);
    }
    if let Some(changed) = tally.changed {
        cut.changes.push(changed);
    }
    tally.removal(volume)
}

impl Tally {
    fn removal(&self, volume: &Volume) -> Removal {
        let lost = self.by_label_mm3.iter().enumerate().filter(|(_, mm3)| **mm3 > 0.0);
        let by_label_mm3: Vec<(u8, f64)> = lost.map(|(label, &mm3)| (label as u8, mm3)).collect();
        let total_mm3: f64 = by_label_mm3.iter().map(|(_, mm3)| mm3).sum();
        let centroid_m = (total_mm3 > 0.0).then(|| {
            let volume_from_voxel = glam::DAffine3::from_mat3_translation(
                glam::Mat3::from(volume.grid().volume_from_voxel().matrix3).as_dmat3(),
                volume.grid().volume_from_voxel().translation.as_dvec3(),
            );
            volume_from_voxel.transform_point3(self.moment / total_mm3)
        });
        Removal { by_label_mm3, total_mm3, centroid_m, changed: self.changed }
    }
}

impl CutVolume {
    fn cut_piece(
        &mut self,
        field: &Field,
        burr: &Burr,
        radius_mm: f64,
        tube: &Tube,
        budget: f64,
        tally: &mut Tally,
    ) {
        let Some(around) = field.around(tube) else { return };
        if field.is_air(around.grown(1, field.size)) {
            return;
        }
        let (frame, bricks, scratch) = (&field.frame, &self.bricks, &mut self.scratch);
        let moves = tube.along_mm != Vec3::ZERO;
        let cost = match (burr.shape, frame.is_isotropic) {
            (BurrShape::Cylinder { .. }, true) => {
                field.gather::<_, true>(bricks, &Cylinder::<true>::new(frame, radius_mm, tube), tube, around, scratch)
            }
            (BurrShape::Cylinder { .. }, false) => {
                field.gather::<_, false>(bricks, &Cylinder::<false>::new(frame, radius_mm, tube), tube, around, scratch)
            }
            (_, true) if moves => field.gather::<_, true>(
                bricks,
                &Capsule::<true, true>::new(frame, radius_mm, tube),
                tube,
                around,
                scratch,
            ),
            (_, true) => field.gather::<_, true>(
                bricks,
                &Capsule::<false, true>::new(frame, radius_mm, tube),
                tube,
                around,
                scratch,
            ),
            (_, false) => field.gather::<_, false>(
                bricks,
                &Capsule::<true, false>::new(frame, radius_mm, tube),
                tube,
                around,
                scratch,
            ),
        };
        let per_mm = (1.0 / frame.ramp_mm) as f32;
        let inset_mm = if cost > budget { scratch.inset_mm(budget, tube.reach_mm, per_mm) } else { 0.0 };
        self.lower(field, around, inset_mm, per_mm, tally);
    }

    /// Lowers the gathered chunks to what the body, shrunk by an inset, lets them keep.
    fn lower(&mut self, field: &Field, around: VoxelBox, inset_mm: f32, per_mm: f32, tally: &mut Tally) {
        let brick_min = around.min / SIDE as u32;
        let brick_counts = (around.max - 1) / SIDE as u32 - brick_min + 1;
        // The bricks that change, each borrowed once; places ascend with the bricks around the piece.
        let mut borrowed = Vec::with_capacity(self.scratch.is_touched.len());
        let mut rest = &mut self.bricks.list[..];
        let mut taken = 0;
        for (number, &is_touched) in self.scratch.is_touched.iter().enumerate() {
            if !is_touched {
                borrowed.push(None);
                continue;
            }
            let number = number as u32;
            let local = UVec3::new(
                number % brick_counts.x,
                number / brick_counts.x % brick_counts.y,
                number / (brick_counts.x * brick_counts.y),
            );
            let at = brick_min + local;
            let counts = self.bricks.counts;
            let place = (at.z as usize * counts.y as usize + at.y as usize) * counts.x as usize + at.x as usize;
            let (before, after) = rest.split_at_mut(place + 1 - taken);
            rest = after;
            taken = place + 1;
            let Some(brick) = before.last_mut() else { continue };
            self.journal.note(place, brick);
            borrowed.push(Some(Arc::make_mut(brick.get_or_insert_with(|| Arc::new(WHOLE)))));
        }
        let (mut low, mut high) = (UVec3::MAX, UVec3::ZERO);
        for (number, chunk) in self.scratch.chunks.iter().enumerate() {
            let Some(Some(brick)) = borrowed.get_mut(chunk.brick as usize) else { continue };
            let mut lost: Lanes = [0.0; LANES];
            let mut left: Lanes = [0.0; LANES];
            let slopes = self.scratch.per_mm.get(number);
            for lane in 0..LANES {
                let slope = slopes.map_or(per_mm, |slopes| slopes[lane]);
                let keep = keep_after(chunk.keep[lane], slope, inset_mm);
                left[lane] = if keep < chunk.remaining[lane] { keep } else { chunk.remaining[lane] };
                lost[lane] = chunk.remaining[lane] - left[lane];
            }
            if is_nothing(&lost) {
                continue;
            }
            let changed = lost.iter().enumerate().fold(0u8, |bits, (lane, &lost)| bits | (u8::from(lost > 0.0) << lane));
            brick[usize::from(chunk.place)] = left;
            let voxel = UVec3::from_array(chunk.voxel.map(u32::from));
            low = low.min(voxel + UVec3::new(changed.trailing_zeros(), 0, 0));
            high = high.max(voxel + UVec3::new(8 - changed.leading_zeros(), 1, 1));
            tally.add(field, voxel, &lost);
        }
        if low.cmplt(high).all() {
            let changed = VoxelBox { min: low, max: high };
            tally.changed = Some(tally.changed.map_or(changed, |before| before.union(&changed)));
        }
    }
}

/// Whether numbers, none of them negative, are all 0.
#[inline(always)]
fn is_nothing(lanes: &Lanes) -> bool {
    let half: [f32; LANES / 2] = std::array::from_fn(|lane| lanes[lane] + lanes[lane + LANES / 2]);
    (half[0] + half[1]) + (half[2] + half[3]) == 0.0
}

/// What a voxel may keep once the body is shrunk.
#[inline(always)]
fn keep_after(keep: f32, per_mm: f32, inset_mm: f32) -> f32 {
    let keep = keep + per_mm * inset_mm;
    let keep = if keep > 0.0 { keep } else { 0.0 };
    if keep < 1.0 { keep } else { 1.0 }
}

impl Tally {
    #[inline]
    fn add(&mut self, field: &Field, voxel: UVec3, lost: &Lanes) {
        let solid = field.lanes_of(field.solid, voxel);
        let per_byte = field.frame.voxel_mm3 / 255.0;
        let mut mm3 = [0.0_f32; LANES];
        let (mut sum, mut along) = (0.0_f32, 0.0_f32);
        for lane in 0..LANES {
            mm3[lane] = lost[lane] * f32::from(solid[lane]);
            sum += mm3[lane];
            along += mm3[lane] * lane as f32;
        }
        if sum == 0.0 {
            return;
        }
        let total = f64::from(sum) * per_byte;
        self.moment += voxel.as_dvec3() * total + DVec3::new(f64::from(along) * per_byte, 0.0, 0.0);
        let labels = field.lanes_of(field.labels, voxel);
        if labels == [labels[0]; LANES] {
            self.by_label_mm3[usize::from(labels[0])] += total;
        } else {
            for (&label, &mm3) in labels.iter().zip(&mm3) {
                self.by_label_mm3[usize::from(label)] += f64::from(mm3) * per_byte;
            }
        }
    }
}

impl Field<'_> {
    /// The voxels that a tube can touch.
    fn around(&self, tube: &Tube) -> Option<VoxelBox> {
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
    fn is_air(&self, of: VoxelBox) -> bool {
        let length = of.size().x as usize;
        (of.min.z..of.max.z).all(|z| {
            (of.min.y..of.max.y).all(|y| {
                let first = self.index(UVec3::new(of.min.x, y, z));
                self.solid[first..first + length].iter().all(|&solid| solid == 0)
            })
        })
    }

    fn index(&self, voxel: UVec3) -> usize {
        (voxel.z as usize * self.size.y as usize + voxel.y as usize) * self.size.x as usize + voxel.x as usize
    }

    /// Bytes of neighbours along x, 0 beyond the grid.
    #[inline(always)]
    fn lanes_of(&self, bytes: &[u8], voxel: UVec3) -> [u8; LANES] {
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
    fn gather<B: Body, const ISOTROPIC: bool>(
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
    fn inset_mm(&self, budget: f64, reach_mm: f32, per_mm: f32) -> f32 {
        let (mut low, mut high) = (0.0, f64::from(reach_mm));
        let mut inset = f64::from(self.inset_by_histogram(budget, reach_mm, per_mm));
        for _ in 0..60 {
            let (cost, fall) = self.cost_at(inset as f32, per_mm);
            let excess = cost - budget;
            if excess.abs() <= 1e-4 * budget {
                break;
            }
            if excess > 0.0 { low = inset } else { high = inset }
            let newton = inset + excess / fall;
            inset = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        inset as f32
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
