//! Bone as voxels: a box of them around the tool, and how much of it a burr covers.

use super::{SurfaceFeel, SurfacePatch, nets};
use crate::volume::cut::{Burr, BurrShape};
use glam::{DAffine3, DMat3, DVec3, Mat3, UVec3, Vec3};

/// Voxels around a tool: what is left of the bone in them and what it belongs to. Outside of the box there is nothing, so it should
/// reach further than the tool gets before the next one.
#[derive(Clone, Debug, PartialEq)]
pub struct BoneBrick {
    size: UVec3,
    solid: Vec<u8>,
    label: Vec<u8>,
    hardness: Box<[f32; 256]>,
    world_from_voxel: DAffine3,
    voxel_from_world: DAffine3,
}

impl Default for BoneBrick {
    fn default() -> Self {
        Self {
            size: UVec3::ZERO,
            solid: Vec::new(),
            label: Vec::new(),
            hardness: Box::new([1.0; 256]),
            world_from_voxel: DAffine3::IDENTITY,
            voxel_from_world: DAffine3::IDENTITY,
        }
    }
}

impl BoneBrick {
    /// A box of voxels, i fastest: 255 for solid bone and 0 for none, the label of each, and how hard each label is as a multiple of
    /// cortical bone. Voxel (0, 0, 0) of the box has its centre at the origin of its coordinates. None where the numbers of voxels do
    /// not agree, or the map cannot be turned round.
    pub fn new(
        size: UVec3,
        solid: Vec<u8>,
        label: Vec<u8>,
        hardness: [f32; 256],
        world_from_voxel: DAffine3,
    ) -> Option<Self> {
        let count = size.as_u64vec3().element_product() as usize;
        let voxel_from_world = world_from_voxel.inverse();
        let is_map = world_from_voxel.is_finite() && voxel_from_world.is_finite();
        let agrees = solid.len() == count && label.len() == count && size.max_element() <= 4096;
        (is_map && agrees).then(|| Self {
            size,
            solid,
            label,
            hardness: Box::new(hardness),
            world_from_voxel,
            voxel_from_world,
        })
    }

    /// Voxels along each axis.
    pub fn size(&self) -> UVec3 {
        self.size
    }

    /// From voxel coordinates to the world.
    pub fn world_from_voxel(&self) -> DAffine3 {
        self.world_from_voxel
    }

    /// What is left of a voxel, from 0 to 255.
    pub fn solid(&self, voxel: UVec3) -> u8 {
        let [x, y, z] = voxel.to_array().map(|place| place as usize);
        let [width, height, _] = self.size.to_array().map(|side| side as usize);
        if voxel.cmplt(self.size).all() { self.solid[(z * height + y) * width + x] } else { 0 }
    }

    pub(super) fn all_solid(&self) -> &[u8] {
        &self.solid
    }

    /// The largest of a voxel's edges, metres.
    pub fn voxel_m(&self) -> f64 {
        let axes = self.world_from_voxel.matrix3;
        axes.x_axis.length().max(axes.y_axis.length()).max(axes.z_axis.length())
    }
}

/// Bone near a tool: its voxels for a burr that runs, and their surface for everything else.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BonePatch {
    /// The voxels.
    pub brick: BoneBrick,
    /// Their surface.
    pub surface: SurfacePatch,
}

impl BonePatch {
    /// Makes the surface of a box of voxels, halfway between empty and solid. It covers the ball that fits into the box.
    pub fn new(brick: BoneBrick, feel: SurfaceFeel) -> Self {
        let (positions_m, triangles) = nets::surface(&brick);
        let mut surface = SurfacePatch::new(positions_m, triangles, feel);
        let half = (brick.size.as_dvec3() - 1.0) * 0.5;
        surface.centre_m = brick.world_from_voxel.transform_point3(half);
        let axes = brick.world_from_voxel.matrix3;
        let sides = [axes.x_axis * half.x, axes.y_axis * half.y, axes.z_axis * half.z].map(DVec3::length);
        surface.reach_m = sides.into_iter().fold(f64::INFINITY, f64::min).max(0.0);
        Self { brick, surface }
    }

    /// Voxels alone, without their surface: enough for a burr that turns, which goes into them. Nothing else touches it.
    pub fn voxels_only(brick: BoneBrick, feel: SurfaceFeel) -> Self {
        Self { brick, surface: SurfacePatch::new(Vec::new(), Vec::new(), feel) }
    }
}

