//! The scan that volumes are timed with, and where it is seen from.

use bevy::math::DVec3;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::load::load_path;

/// The head as the peers have it: `side^3` voxels of 8 bits over 64 mm, as fine at 256^3 as a scan of a temporal bone, with the
/// transfer function of `../shared/peers/b_volume_vtk.py`. Where the scan is not at hand, the phantom.
pub fn head(side: u32) -> (Volume, TransferFunction) {
    real_head(side).unwrap_or_else(|| {
        let volume = phantom(&PhantomOptions { size: side, ..default() }).expect("the crate's own phantom");
        let transfer = TransferFunction::for_volume(&volume);
        (volume, transfer)
    })
}

fn real_head(side: u32) -> Option<(Volume, TransferFunction)> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/ct/head.nii.gz");
    let (head, _) = load_path(path, &default()).ok()?;
    let from = head.grid().size;
    let grid = VolumeGrid::upright(UVec3::splat(side), DVec3::splat(64.0 / f64::from(side)));
    let mut voxels = vec![0_u8; grid.count()];
    for (place, voxel) in voxels.iter_mut().enumerate() {
        let place = place as u32;
        let to = UVec3::new(place % side, place / side % side, place / side / side).as_vec3();
        let at = to * (from.as_vec3() - 1.0) / (side - 1) as f32;
        let low = at.floor().min(from.as_vec3() - 2.0);
        let share = at - low;
        let mut sum = 0.0;
        for corner in 0..8 {
            let side = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let weight = |axis: usize| if side[axis] == 1 { share[axis] } else { 1.0 - share[axis] };
            sum += head.voxels().stored(head.grid().index(low.as_uvec3() + side)) as f32
                * weight(0)
                * weight(1)
                * weight(2);
        }
        *voxel = sum as u8;
    }
    let point = |value: f64, opacity, colour| ControlPoint { value, colour, opacity };
    let transfer = TransferFunction {
        points: vec![
            point(0.0, 0.0, [0, 0, 0]),
            point(40.0, 0.0, [136, 85, 68]),
            point(60.0, 0.03, [204, 128, 102]),
            point(100.0, 0.05, [229, 187, 166]),
            point(120.0, 0.5, [242, 230, 204]),
            point(255.0, 0.9, [255, 255, 255]),
        ],
        reference_length_m: 0.25e-3,
        ..TransferFunction::window(0.5, 1.0)
    };
    let volume = Volume::new(grid, Voxels::U8(voxels), 1.0, 0.0).ok()?;
    let structures = Structures::for_volume(&volume).ok()?;
    Some((volume.with_structures(structures).ok()?, transfer))
}

/// An app of some pixels with a camera and a lamp for a volume whose half side is `extent_m`. The camera is the peers': it sees
/// the whole box, comes from below, and is then zoomed in.
pub fn stage(extent_m: f32, size_px: UVec2) -> (TestApp, Entity) {
    let mut app = TestApp::gpu_with(size_px.x, size_px.y, |app| {
        app.add_plugins(PbrPlugin::default());
    });
    let eye = towards_eye() * (3_f32.sqrt() * extent_m / 15_f32.to_radians().sin());
    let camera = app.spawn_camera(Transform::from_translation(eye).looking_at(Vec3::ZERO, Vec3::Z));
    let lens = PerspectiveProjection { fov: 20_f32.to_radians(), ..default() };
    let lamp = ScopeLight { intensity_cd: 4e5 * extent_m * extent_m, ..default() };
    app.world_mut().entity_mut(camera).insert((Projection::Perspective(lens), lamp));
    (app, camera)
}

/// Direction in which the eye lies in the beginning.
pub fn towards_eye() -> Vec3 {
    let (sin, cos) = 70_f32.to_radians().sin_cos();
    Vec3::new(0.0, -sin, cos)
}
