//! Painting sprites: 300 soft ellipses of about 24 x 16 texels into a map of 1024 x 1024, beside tiny-skia; and finding
//! the texels of a disk on the liver.
//!
//! All ways paint the same ellipses, one after another over what is there. This crate's also writes the gloss plane, and
//! finds each ellipse's texels anew in the measured time, as the others do.
//!
//! Floor: the ellipses hold some 365,000 texels of 5 bytes, read and written: 3.7 MB.

use bevy_surgery::organ::atlas::Atlas;
use bevy_surgery::organ::chart::{self, ChartOptions};
use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse};
use bevy_surgery::organ::sphere::SurfacePoint;
use bevy_surgery::organ::surface::Surface;
use bevy_surgery::reactions::footprint::Footprint;
use bevy_surgery::reactions::paint::{Profile, ReactionMap, Stroke, paint};
use bevy_surgery::reactions::texels::{MapSize, TileMask};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, Mat2, Vec2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::hint::black_box;
use std::time::Instant;
use tiny_skia::{
    BlendMode, Color, FillRule, FilterQuality, GradientStop, Paint, PathBuilder, Pixmap, PixmapPaint, Point,
    PremultipliedColorU8, RadialGradient, SpreadMode, Transform,
};

const SIDE_PX: u32 = 1024;
const ELLIPSES: usize = 300;
/// Larger semi-axis, texels, and the smaller one's share of it.
const SEMI_AXIS_PX: f32 = 24.0;
const ASPECT: f32 = 0.66;

struct Ellipse {
    centre_px: Vec2,
    angle: f32,
    scale: f32,
}

/// The same numbers as in `painting_numba.py`.
fn ellipses() -> Vec<Ellipse> {
    let mut state = 7u64;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    (0..ELLIPSES)
        .map(|_| {
            let centre_px = Vec2::new(next(), next()) * (SIDE_PX as f32 - 120.0) + 60.0;
            Ellipse { centre_px, angle: next() * std::f32::consts::PI, scale: 0.8 + 0.4 * next() }
        })
        .collect()
}

fn opacity(r_squared: f32) -> f32 {
    (1.0 - r_squared).powi(2) * 0.5
}

fn footprints(size: MapSize, ellipses: &[Ellipse]) -> Vec<Footprint> {
    let footprint = |ellipse: &Ellipse| {
        let semi_axes_px = ellipse.scale * SEMI_AXIS_PX * Vec2::new(1.0, ASPECT);
        let jacobian = Mat2::from_diagonal(semi_axes_px.recip()) * Mat2::from_angle(-ellipse.angle);
        Footprint::ellipse(size, ellipse.centre_px, jacobian).expect("an ellipse")
    };
    ellipses.iter().map(footprint).collect()
}

fn ours(c: &mut Criterion) {
    let size = MapSize { width_px: SIDE_PX, height_px: SIDE_PX };
    let ellipses = ellipses();
    let profile = Profile::new(|r| opacity(r * r));
    let mut mask = TileMask::new(size);
    mask.mark(size.rect());
    let mut map = ReactionMap::new(size);
    let mut paint_all = |footprints: &[Footprint]| {
        let stroke = |footprint| Stroke {
            footprint,
            radius_m: 1.0,
            profile: &profile,
            colour: [180, 0, 0],
            gloss: 255,
            opacity: 1.0,
        };
        let strokes: Vec<Stroke> = footprints.iter().map(stroke).collect();
        paint(&mut map, &mask, &strokes);
    };
    let mut group = c.benchmark_group("300 ellipses");
    let known = footprints(size, &ellipses);
    for threads in [1, 4] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        // Timed inside the pool: an app's systems run in theirs.
        let mut bench = |name: String, paint_once: &mut (dyn FnMut() + Send)| {
            group.bench_function(name, |b| {
                b.iter_custom(|times| {
                    pool.install(|| {
                        let start = Instant::now();
                        (0..times).for_each(|_| paint_once());
                        start.elapsed()
                    })
                });
            });
        };
        bench(format!("bevy_surgery, {threads} threads"), &mut || paint_all(&footprints(size, black_box(&ellipses))));
        bench(format!("bevy_surgery, {threads} threads, known footprints"), &mut || paint_all(black_box(&known)));
    }
    group.finish();
}