/// What a burr covers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BurrOverlap {
    /// Volume of bone in it, cubic metres.
    pub volume_m3: f64,
    /// Out of the bone; zero where that cannot be told.
    pub normal: DVec3,
    /// Volume by which the overlap shrinks per metre along the normal: the area of the cut, square metres.
    pub area_m2: f64,
    /// How deep the burr is in, metres: for a ball, the height of the cap with that volume.
    pub depth_m: f64,
    /// Where the bone in it is in the mean, world, metres.
    pub centroid_m: DVec3,
    /// Hardness in the mean.
    pub hardness: f64,
    /// The label of most of it.
    pub label: u8,
}

/// How much bone a burr covers whose middle and axis are given in the world.
///
/// The normal is the direction in which the covered volume shrinks fastest, so that the force of a ball is the slope of an energy:
/// moving about in still bone gains nothing.
pub fn overlap(brick: &BoneBrick, burr: &Burr, middle_m: DVec3, axis: DVec3) -> BurrOverlap {
    let mut found = BurrOverlap { hardness: 1.0, centroid_m: middle_m, ..BurrOverlap::default() };
    let (Ok(()), true) = (burr.check(), middle_m.is_finite()) else { return found };
    let axis = axis.try_normalize().unwrap_or(DVec3::Y);
    // In the burr's own axes, Y along its axis, in shares of single precision: the box is small.
    let aside = axis.any_orthonormal_vector();
    let world_from_burr = DMat3::from_cols(aside, axis, aside.cross(axis));
    let burr_from_voxel = (world_from_burr.transpose() * brick.world_from_voxel.matrix3).as_mat3();
    let middle = brick.voxel_from_world.transform_point3(middle_m);
    let voxel_m3 = brick.world_from_voxel.matrix3.determinant().abs();
    let ramp_m = voxel_m3.cbrt() as f32;
    let Some((min, max)) = covered_box(brick, burr, world_from_burr, middle, ramp_m) else { return found };
    let sums = sum(brick, burr, burr_from_voxel, middle, ramp_m, min, max);
    if sums.volume <= 0.0 {
        return found;
    }
    found.volume_m3 = f64::from(sums.volume) * voxel_m3;
    found.hardness = f64::from(sums.hardness / sums.volume);
    found.centroid_m = brick.world_from_voxel.transform_point3(middle + (sums.moment / sums.volume).as_dvec3());
    found.label = sums.label;
    let slope_m2 = world_from_burr * sums.slope.as_dvec3() * voxel_m3;
    if let Some(normal) = slope_m2.try_normalize() {
        found.normal = normal;
        found.area_m2 = slope_m2.length();
    }
    found.depth_m = depth_m(burr, found.volume_m3, found.area_m2);
    found
}

/// The voxels that a burr may cover.
fn covered_box(
    brick: &BoneBrick,
    burr: &Burr,
    world_from_burr: DMat3,
    middle: DVec3,
    ramp_m: f32,
) -> Option<(UVec3, UVec3)> {
    let radius_m = f64::from(burr.diameter_m) * 0.5;
    let half_m = match burr.shape {
        BurrShape::Sphere => radius_m,
        BurrShape::Cylinder { length_m } | BurrShape::Matchstick { length_m } => f64::from(length_m) * 0.5,
    };
    let voxel_from_burr = brick.voxel_from_world.matrix3 * world_from_burr;
    let margin_m = f64::from(ramp_m) * 0.5;
    let along = |axis: usize| {
        let row = voxel_from_burr.row(axis);
        if matches!(burr.shape, BurrShape::Sphere) {
            row.length() * (radius_m + margin_m)
        } else {
            row.y.abs() * (half_m + margin_m) + row.x.hypot(row.z) * (radius_m + margin_m)
        }
    };
    let reach = DVec3::new(along(0), along(1), along(2));
    let last = brick.size.as_dvec3() - 1.0;
    let (min, max) = ((middle - reach).ceil().max(DVec3::ZERO), (middle + reach).floor().min(last));
    (min.cmple(max).all()).then(|| (min.as_uvec3(), max.as_uvec3()))
}

#[derive(Clone, Copy)]
struct Sums {
    volume: f32,
    hardness: f32,
    /// Voxel coordinates from the burr's middle, times volume.
    moment: Vec3,
    /// How the volume shrinks with a step along each of the burr's axes, per metre.
    slope: Vec3,
    label: u8,
}

