//! The matter of a volume that is nearest to a rod, passing over blocks in which there is none.

use super::VoxelBox;
use super::pick::{BLOCK_SIDE, SURFACE, VolumePicker};
use crate::organ::closest::on_segment;
use bevy::reflect::Reflect;
use glam::{DVec3, UVec3};

/// Steps of half a voxel in which the way out of matter is looked for.
const MOST_STEPS_OUT: u32 = 96;

/// The place of a volume's matter that is nearest to a segment; all in the volume's space.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct MatterHit {
    /// How far the segment is from the surface, metres; below 0 where its nearest place is that deep in matter.
    pub height_m: f64,
    /// The place on the surface, metres.
    pub position_m: DVec3,
    /// The place on the segment, metres.
    pub on_segment_m: DVec3,
    /// Unit normal out of the matter.
    pub normal: DVec3,
    /// The voxel there.
    pub voxel: UVec3,
    /// Its label, 0 for none.
    pub label: u8,
}

impl VolumePicker {
    /// The matter that is nearest to a segment (or to a point, where its ends are one), at most `max_distance_m` away: of the voxels
    /// that are matter the one whose middle is nearest says where the surface is looked for. `remaining` is the remaining opacity
    /// of a voxel, 0 to 1. `None` also for what is no number.
    pub fn nearest_to_segment(
        &self,
        ends_m: [DVec3; 2],
        max_distance_m: f64,
        remaining: impl Fn(UVec3) -> f32,
    ) -> Option<MatterHit> {
        if !(ends_m.iter().all(|end| end.is_finite()) && max_distance_m.is_finite() && max_distance_m >= 0.0) {
            return None;
        }
        let voxel = self.nearest_voxel(ends_m, max_distance_m, &remaining)?;
        let middle_m = self.volume_from_voxel.transform_point3(voxel.as_dvec3());
        let on_segment_m = on_segment(middle_m, ends_m);
        let label = self.structures().labels()[self.grid.index(voxel)];
        let hit = |height_m, position_m, normal| MatterHit { height_m, position_m, on_segment_m, normal, voxel, label };
        let out = (on_segment_m - middle_m).as_vec3();
        let at_voxel = |at_m: DVec3| self.voxel_from_volume.transform_point3(at_m).as_vec3();
        let normal_at = |at_m: DVec3| self.normal_at(at_voxel(at_m), &remaining).map(|normal| normal.as_dvec3());
        if self.filling_at(at_voxel(on_segment_m), &remaining) < SURFACE as f32 {
            // From outside: towards the voxel's middle the surface must come.
            let met = self.pick(on_segment_m.as_vec3(), -out, out.length(), &remaining);
            let (position_m, normal) =
                met.map_or((middle_m, None), |met| (met.position_m.as_dvec3(), Some(met.normal.as_dvec3())));
            let height_m = on_segment_m.distance(position_m);
            let normal = normal.or_else(|| (on_segment_m - position_m).try_normalize()).unwrap_or(DVec3::Y);
            return (height_m <= max_distance_m).then(|| hit(height_m, position_m, normal));
        }
        // Inside: out along the normal, as far as that may be.
        let normal = normal_at(on_segment_m).unwrap_or(DVec3::Y);
        let step_m = 0.5 * self.grid.voxel_mm3().cbrt() * 1e-3;
        let out_of = (1..=MOST_STEPS_OUT).map(|step| f64::from(step) * step_m);
        let depth_m = out_of
            .into_iter()
            .find(|depth_m| self.filling_at(at_voxel(on_segment_m + normal * *depth_m), &remaining) < SURFACE as f32)
            .unwrap_or(f64::from(MOST_STEPS_OUT) * step_m);
        let position_m = on_segment_m + normal * depth_m;
        Some(hit(-depth_m, position_m, normal_at(position_m).unwrap_or(normal)))
    }

