//! The part of the harness that draws.

use super::TestApp;
use crate::SurgeryPlugins;
use crate::organ::{Organ, OrganModel, OrganShape, awaited_models};
use crate::skin::SkinTileLibrary;
use bevy::app::PluginGroupBuilder;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::render::error_handler::{RenderErrorHandler, RenderErrorPolicy};
use bevy::render::render_resource::{
    CachedPipelineState, PipelineCache, PipelineDescriptor, PollType, TextureFormat, TextureUsages,
};
use bevy::render::renderer::RenderDevice;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::render::{RenderApp, RenderPlugin};
use bevy::window::ExitCondition;
use image::RgbaImage;
use std::sync::{Arc, Mutex};

/// The picture that a [`TestApp`] draws into.
#[derive(Clone, Debug)]
pub struct GpuTarget {
    /// The image; spawn cameras with `RenderTarget::Image(target.image.clone().into())`.
    pub image: Handle<Image>,
    /// Width and height in pixels.
    pub size_px: UVec2,
}

/// Bevy's plugins for drawing without a window: what `DefaultPlugins` has, less the window, the log and the second
/// render thread (so that the render world can be looked into).
pub fn headless_render_plugins() -> PluginGroupBuilder {
    PluginGroupBuilder::start::<HeadlessRenderPlugins>()
        .add(bevy::app::TaskPoolPlugin::default())
        .add(bevy::diagnostic::FrameCountPlugin)
        .add(bevy::time::TimePlugin)
        .add(bevy::transform::TransformPlugin)
        .add(bevy::diagnostic::DiagnosticsPlugin)
        .add(bevy::input::InputPlugin)
        .add(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .add(super::assets())
        // Pipelines are compiled where they are asked for, so that no frame is drawn without them.
        .add(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
        .add(ImagePlugin::default())
        .add(bevy::mesh::MeshPlugin)
        .add(bevy::camera::CameraPlugin)
        .add(bevy::light::LightPlugin)
        // Bevy's materials draw lights with them, where Bevy was built with all that it has.
        .add(bevy::gizmos::GizmoPlugin)
        .add(bevy::core_pipeline::CorePipelinePlugin)
}

/// Names the group that [`headless_render_plugins`] builds.
struct HeadlessRenderPlugins;

impl bevy::app::PluginGroup for HeadlessRenderPlugins {
    fn build(self) -> PluginGroupBuilder {
        headless_render_plugins()
    }
}

impl TestApp {
    /// Draws into an image of this size, without a window.
    ///
    /// # Panics
    /// Where the machine has no graphics adapter, hardware or software.
    pub fn gpu(width_px: u32, height_px: u32) -> Self {
        Self::gpu_with(width_px, height_px, |_| {})
    }

    /// Like [`TestApp::gpu`] with more plugins, added before [`SurgeryPlugins`]: Bevy's `PbrPlugin`, your game's own.
    pub fn gpu_with(width_px: u32, height_px: u32, add_plugins: impl FnOnce(&mut App)) -> Self {
        assert!(
            !crate::render::graphics_adapters().is_empty(),
            "no Vulkan, Metal or DirectX adapter: install a driver (Debian: mesa-vulkan-drivers draws in software)"
        );
        let mut app = App::new();
        app.add_plugins(headless_render_plugins());
        add_plugins(&mut app);
        app.add_plugins(SurgeryPlugins);
        app.insert_resource(RenderErrorHandler(|error, _, _| -> RenderErrorPolicy {
            panic!("render error {:?}: {}", error.ty, error.description)
        }));
        let mut image = Image::new_target_texture(width_px, height_px, TextureFormat::Rgba8UnormSrgb, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let mut test = Self::around(app);
        test.target = Some(GpuTarget { image, size_px: UVec2::new(width_px, height_px) });
        test
    }

    /// The picture that this app draws into.
    ///
    /// # Panics
    /// In an app made by [`TestApp::cpu`].
    pub fn target(&self) -> GpuTarget {
        self.target.clone().expect("an app made by TestApp::cpu draws nothing")
    }

    /// Spawns a plain camera that draws into [`TestApp::target`]: no tonemapping, so that colours are what shaders
    /// wrote, and one sample per pixel.
    pub fn spawn_camera(&mut self, transform: Transform) -> Entity {
        let target = RenderTarget::Image(self.target().image.into());
        self.world_mut().spawn((Camera3d::default(), target, Tonemapping::None, Msaa::Off, transform)).id()
    }

    /// Updates without stepping until every organ, skin and pipeline is there.
    ///
    /// # Panics
    /// When a pipeline fails, an organ's file or a skin's tiles cannot be used, or it takes longer than five minutes.
    pub fn warm_up(&mut self) {
        let mut quiet = 0;
        self.idle_until("organs, skins and pipelines", |app| {
            // Assets reach the render world an update later, and pipelines are asked for an update after that.
            quiet = if is_busy(app) { 0 } else { quiet + 1 };
            quiet > 3
        });
    }

    /// The picture as it is now; warms up first, and no time passes.
    ///
    /// # Panics
    /// Where every pixel is black: then nothing was drawn, and whatever a test checks next would be worth nothing.
    pub fn capture(&mut self) -> RgbaImage {
        let picture = self.capture_even_if_black();
        let is_black = picture.pixels().all(|pixel| pixel.0[..3] == [0, 0, 0]);
        assert!(!is_black, "the picture is black: is there a camera on the target, a light, something in view?");
        picture
    }

    /// Like [`TestApp::capture`] where black is a possible answer.
    pub fn capture_even_if_black(&mut self) -> RgbaImage {
        self.warm_up();
        self.capture_next_frame()
    }

    /// The picture of the next frame, whatever is there yet: where something else warmed the app up.
    pub fn capture_next_frame(&mut self) -> RgbaImage {
        let target = self.target();
        let taken: Arc<Mutex<Option<Vec<u8>>>> = default();
        let slot = taken.clone();
        self.world_mut().spawn(Screenshot::image(target.image)).observe(move |shot: On<ScreenshotCaptured>| {
            *slot.lock().expect("only this closure locks it") = shot.image.data.clone();
        });
        let mut pixels = None;
        self.idle_until("a screenshot", |_| {
            pixels = taken.lock().expect("only the observer locks it").take();
            pixels.is_some()
        });
        RgbaImage::from_raw(target.size_px.x, target.size_px.y, pixels.unwrap_or_default())
            .expect("the screenshot has the target's size")
    }
}

fn is_busy(app: &mut App) -> bool {
    if let Some(library) = app.world().get_resource::<SkinTileLibrary>() {
        if let Some(error) = library.failures().next() {
            panic!("the tiles of a skin could not be made: {error}");
        }
        if library.is_busy() {
            return true;
        }
    }
    let mut organs = app.world_mut().query::<(&Organ, Option<&OrganShape>)>();
    let waiting = awaited_models(app.world().resource::<Assets<OrganModel>>(), organs.iter(app.world()));
    let assets = app.world().resource::<AssetServer>();
    for model in &waiting {
        if let bevy::asset::LoadState::Failed(error) = assets.load_state(model) {
            panic!("an organ could not be loaded: {error}");
        }
    }
    !waiting.is_empty() || pipelines(app).any(|(_, state)| !matches!(state, CachedPipelineState::Ok(_)))
}

fn pipelines(app: &App) -> impl Iterator<Item = (String, &CachedPipelineState)> {
    let cache = app.get_sub_app(RenderApp).and_then(|render| render.world().get_resource::<PipelineCache>());
    cache.into_iter().flat_map(PipelineCache::pipelines).map(|pipeline| {
        let label = match &pipeline.descriptor {
            PipelineDescriptor::RenderPipelineDescriptor(descriptor) => descriptor.label.as_ref(),
            PipelineDescriptor::ComputePipelineDescriptor(descriptor) => descriptor.label.as_ref(),
        };
        (label.map_or_else(|| "unnamed".into(), ToString::to_string), &pipeline.state)
    })
}

/// Waits for the GPU, and turns what Bevy only logs into a panic.
pub(super) fn check(app: &mut App) {
    app.world().resource::<RenderDevice>().poll(PollType::wait_indefinitely()).expect("the device answers");
    for (label, state) in pipelines(app) {
        if let CachedPipelineState::Err(error) = state {
            // A shader that is not there yet is no error; one that does not compile is.
            let is_waiting = matches!(
                error,
                bevy::shader::ShaderCacheError::ShaderNotLoaded(_)
                    | bevy::shader::ShaderCacheError::ShaderImportNotYetAvailable
            );
            assert!(is_waiting, "pipeline {label} failed: {error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::organ::{OrganOptions, procedural_ellipsoid};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    fn sphere(radius_m: f32) -> OrganModel {
        let options = OrganOptions { table_width_px: 64, ..default() };
        OrganModel::from_mesh(procedural_ellipsoid(Vec3::splat(radius_m), 4), "sphere", &options).expect("an organ")
    }

    /// An organ that has its shape.
    fn shaped() -> (TestApp, Entity) {
        let mut app = TestApp::gpu(16, 16);
        let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere(0.1));
        let entity = app.world_mut().spawn(Organ(organ)).id();
        app.warm_up();
        (app, entity)
    }

    #[test]
    fn an_exchanged_model_is_waited_for() {
        let (mut app, entity) = shaped();
        assert!(!is_busy(&mut app));
        let next = app.world_mut().resource_mut::<Assets<OrganModel>>().reserve_handle();
        app.world_mut().entity_mut(entity).insert(Organ(next.clone()));
        app.idle();
        assert!(is_busy(&mut app), "the organ still has its old shape");
        let arrived = app.world_mut().resource_mut::<Assets<OrganModel>>().insert(next.id(), sphere(0.2));
        arrived.expect("its place is there");
        app.warm_up();
        let shape = app.world().get::<OrganShape>(entity).expect("a shaped organ");
        assert!((shape.positions_m()[0].length() - 0.2).abs() < 1e-6);
    }

    #[test]
    fn an_exchanged_model_that_cannot_load_fails() {
        let (mut app, entity) = shaped();
        let missing = app.world().resource::<AssetServer>().load("no-such-organ.obj");
        app.world_mut().entity_mut(entity).insert(Organ(missing));
        let reason = catch_unwind(AssertUnwindSafe(|| app.warm_up())).expect_err("there is no such file");
        let reason = reason.downcast_ref::<String>().map_or("", String::as_str);
        assert!(reason.contains("no-such-organ.obj"), "{reason}");
    }
}
