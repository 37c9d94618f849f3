//! A volume that gives way.

use crate::deform::elastic::ElasticTissue;
use crate::volume::phantom::PhantomOptions;
use crate::volume::{MakePhantom, SoftVolume};
use bevy::prelude::*;
#[cfg(feature = "render")]
use bevy::{camera::PerspectiveProjection, core_pipeline::tonemapping::Tonemapping};

/// The phantom that ships with the crate as if it were muscle, grown on at its back: pressed and held by instruments, it gives way.
/// With the feature `render` a camera looks at it.
///
/// Its entity is the [`soft_volume`]; camera and light are children. What is patched is patched on the volume.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_surgery::prelude::*;
/// # use bevy_surgery::testing::TestApp;
///
/// fn setup(mut commands: Commands) {
///     commands.spawn_scene(bsn! {
///         soft_volume_scene()
///         // Coarser, of fat, and it swims.
///         SoftVolume { level: 2, tissue: {Some(ElasticTissue::FAT)} }
///         MakePhantom(PhantomOptions { size: 32 })
///         LatticeAnimation { speed: 0.5 }
///     });
/// }
/// # let mut app = TestApp::cpu();
/// # app.add_systems(Startup, setup).finish();
/// # app.update();
/// # let mut volumes = app.world_mut().query::<(&SoftVolume, &MakePhantom, &LatticeAnimation)>();
/// # let (soft, phantom, animation) = volumes.single(app.world())?;
/// # assert_eq!((soft.level, soft.tissue, phantom.0.size), (2, Some(ElasticTissue::FAT), 32));
/// # assert_eq!((soft.held_share, animation.speed), (SoftVolume::default().held_share, 0.5));
/// # Ok::<(), bevy::ecs::error::BevyError>(())
/// ```
pub fn soft_volume_scene() -> impl Scene {
    bsn! {
        soft_volume()
        Children [{view()}]
    }
}

#[cfg(feature = "render")]
fn view() -> impl SceneList {
    bsn_list![
        soft_volume_camera(),
        (
            #Sun
            DirectionalLight { illuminance: 6000.0 }
            template_value(Transform::default().looking_to(Vec3::new(-0.5, -0.6, -1.0), Vec3::Y))
        ),
    ]
}

#[cfg(not(feature = "render"))]
fn view() -> impl SceneList {
    bsn_list![]
}

/// The phantom as if it were muscle, in cells of 6 mm.
pub fn soft_volume() -> impl Scene {
    bsn! {
        #SoftVolume
        MakePhantom(PhantomOptions { size: 128 })
        SoftVolume { tissue: {Some(ElasticTissue::MUSCLE)} }
    }
}

/// A camera that sees all of the phantom.
#[cfg(feature = "render")]
pub fn soft_volume_camera() -> impl Scene {
    // Half the diagonal of the phantom's cube.
    let radius_m = 0.024 * 3_f32.sqrt();
    let from_m = Vec3::new(0.45, 0.35, 1.0).normalize() * (2.2 * radius_m);
    // Some centimetres are looked at, and Bevy's nearest distance is ten of them.
    let lens = PerspectiveProjection { near: 0.01 * radius_m, far: 100.0 * radius_m, fov: 0.7, ..default() };
    bsn! {
        #Camera
        Camera3d
        template_value(Msaa::Off)
        // Needs no lookup texture.
        template_value(Tonemapping::SomewhatBoringDisplayTransform)
        template_value(Projection::Perspective(lens))
        template_value(Transform::from_translation(from_m).looking_at(Vec3::ZERO, Vec3::Y))
    }
}