    /// The voxel that is matter whose middle is nearest.
    fn nearest_voxel(
        &self,
        ends_m: [DVec3; 2],
        max_distance_m: f64,
        remaining: &impl Fn(UVec3) -> f32,
    ) -> Option<UVec3> {
        let volume_from_voxel = self.volume_from_voxel;
        let edges_m =
            [volume_from_voxel.matrix3.x_axis, volume_from_voxel.matrix3.y_axis, volume_from_voxel.matrix3.z_axis];
        let [a, b, c] = edges_m;
        let diagonal_m =
            [a + b + c, a + b - c, a - b + c, a - b - c].map(DVec3::length).into_iter().fold(0.0, f64::max);
        // The surface may be a voxel nearer than the middle of the voxel that makes it.
        let reach_m = max_distance_m + 0.5 * diagonal_m;
        let ends = ends_m.map(|end| self.voxel_from_volume.transform_point3(end));
        let per_axis = DVec3::from_array(std::array::from_fn(|axis| self.voxel_from_volume.matrix3.row(axis).length()));
        let low = ends[0].min(ends[1]) - per_axis * reach_m;
        let high = ends[0].max(ends[1]) + per_axis * reach_m;
        let last = self.grid.size.as_dvec3() - 1.0;
        if low.cmpgt(last).any() || high.cmplt(DVec3::ZERO).any() {
            return None;
        }
        let voxels =
            VoxelBox { min: low.ceil().max(DVec3::ZERO).as_uvec3(), max: (high.floor().min(last) + 1.0).as_uvec3() };
        let (first, end) = (voxels.min / BLOCK_SIDE, (voxels.max - 1) / BLOCK_SIDE + 1);
        let half_block_m = 0.5 * f64::from(BLOCK_SIDE) * diagonal_m;
        let mut near: Vec<(f64, UVec3)> = Vec::new();
        for z in first.z..end.z {
            for y in first.y..end.y {
                for x in first.x..end.x {
                    let block = UVec3::new(x, y, z);
                    if !self.may_be_matter_in(block.as_dvec3()) {
                        continue;
                    }
                    let middle = block.as_dvec3() * f64::from(BLOCK_SIDE) + (0.5 * f64::from(BLOCK_SIDE) - 0.5);
                    let middle_m = volume_from_voxel.transform_point3(middle);
                    let at_least_m = on_segment(middle_m, ends_m).distance(middle_m) - half_block_m;
                    if at_least_m <= reach_m {
                        near.push((at_least_m, block));
                    }
                }
            }
        }
        // Near ones first: then most of the others need not be looked at.
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(f64, UVec3)> = None;
        let solid = self.structures().solid();
        for (at_least_m, block) in near {
            let most_m = best.map_or(reach_m, |(distance_m, _)| distance_m);
            if at_least_m > most_m {
                break;
            }
            let min = (block * BLOCK_SIDE).max(voxels.min);
            let max = (block * BLOCK_SIDE + BLOCK_SIDE).min(voxels.max);
            for z in min.z..max.z {
                for y in min.y..max.y {
                    let row = self.grid.index(UVec3::new(0, y, z));
                    // No voxel of the row is nearer than its middle less half of its length.
                    let middle = DVec3::new(f64::from(min.x + max.x - 1) * 0.5, y.into(), z.into());
                    let middle_m = volume_from_voxel.transform_point3(middle);
                    let at_least_m =
                        on_segment(middle_m, ends_m).distance(middle_m) - 0.5 * f64::from(BLOCK_SIDE) * a.length();
                    if at_least_m > best.map_or(reach_m, |(distance_m, _)| distance_m) {
                        continue;
                    }
                    for x in min.x..max.x {
                        let (voxel, filled) = (UVec3::new(x, y, z), solid[row + x as usize]);
                        if f64::from(filled) < SURFACE * 255.0 {
                            continue;
                        }
                        let middle_m = volume_from_voxel.transform_point3(voxel.as_dvec3());
                        let distance_m = on_segment(middle_m, ends_m).distance(middle_m);
                        // What is left of it is asked last: that costs most.
                        if distance_m < best.map_or(reach_m, |(distance_m, _)| distance_m)
                            && f64::from(filled) / 255.0 * f64::from(remaining(voxel)) >= SURFACE
                        {
                            best = Some((distance_m, voxel));
                        }
                    }
                }
            }
        }
        best.map(|(_, voxel)| voxel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::VolumeGrid;
    use crate::volume::structures::{Structure, Structures};
    use proptest::prelude::*;

    /// A ball of 8 mm in voxels of 1 mm, around the origin.
    fn ball() -> VolumePicker {
        let grid = VolumeGrid::upright(UVec3::splat(32), DVec3::ONE);
        let volume_from_voxel = grid.volume_from_voxel();
        let mut solid = vec![0; grid.count()];
        for index in 0..grid.count() as u32 {
            let voxel = UVec3::new(index % 32, index / 32 % 32, index / 1024);
            let distance_m = volume_from_voxel.transform_point3(voxel.as_vec3()).length();
            solid[index as usize] = ((0.5 + (0.008 - distance_m) / 0.002).clamp(0.0, 1.0) * 255.0) as u8;
        }
        let labels = solid.iter().map(|&solid| u8::from(solid > 0)).collect();
        let bone = Structure {
            name: "bone".into(),
            colour: [255; 3],
            tissue: Default::default(),
            hardness: 1.0,
            bleeding_ml_per_s_mm3: 0.0,
            is_critical: false,
        };
        VolumePicker::new(grid, Structures::new(vec![bone], labels, solid).expect("one bone").into()).expect("its grid")
    }

    proptest! {
        #[test]
        fn rods_beside_a_ball_are_as_far_from_it_as_they_are(
            out in prop::array::uniform3(-1.0..1.0_f64),
            aside in prop::array::uniform3(-1.0..1.0_f64),
            height_mm in -2.0..6.0_f64,
            half_mm in 0.0..10.0_f64,
        ) {
            // A rod through the ball has no one depth: there, points are asked for.
            let half_mm = if height_mm < 0.0 { 0.0 } else { half_mm };
            let out = DVec3::from_array(out).normalize_or(DVec3::X);
            let along = DVec3::from_array(aside).cross(out).normalize_or_zero() * half_mm * 1e-3;
            let middle = out * (8.0 + height_mm) * 1e-3;
            let hit = ball().nearest_to_segment([middle - along, middle + along], 0.01, |_| 1.0).expect("within 1 cm");
            // Of a surface between voxels half of one is known.
            prop_assert!((hit.height_m - height_mm * 1e-3).abs() < 0.6e-3, "{} mm for {height_mm}", hit.height_m * 1e3);
            prop_assert!((hit.position_m.length() - 8e-3).abs() < 0.5e-3);
            prop_assert!(hit.normal.dot(hit.position_m.normalize()) > 0.95);
            prop_assert_eq!(hit.label, 1);
        }
    }

    #[test]
    fn nothing_is_near_what_is_far_away_or_drilled_away() {
        let ball = ball();
        let at = |x_mm: f64| [DVec3::X * x_mm * 1e-3; 2];
        assert_eq!(ball.nearest_to_segment(at(12.0), 3e-3, |_| 1.0), None);
        assert!(ball.nearest_to_segment(at(12.0), 5e-3, |_| 1.0).is_some());
        assert_eq!(ball.nearest_to_segment(at(12.0), 5e-3, |_| 0.0), None);
        assert_eq!(ball.nearest_to_segment([DVec3::NAN; 2], 5e-3, |_| 1.0), None);
        assert_eq!(ball.nearest_to_segment(at(12.0), f64::NAN, |_| 1.0), None);
        assert_eq!(ball.nearest_to_segment(at(1e9), 5e-3, |_| 1.0), None);
    }
}
