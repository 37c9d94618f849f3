//! Slices and rays give the same picture.

use super::stage::{Shot, Stage, drill};
use crate::support::real_file;
use bevy::prelude::*;
use bevy_surgery::volume::load::{VolumeLoadOptions, load_path};
use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::structures::Structures;
use bevy_surgery::volume::transfer::TransferFunction;
use bevy_surgery::volume::{Volume, VolumeMethod};

/// Least likeness of the pictures, decibels.
pub const LEAST_PSNR: f32 = 35.0;

/// Where the hole is drilled, from the middle.
const HOLE: Vec3 = Vec3::new(0.5, 0.4, 1.0);

/// Likeness of two pictures as they are shown (sRGB), decibels; among the pixels that either shows.
pub fn psnr(a: &Shot, b: &Shot) -> f32 {
    let shown = |linear: f32| {
        let linear = linear.clamp(0.0, 1.0);
        if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
    };
    let covered = a.colour.iter().zip(&b.colour).filter(|(a, b)| a[3] > 0.0 || b[3] > 0.0);
    let squares: Vec<f32> = covered
        .flat_map(|(a, b)| std::array::from_fn::<f32, 3, _>(|channel| (shown(a[channel]) - shown(b[channel])).powi(2)))
        .collect();
    assert!(squares.len() > 3 * 1_500, "the volume fills the picture, not {} values", squares.len());
    -10.0 * (squares.iter().sum::<f32>() / squares.len() as f32).log10()
}

/// Draws a volume both ways from some sides, whole and drilled.
fn compare(name: &str, volume: Volume, transfer: &TransferFunction, structures: &Structures) {
    let half = volume.grid().half_axes_m().into_iter().map(|half| half.length_squared()).sum::<f32>().sqrt();
    // As large as the others, so that the lamps suit it.
    let scale = 0.035 / half;
    let mut stage = Stage::new(volume, transfer.clone());
    let entity = stage.volume;
    stage.set(entity, Transform::from_scale(Vec3::splat(scale)));
    stage.app.warm_up();
    for is_drilled in [false, true] {
        if is_drilled {
            let source = stage.source();
            drill(&mut stage.cut(), &source, structures, HOLE.normalize() * 0.9 * half, Vec3::ZERO, 6e-3);
        }
        for direction in [Vec3::new(0.2, 0.3, 0.9), Vec3::new(0.8, 0.5, 0.6), Vec3::new(-0.7, -0.2, 0.4)] {
            stage.aim(direction.normalize() * 0.12, Vec3::ZERO);
            let [rays, slices] = [VolumeMethod::Rays, VolumeMethod::Slices].map(|method| {
                stage.look().method = method;
                stage.shot()
            });
            let likeness = psnr(&rays, &slices);
            println!("{name}, drilled: {is_drilled}, from {direction}: {likeness:.1} dB");
            assert!(likeness > LEAST_PSNR, "{name}, drilled: {is_drilled}, from {direction}: {likeness} dB");
        }
    }
    // The hole is there.
    stage.aim(HOLE.normalize() * 0.12, Vec3::ZERO);
    let drilled = stage.shot();
    stage.cut().reset();
    let whole = stage.shot();
    let is_far = |(a, b): &(&[f32; 4], &[f32; 4])| (0..3).any(|channel| (a[channel] - b[channel]).abs() > 0.04);
    let differing = drilled.colour.iter().zip(&whole.colour).filter(is_far).count();
    assert!(differing > 2, "the hole in {name} is hardly seen: {differing} pixels");
}

#[test]
fn the_phantom_looks_the_same_as_rays_and_as_slices() {
    let volume = phantom(&PhantomOptions { size: 96, ..default() }).expect("a phantom");
    let structures = volume.structures().expect("it has them").as_ref().clone();
    compare("phantom", volume.clone(), &TransferFunction::bone(), &structures);
    compare("phantom's structures", volume, &TransferFunction::structures(), &structures);
}

#[test]
fn a_head_looks_the_same_as_rays_and_as_slices() {
    let Some(path) = real_file("ct/head.nii.gz") else { return };
    let (volume, _) = load_path(&path, &VolumeLoadOptions::default()).expect("a real head loads");
    let structures = super::one_structure(&volume);
    let transfer = TransferFunction::for_volume(&volume);
    compare("head", volume, &transfer, &structures);
}

#[test]
fn a_temporal_bone_looks_the_same_as_rays_and_as_slices() {
    let Some(path) = real_file("ct/temporal-bone-png") else { return };
    let spacing_mm = Some([49.2 / 256.0, 49.2 / 256.0, 48.5 / 252.0]);
    let (volume, _) = load_path(&path, &VolumeLoadOptions { spacing_mm, ..default() }).expect("a real bone loads");
    let structures = super::one_structure(&volume);
    let transfer = TransferFunction::for_volume(&volume);
    compare("temporal bone", volume, &transfer, &structures);
}
