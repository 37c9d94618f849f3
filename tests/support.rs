//! What several tests use.

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse};
use bevy_surgery::organ::pick::OrganPicker;
use bevy_surgery::organ::texture_mesh::TextureMeshOptions;
use bevy_surgery::organ::{OrganModel, OrganOptions, SurfaceMesh, procedural_ellipsoid};
use bevy_surgery::prelude::*;
use bevy_surgery::skin::TileSource;
use bevy_surgery::skin::tiles::{ColourRamp, TileDetail, TileOptions};
use bevy_surgery::testing::TestApp;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A file of the real data beside the project; prints a line and returns `None` where it is not there.
pub fn real_file(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {name} is not here");
    None
}

/// A real organ scaled to 20 cm.
pub fn real_mesh(name: &str) -> Option<SurfaceMesh> {
    let bytes = std::fs::read(real_file(&format!("mesh/{name}"))?).expect("a listed file can be read");
    let options = LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..default() };
    Some(parse(&bytes, name, &options).expect("a real organ loads"))
}

/// A sphere about the origin: an icosahedron whose edges are halved `levels` times.
pub fn sphere_mesh(radius_m: f32, levels: u32) -> SurfaceMesh {
    procedural_ellipsoid(Vec3::splat(radius_m), 1 << levels)
}

/// A spherical organ of 1,442 vertices.
pub fn sphere_organ(radius_m: f32) -> OrganModel {
    let texture_mesh = TextureMeshOptions { iterations: 5, tile_sweeps: 2, ..default() };
    let options = OrganOptions { texture_mesh, table_width_px: 64, ..default() };
    OrganModel::from_mesh(procedural_ellipsoid(Vec3::splat(radius_m), 12), "sphere", &options)
        .expect("a sphere is an organ")
}

/// A skin of one colour that only Lambert's law shades.
pub fn plain_skin(srgb: [u8; 3]) -> Skin {
    let tiles = TileOptions {
        resolution_px: 64,
        cells_per_edge: 4.0,
        ramp: ColourRamp::from_srgb8(&[(0.0, srgb), (1.0, srgb)]),
        cell_jitter: 0.0,
        detail: TileDetail { relief: 0.0, net: 0.0, ..default() },
        ..default()
    };
    let tiles = TileSource::Generated(tiles);
    Skin { tiles, mottle: 0.0, scatter: 0.0, sheen: 0.0, relief_m: 0.0, tint: Color::WHITE, ..Skin::liver() }
}

/// The place of an organ that is seen from a direction, looking at the origin.
pub fn place_towards(app: &TestApp, organ: Entity, direction: DVec3) -> SurfacePoint {
    let handle = app.world().get::<Organ>(organ).expect("an organ").0.clone();
    let model = app.world().resource::<Assets<OrganModel>>().get(&handle).expect("it is loaded");
    let picker = OrganPicker::build(&model.mesh.triangles, &model.mesh.positions_m);
    picker.cast_ray(direction.normalize(), -direction, 2.0).expect("the ray goes through the middle").point
}

/// Warnings so far that mention a text; the first call begins to listen, so make it early or expect only what follows.
pub fn told(about: &str) -> Vec<String> {
    let listener = LISTENER.get_or_init(Listener::begin);
    let told = listener.lock().unwrap_or_else(PoisonError::into_inner);
    told.iter().filter(|text| text.contains(about)).cloned().collect()
}

static LISTENER: OnceLock<Arc<Mutex<Vec<String>>>> = OnceLock::new();

/// Collects the messages of warnings.
struct Listener(Arc<Mutex<Vec<String>>>);

impl Listener {
    fn begin() -> Arc<Mutex<Vec<String>>> {
        let told: Arc<Mutex<Vec<String>>> = Arc::default();
        tracing::subscriber::set_global_default(Self(told.clone())).expect("nobody else listens in these tests");
        told
    }
}

impl tracing::Subscriber for Listener {
    fn enabled(&self, metadata: &tracing::Metadata<'_>) -> bool {
        *metadata.level() <= tracing::Level::WARN && metadata.is_event()
    }

    fn new_span(&self, _: &tracing::span::Attributes<'_>) -> tracing::span::Id {
        tracing::span::Id::from_u64(1)
    }

    fn record(&self, _: &tracing::span::Id, _: &tracing::span::Record<'_>) {}

    fn record_follows_from(&self, _: &tracing::span::Id, _: &tracing::span::Id) {}

    fn event(&self, event: &tracing::Event<'_>) {
        struct Text(String);
        impl tracing::field::Visit for Text {
            fn record_debug(&mut self, field: &tracing::field::Field, value: &dyn std::fmt::Debug) {
                if field.name() == "message" {
                    self.0 = format!("{value:?}");
                }
            }
        }
        let mut text = Text(String::new());
        event.record(&mut text);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(text.0);
    }

    fn enter(&self, _: &tracing::span::Id) {}

    fn exit(&self, _: &tracing::span::Id) {}
}