fn sum(
    brick: &BoneBrick,
    burr: &Burr,
    burr_from_voxel: Mat3,
    middle: DVec3,
    ramp_m: f32,
    min: UVec3,
    max: UVec3,
) -> Sums {
    let mut sums = Sums { volume: 0.0, hardness: 0.0, moment: Vec3::ZERO, slope: Vec3::ZERO, label: 0 };
    // The label of the most is found by a vote, without a table: a majority always wins, and the rest is a matter of taste.
    let (mut leading, mut lead) = (0_u8, 0.0_f32);
    let (width, height) = (brick.size.x as usize, brick.size.y as usize);
    let radius_m = burr.diameter_m * 0.5;
    let is_ball = matches!(burr.shape, BurrShape::Sphere);
    let (inner2, outer2) = ((radius_m - 0.5 * ramp_m).max(0.0).powi(2), (radius_m + 0.5 * ramp_m).powi(2));
    for z in min.z..=max.z {
        for y in min.y..=max.y {
            let row = (z as usize * height + y as usize) * width;
            let from = Vec3::new(
                (f64::from(min.x) - middle.x) as f32,
                (f64::from(y) - middle.y) as f32,
                (f64::from(z) - middle.z) as f32,
            );
            let mut place = from;
            let mut at_m = burr_from_voxel * from;
            let step_m = burr_from_voxel.x_axis;
            let voxels = row + min.x as usize..=row + max.x as usize;
            for (&solid, &label) in brick.solid[voxels.clone()].iter().zip(&brick.label[voxels]) {
                let (here, here_m) = (place, at_m);
                place.x += 1.0;
                at_m += step_m;
                if solid == 0 {
                    continue;
                }
                let length2 = here_m.length_squared();
                if is_ball && length2 >= outer2 {
                    continue;
                }
                let solid = f32::from(solid) * (1.0 / 255.0);
                let mut weight = solid;
                if !is_ball || length2 > inner2 {
                    let (distance_m, outwards) = if is_ball {
                        let length = length2.sqrt();
                        (length - radius_m, here_m / length.max(1e-9))
                    } else {
                        (burr.signed_distance_m(here_m), outwards(burr, here_m))
                    };
                    let share = 0.5 - distance_m / ramp_m;
                    if share <= 0.0 {
                        continue;
                    }
                    if share < 1.0 {
                        weight = solid * share;
                        sums.slope -= outwards * (solid / ramp_m);
                    }
                }
                sums.volume += weight;
                sums.moment += here * weight;
                sums.hardness += brick.hardness[usize::from(label)] * weight;
                if label == leading {
                    lead += weight;
                } else if weight > lead {
                    (leading, lead) = (label, weight - lead);
                } else {
                    lead -= weight;
                }
            }
        }
    }
    sums.label = leading;
    sums
}

/// The direction in which the distance from a burr grows.
fn outwards(burr: &Burr, at_m: Vec3) -> Vec3 {
    let h = burr.diameter_m * 1e-3;
    let along = |step: Vec3| burr.signed_distance_m(at_m + step) - burr.signed_distance_m(at_m - step);
    Vec3::new(along(Vec3::X * h), along(Vec3::Y * h), along(Vec3::Z * h)).normalize_or_zero()
}

/// The depth of a burr with so much bone in it.
fn depth_m(burr: &Burr, volume_m3: f64, area_m2: f64) -> f64 {
    let radius_m = f64::from(burr.diameter_m) * 0.5;
    match burr.shape {
        BurrShape::Sphere => cap_height_m(volume_m3, radius_m),
        // On its flank a cylinder covers two thirds of depth times area.
        _ => (1.5 * volume_m3 / area_m2.max(1e-12)).min(radius_m),
    }
}

/// The height of the cap of a ball with a volume: `V = pi h^2 (3 R - h) / 3`.
fn cap_height_m(volume_m3: f64, radius_m: f64) -> f64 {
    // In shares of the radius: 3 h^2 - h^3 = v, by the cosine of a third of an angle.
    let v = (3.0 * volume_m3 / (std::f64::consts::PI * radius_m.powi(3))).clamp(0.0, 4.0);
    let angle = (1.0 - 0.5 * v).clamp(-1.0, 1.0).acos();
    radius_m * (1.0 - 2.0 * ((angle + std::f64::consts::PI) / 3.0).cos()).clamp(0.0, 2.0)
}
