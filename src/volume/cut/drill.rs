//! Removing what a burr passes: the model is in the room's documentation (`mod.rs`). `sweep.rs` says what a body covers,
//! `gather.rs` what that costs, and here it is taken.

use super::super::data::Volume;
use super::super::grid::{VoxelBox, linear_index};
use super::super::structures::Structures;
use super::CutVolume;
use super::bricks::{LANES, Lanes, SIDE, WHOLE};
use super::burr::{Burr, BurrShape, BurrStroke};
use super::frame::GridFrame;
use super::gather::{Field, is_nothing, keep_after};
use super::sweep::{Capsule, Cylinder, Tube, pieces};
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

/// Sums of a step.
struct Tally {
    by_label_mm3: [f64; 256],
    /// Sum of volume times voxel coordinates.
    moment: DVec3,
    changed: Option<VoxelBox>,
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
        // Half the width of the ellipsoid within a voxel is less than its longest edge.
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
        let total_mm3 = by_label_mm3.iter().fold(0.0, |sum, (_, mm3)| sum + mm3);
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
    fn cut_piece(&mut self, field: &Field, burr: &Burr, radius_mm: f64, tube: &Tube, budget: f64, tally: &mut Tally) {
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
            let place = linear_index(counts, at);
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
            let changed =
                lost.iter().enumerate().fold(0u8, |bits, (lane, &lost)| bits | (u8::from(lost > 0.0) << lane));
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
