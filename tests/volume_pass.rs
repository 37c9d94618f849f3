//! Volumes on the GPU, held against their twin on the CPU, and beside the rest of a scene.

mod aligned;
mod deformed;
mod faults;
mod likeness;
mod methods;
mod redraw;
mod scene;
mod stage;
mod twin;
mod wet;

use bevy::math::{DVec3, UVec3, Vec3};
use bevy_surgery::volume::structures::{Structure, Structures, Tissue};
use bevy_surgery::volume::transfer::{ColourSource, ControlPoint, TransferFunction, ValueScale};
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};

/// Voxels of the specimen.
const SIZE: UVec3 = UVec3::new(40, 32, 24);

/// Share of filling of something without any symmetry: a ball, and a rod beside it.
fn specimen(voxel: Vec3) -> f32 {
    let ball = 0.5 + (8.0 - voxel.distance(Vec3::new(13.0, 12.0, 11.0))) / 4.0;
    let on_axis = Vec3::new(voxel.x.clamp(12.0, 35.0), 22.0, 15.0);
    let rod = 0.5 + (3.5 - voxel.distance(on_axis)) / 4.0;
    ball.max(0.7 * rod).clamp(0.0, 1.0)
}

fn voxels_of(size: UVec3) -> impl Iterator<Item = Vec3> {
    let rows = (0..size.z).flat_map(move |z| (0..size.y).map(move |y| (y, z)));
    rows.flat_map(move |(y, z)| (0..size.x).map(move |x| UVec3::new(x, y, z).as_vec3()))
}

/// A volume of 8-bit shares of 255.
fn volume_of(size: UVec3, spacing_mm: DVec3, share: impl Fn(Vec3) -> f32) -> Volume {
    let voxels = voxels_of(size).map(|voxel| (share(voxel).clamp(0.0, 1.0) * 255.0).round() as u8).collect();
    Volume::new(VolumeGrid::upright(size, spacing_mm), Voxels::U8(voxels), 1.0, 0.0).expect("a good volume")
}

/// A white ball in the middle of 48^3 voxels of 1 mm.
fn ball(radius_voxels: f32) -> Volume {
    volume_of(UVec3::splat(48), DVec3::ONE, |voxel| 0.5 + (radius_voxels - voxel.distance(Vec3::splat(23.5))) / 2.0)
}

fn points(list: &[(f64, [u8; 3], f32)]) -> TransferFunction {
    TransferFunction {
        points: list.iter().map(|&(value, colour, opacity)| ControlPoint { value, colour, opacity }).collect(),
        scale: ValueScale::ShareOfRange,
        reference_length_m: 1e-3,
        colour_source: ColourSource::Points,
    }
}

/// A veil around something solid, in colours that depend on the value.
fn veil() -> TransferFunction {
    points(&[(0.15, [40, 60, 220], 0.0), (0.4, [220, 120, 60], 0.12), (0.75, [250, 220, 190], 0.8)])
}

/// One colour, opaque where the value is above a half.
fn solid(colour: [u8; 3]) -> TransferFunction {
    TransferFunction { reference_length_m: 0.1e-3, ..points(&[(0.45, colour, 0.0), (0.55, colour, 0.99)]) }
}

/// One structure that fills a volume, so that burrs find something.
fn one_structure(volume: &Volume) -> Structures {
    let structure = Structure {
        name: "bone".into(),
        colour: [230, 220, 200],
        tissue: Tissue::CorticalBone,
        hardness: 1.0,
        bleeding_ml_per_s_mm3: 0.0,
        is_critical: false,
    };
    let count = volume.grid().count();
    Structures::new(vec![structure], vec![1; count], vec![255; count]).expect("as many as there are voxels")
}