fn tiny_skia(c: &mut Criterion) {
    let ellipses = ellipses();
    let mut map = Pixmap::new(SIDE_PX, SIDE_PX).expect("a map");
    let mut sprite = Pixmap::new(64, 64).expect("a sprite");
    for (k, pixel) in sprite.pixels_mut().iter_mut().enumerate() {
        let r = Vec2::new((k % 64) as f32 - 31.5, (k / 64) as f32 - 31.5) / 32.0;
        let alpha = if r.length_squared() < 1.0 { opacity(r.length_squared()) } else { 0.0 };
        let byte = |value: f32| (value * alpha) as u8;
        *pixel = PremultipliedColorU8::from_rgba(byte(180.0), 0, 0, byte(255.0)).expect("premultiplied");
    }
    let place = |ellipse: &Ellipse, unit: f32| {
        Transform::from_scale(ellipse.scale * unit, ellipse.scale * unit * ASPECT)
            .post_rotate(ellipse.angle.to_degrees())
            .post_translate(ellipse.centre_px.x, ellipse.centre_px.y)
    };
    let mut group = c.benchmark_group("300 ellipses");
    for quality in [FilterQuality::Nearest, FilterQuality::Bilinear] {
        let paint = PixmapPaint { opacity: 1.0, blend_mode: BlendMode::SourceOver, quality };
        group.bench_function(format!("tiny-skia, sprite {quality:?}"), |b| {
            b.iter(|| {
                for ellipse in black_box(&ellipses) {
                    let transform = place(ellipse, SEMI_AXIS_PX / 32.0).pre_translate(-32.0, -32.0);
                    map.draw_pixmap(0, 0, sprite.as_ref(), &paint, transform, None);
                }
            });
        });
    }
    let stop =
        |at: f32| GradientStop::new(at, Color::from_rgba(180.0 / 255.0, 0.0, 0.0, opacity(at * at)).expect("a colour"));
    let stops = [0.0, 0.25, 0.5, 0.8, 1.0].map(stop).to_vec();
    let shader = RadialGradient::new(
        Point::zero(),
        0.0,
        Point::zero(),
        SEMI_AXIS_PX,
        stops,
        SpreadMode::Pad,
        Transform::identity(),
    );
    let paint = Paint { anti_alias: false, shader: shader.expect("a gradient"), ..Paint::default() };
    let disk = PathBuilder::from_circle(0.0, 0.0, SEMI_AXIS_PX).expect("a disk");
    group.bench_function("tiny-skia, gradient", |b| {
        b.iter(|| {
            for ellipse in black_box(&ellipses) {
                map.fill_path(&disk, &paint, FillRule::Winding, place(ellipse, 1.0), None);
            }
        });
    });
    group.finish();
}

fn footprints_on_the_liver(c: &mut Criterion) {
    let name = "liver-smooth.obj";
    let Ok(bytes) = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/mesh/liver-smooth.obj")) else {
        println!("skipped: {name} is not here");
        return;
    };
    let options = LoadOptions { unit: MeshUnit::LargestExtent(0.22), ..LoadOptions::default() };
    let mesh = parse(&bytes, name, &options).expect("a real organ");
    let (sphere, _) = chart::build(&mesh, &ChartOptions::default()).expect("a chart");
    let atlas = Atlas::Spherical(sphere);
    let table = atlas.table(1024, 512);
    let normals = mesh.vertex_normals();
    let surface = Surface { atlas: &atlas, table: &table, positions_m: &mesh.positions_m, normals: &normals };
    let mut rng = Pcg32::seed_from_u64(1);
    let faces = mesh.triangles.len() as u32;
    let points: Vec<SurfacePoint> = (0..100)
        .map(|_| {
            let (a, b): (f64, f64) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
            SurfacePoint { face: rng.random_range(0..faces), barycentric: DVec3::new(1.0 - a - b, a, b) }
        })
        .collect();
    let mut group = c.benchmark_group("100 footprints");
    for (width_px, radius_m) in [(1024, 0.002), (2048, 0.002), (1024, 0.008), (2048, 0.008)] {
        let size = MapSize::from_width(width_px);
        group.bench_function(format!("{} mm, {width_px} texels", radius_m * 1e3), |b| {
            b.iter(|| {
                let texels = |&point: &SurfacePoint| {
                    Footprint::new(&surface, size, point, radius_m).map_or(0, |footprint| footprint.rects()[0].area())
                };
                black_box(&points).iter().map(texels).sum::<u64>()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, ours, tiny_skia, footprints_on_the_liver);
criterion_main!(benches);
