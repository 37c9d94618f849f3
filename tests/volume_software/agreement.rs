//! Ray casting and slices give the same picture.

use super::*;
use crate::support::real_file;
use bevy_surgery::volume::WetShading;
use bevy_surgery::volume::blocks::{BlockDistances, BlockRanges};
use bevy_surgery::volume::load::{VolumeLoadOptions, load_path};
use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::software::{IncidentLight, composite_slices, march, shade};
use bevy_surgery::volume::transfer::{ColourSource, TransferFunction, colours};

/// Least likeness of the pictures, decibels.
const LEAST_PSNR: f32 = 35.0;

/// Likeness of two pictures as they are shown (sRGB), decibels; among the pixels that either shows.
fn psnr(a: &[[f32; 4]], b: &[[f32; 4]]) -> f32 {
    let shown = |linear: f32| {
        let linear = linear.clamp(0.0, 1.0);
        if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
    };
    let covered = a.iter().zip(b).filter(|(a, b)| a[3] > 0.0 || b[3] > 0.0);
    let squares: Vec<f32> = covered
        .flat_map(|(a, b)| std::array::from_fn::<f32, 3, _>(|channel| (shown(a[channel]) - shown(b[channel])).powi(2)))
        .collect();
    assert!(squares.len() > 3 * 4_000, "the volume fills the picture");
    -10.0 * (squares.iter().sum::<f32>() / squares.len() as f32).log10()
}

/// Draws a volume both ways from some sides, lit and unlit.
fn compare(name: &str, volume: &Volume, transfer: &TransferFunction) {
    let half = volume.grid().half_axes_m().into_iter().map(|half| half.length_squared()).sum::<f32>().sqrt();
    let step_m = volume.grid().spacing_mm().min_element() as f32 * 1e-3;
    let table = transfer.bake(volume.range(), step_m.into());
    let distances = BlockDistances::new(&BlockRanges::new(volume), table.entries());
    let mut field = RenderField::new(volume);
    if transfer.colour_source == ColourSource::Voxels {
        field =
            field.with_colours(colours(volume, volume.structures().map(AsRef::as_ref))).expect("one for each voxel");
    }
    let size_px = UVec2::new(160, 120);
    for (side, direction) in [Vec3::Z, Vec3::new(0.8, 0.5, 0.6), Vec3::new(-0.7, -0.2, 0.4)].into_iter().enumerate() {
        let eye = direction.normalize() * half * 2.0;
        let rays = rays_from(volume, size_px, perspective(size_px, 1.0), eye, Vec3::ZERO);
        let plain = MarchScene { step_m, ..scene(&field, table.entries()) };
        let cast = march(&rays, &MarchScene { distances: Some(&distances), ..plain });
        let sliced = composite_slices(&rays, &plain);
        let lamp = eye + Vec3::new(0.05, 0.1, 0.0);
        let lit = |image: &VolumeImage| {
            shade(image, &rays, &WetShading::default(), Vec3::splat(0.02), |world, lights| {
                let to_light = (lamp - world).normalize();
                lights.push(IncidentLight { to_light, illuminance_lux: Vec3::splat(2.8), ambient_fraction: 0.05 });
            })
        };
        let (unlit, lit) = (psnr(&cast.colour, &sliced.colour), psnr(&lit(&cast), &lit(&sliced)));
        println!("{name}, side {side}: {unlit:.1} dB unlit, {lit:.1} dB lit");
        assert!(unlit > LEAST_PSNR && lit > LEAST_PSNR, "{name}, side {side}: {unlit} dB unlit, {lit} dB lit");
    }
}

#[test]
fn the_phantom_looks_the_same_as_rays_and_as_slices() {
    let volume = phantom(&PhantomOptions { size: 96, ..PhantomOptions::default() }).expect("a phantom");
    compare("phantom", &volume, &TransferFunction::bone());
    compare("phantom's structures", &volume, &TransferFunction::structures());
}

#[test]
fn a_head_looks_the_same_as_rays_and_as_slices() {
    let Some(path) = real_file("ct/head.nii.gz") else { return };
    let (volume, _) = load_path(&path, &VolumeLoadOptions::default()).expect("a real head loads");
    compare("head", &volume, &TransferFunction::for_volume(&volume));
}

#[test]
fn a_temporal_bone_looks_the_same_as_rays_and_as_slices() {
    let Some(path) = real_file("ct/temporal-bone-png") else { return };
    let options =
        VolumeLoadOptions { spacing_mm: Some([49.2 / 256.0, 49.2 / 256.0, 48.5 / 252.0]), ..Default::default() };
    let (volume, _) = load_path(&path, &options).expect("a real bone loads");
    compare("temporal bone", &volume, &TransferFunction::for_volume(&volume));
}
