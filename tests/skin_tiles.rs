//! The skin's triangular tiles: edges that fit, feature points that keep their distance, no repetition, PNG files.

use bevy_surgery::skin::tiles::points::PointLayer;
use bevy_surgery::skin::tiles::ramp::srgb_from_linear;
use bevy_surgery::skin::tiles::{
    ColourRamp, EDGE_TOLERANCE, RampStop, TILE_COUNT, TileDetail, TileError, TileOptions, TilePoints, TileSet,
    assign_tiles, rotate_barycentric, tile_uv,
};
use glam::{DVec2, Vec2, Vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;
use std::path::Path;

fn presets() -> [(&'static str, TileOptions); 5] {
    [
        ("liver", TileOptions::liver()),
        ("gallbladder", TileOptions::gallbladder()),
        ("spleen", TileOptions::spleen()),
        ("kidney", TileOptions::kidney()),
        ("mucosa", TileOptions::mucosa()),
    ]
}

fn small() -> TileOptions {
    TileOptions { resolution_px: 128, cells_per_edge: 8.0, ..TileOptions::liver() }
}

/// A place on an edge (0, 1, 2) of a triangle, counted counter-clockwise.
fn on_edge(edge: usize, along: f32) -> Vec3 {
    let mut barycentric = [0.0; 3];
    barycentric[edge] = 1.0 - along;
    barycentric[(edge + 1) % 3] = along;
    Vec3::from(barycentric)
}

fn srgb_steps(linear: Vec3) -> Vec3 {
    linear.to_array().map(|c| srgb_from_linear(f64::from(c)) as f32 * 255.0).into()
}

/// Largest difference, in 8-bit sRGB steps, over all pairs of (tile, rotation, edge) that can meet, at random places.
fn worst_seam(set: &TileSet, lod: f32, places: usize, seed: u64) -> f32 {
    let mut random = Pcg32::seed_from_u64(seed);
    let mut worst = 0.0f32;
    for _ in 0..places {
        let along: f32 = random.random_range(0.0..=1.0);
        // The triangle across sees its edge from the other end.
        let seen = |along: f32| -> Vec<Vec3> {
            (0..TILE_COUNT * 9)
                .map(|case| {
                    let (tile, edge, rotation) = (case / 9, case / 3 % 3, (case % 3) as u8);
                    srgb_steps(set.sample(tile, rotate_barycentric(on_edge(edge, along), rotation), lod))
                })
                .collect()
        };
        let (here, across) = (seen(along), seen(1.0 - along));
        for &a in &here {
            for &b in &across {
                worst = worst.max((a - b).abs().max_element());
            }
        }
    }
    worst
}

#[test]
fn every_edge_fits_every_other_in_every_rotation() {
    for (name, options) in presets() {
        let set = TileSet::generate(&options).unwrap();
        let worst = worst_seam(&set, 0.0, 400, 11);
        println!("{name}: worst seam {worst:.3}/255, texels {:?}", set.worst_edge());
        assert!(worst <= 1.0, "{name}: {worst}/255");
        assert_eq!(set.worst_edge().difference, 0, "{name}");
    }
}

#[test]
fn coarse_levels_have_no_seams_either() {
    // Edge texels lie between the lattice of a coarse level, so bilinear sampling along the three edges differs by what
    // the pattern curves within one texel; the bound is on the worst place of all.
    for (name, options) in presets() {
        let set = TileSet::generate(&options).unwrap();
        let seams: Vec<f32> = (1..set.mips.len()).map(|level| worst_seam(&set, level as f32, 150, 5)).collect();
        println!("{name}: worst seam per level from 1: {seams:.2?}");
        assert!(seams.iter().all(|&seam| seam <= COARSE_SEAM), "{name}: {seams:?}");
        assert!(seams[seams.len() - 3..].iter().all(|&seam| seam == 0.0), "{name}: {seams:?}");
    }
}

/// Largest difference across an edge in the coarser levels, 8-bit sRGB steps.
const COARSE_SEAM: f32 = 4.0;

#[test]
fn one_moved_strip_point_breaks_the_edges() {
    let options = TileOptions::liver();
    let mut points = TilePoints::generate(&options).unwrap();
    let whole = TileSet::from_points(&options, &points).unwrap();
    assert!(worst_seam(&whole, 0.0, 200, 3) <= 1.0);

    let radius = points.cells.poisson_radius;
    let moved = points.cells.tiles[2]
        .iter_mut()
        .find(|p| p.shared && p.position.y.abs() < 0.3 * radius && (0.2..0.8).contains(&p.position.x))
        .expect("a strip point close to the first edge");
    moved.position += DVec2::new(0.3, 0.3) * radius;
    let broken = TileSet::from_points(&options, &points).unwrap();
    let seam = worst_seam(&broken, 0.0, 200, 3);
    assert!(seam > 5.0, "a moved point must show, but the seam is {seam}/255");
    let worst = broken.worst_edge();
    assert!(worst.difference > 5 && worst.tiles.contains(&2), "{worst:?}");
}

#[test]
fn a_stray_point_on_an_edge_has_no_clearance() {
    let mut points = TilePoints::generate(&small()).unwrap();
    assert!(points.cells.edge_clearance() > 0.0);
    let stray = points.cells.tiles[1].iter_mut().find(|p| !p.shared).expect("a point inside");
    stray.position = DVec2::new(0.37, 0.001);
    assert!(points.cells.edge_clearance() < 0.0);
}

/// Smallest distance between two points of a tile, over the Poisson radius.
fn closest_pair(layer: &PointLayer) -> f64 {
    let pairs = layer.tiles.iter().flat_map(|tile| {
        tile.iter().enumerate().flat_map(move |(i, a)| tile[..i].iter().map(move |b| a.position.distance(b.position)))
    });
    pairs.fold(f64::INFINITY, f64::min) / layer.poisson_radius
}

/// Largest distance from a place in a tile to its nearest point, over the Poisson radius.
fn widest_gap(layer: &PointLayer) -> f64 {
    let steps = 150;
    let gap = |tile: usize| {
        let places = (0..=steps).flat_map(|j| (0..=steps - j).map(move |i| (f64::from(i), f64::from(j))));
        places
            .map(|(i, j)| DVec2::new(i + 0.5 * j, 0.75f64.sqrt() * j) / f64::from(steps))
            .map(|place| {
                let distances = layer.tiles[tile].iter().map(|p| p.position.distance_squared(place));
                distances.fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max)
            .sqrt()
    };
    (0..TILE_COUNT).map(gap).fold(0.0, f64::max) / layer.poisson_radius
}

#[test]
fn points_keep_the_poisson_distance_and_leave_no_holes() {
    for seed in 0..6 {
        let points = TilePoints::generate(&TileOptions { seed, ..TileOptions::liver() }).unwrap();
        let detail = points.detail.as_ref().expect("the liver has a second octave");
        for (name, layer) in [("cells", &points.cells), ("detail", detail)] {
            let (closest, gap, clearance) =
                (closest_pair(layer), widest_gap(layer), layer.edge_clearance() / layer.poisson_radius);
            println!(
                "seed {seed} {name}: closest {closest:.4}, widest gap {gap:.3}, edge clearance {clearance:.3} radii"
            );
            assert!(closest >= 1.0 - 1e-9, "{name}: {closest}");
            // One radius where darts may fall anywhere; a little more beside the edges, where only shared points may.
            assert!(gap < 1.25, "{name}: {gap}");
            assert!(clearance > 0.0, "{name}: {clearance}");
        }
    }
}

#[test]
fn shared_points_are_their_own_image_under_the_edges_half_turn() {
    let points = TilePoints::generate(&TileOptions::liver()).unwrap();
    for tile in &points.cells.tiles {
        let near_first_edge = |p: DVec2| p.y.abs() < points.cells.poisson_radius && (-0.01..=1.01).contains(&p.x);
        let strip: Vec<_> = tile.iter().filter(|p| p.shared && near_first_edge(p.position)).collect();
        assert!(strip.len() > 12);
        for point in &strip {
            let image = DVec2::X - point.position;
            let partner = strip.iter().find(|other| other.position.distance(image) < 1e-12);
            assert_eq!(partner.map(|other| other.tint), Some(point.tint), "{point:?}");
        }
    }
}

/// Luminance of a rhombus of `side_cells` by `side_cells` lattice cells (two triangles each), `steps` samples per edge.
fn patch(set: &TileSet, side_cells: usize, steps: usize, single_tile: bool) -> Vec<f32> {
    let n = side_cells as i32;
    let id = |i: i32, j: i32, down: i32| {
        if (0..n).contains(&i) && (0..n).contains(&j) { ((j * n + i) * 2 + down) as u32 } else { u32::MAX }
    };
    let neighbours: Vec<[u32; 3]> = (0..n * n)
        .flat_map(|cell| {
            let (i, j) = (cell % n, cell / n);
            [[id(i, j - 1, 1), id(i, j, 1), id(i - 1, j, 1)], [id(i, j + 1, 0), id(i, j, 0), id(i + 1, j, 0)]]
        })
        .collect();
    let mut choices = assign_tiles(&neighbours, 17);
    if single_tile {
        choices.fill(Default::default());
    }
    let size = side_cells * steps;
    (0..size * size)
        .into_par_iter()
        .map(|sample| {
            let (x, y) = (sample % size, sample / size);
            let (i, j) = ((x / steps) as i32, (y / steps) as i32);
            let (u, v) = ((x % steps) as f32 / steps as f32, (y % steps) as f32 / steps as f32);
            let (down, barycentric) = if u + v < 1.0 {
                (0, Vec3::new(1.0 - u - v, u, v))
            } else {
                (1, Vec3::new(u + v - 1.0, 1.0 - u, 1.0 - v))
            };
            let choice = choices[id(i, j, down) as usize];
            let lod = (480.0 / steps as f32).log2();
            let colour = set.sample(choice.tile as usize, rotate_barycentric(barycentric, choice.rotation), lod);
            colour.dot(Vec3::new(0.2126, 0.7152, 0.0722))
        })
        .collect()
}

/// Largest normalised autocorrelation over all displacements from two cells up to one and a half tiles, and where.
fn autocorrelation_peak(image: &[f32], size: usize, steps: usize, cell: f32) -> (f32, (i32, i32)) {
    let mean = image.iter().sum::<f32>() / image.len() as f32;
    let image: Vec<f32> = image.iter().map(|l| l - mean).collect();
    let variance = image.iter().map(|l| l * l).sum::<f32>() / image.len() as f32;
    let reach = steps as i32 * 3 / 2;
    let lags: Vec<(i32, i32)> = (0..=reach)
        .flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)))
        .filter(|&(dx, dy)| {
            let (x, y) = (dx as f32 + 0.5 * dy as f32, 0.75f32.sqrt() * dy as f32);
            x.hypot(y) > 2.0 * cell
        })
        .collect();
    lags.into_par_iter()
        .map(|(dx, dy)| {
            let (first, last) = ((-dx).max(0) as usize, size - dx.max(0) as usize);
            let (mut sum, mut count) = (0.0f64, 0usize);
            for y in 0..size - dy as usize {
                let here = &image[y * size + first..y * size + last];
                let start = ((y + dy as usize) * size) as i32 + first as i32 + dx;
                let there = &image[start as usize..start as usize + here.len()];
                let mut lanes = [0.0f32; 16];
                for (a, b) in here.chunks_exact(16).zip(there.chunks_exact(16)) {
                    for lane in 0..16 {
                        lanes[lane] += a[lane] * b[lane];
                    }
                }
                sum += f64::from(lanes.iter().sum::<f32>());
                count += here.len() / 16 * 16;
            }
            (sum as f32 / count as f32 / variance, (dx, dy))
        })
        .reduce(|| (f32::MIN, (0, 0)), |a, b| if b.0 > a.0 { b } else { a })
}

#[test]
fn a_patch_of_1600_triangles_does_not_repeat() {
    let options = TileOptions::liver();
    let set = TileSet::generate(&options).unwrap();
    // 28 by 28 rhombi are 1568 triangles, as many as 40 by 40.
    let (side_cells, steps) = (28, 30);
    let cell = steps as f32 / options.cells_per_edge;
    let peak = |single| {
        let image = patch(&set, side_cells, steps, single);
        autocorrelation_peak(&image, side_cells * steps, steps, cell)
    };
    let (single, random) = (peak(true), peak(false));
    println!("autocorrelation peak: single tile {single:?}, random tiles {random:?}");
    assert!(single.0 > 0.95, "one tile in one rotation must repeat: {single:?}");
    assert!(random.0 < 0.4 * single.0, "random {random:?} against single {single:?}");
}

#[test]
fn the_same_options_give_the_same_bytes_whatever_the_threads() {
    let make = || TileSet::generate(&small()).unwrap();
    let here = make();
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(make);
    assert_eq!(here, alone);
    let other = TileSet::generate(&TileOptions { seed: 2, ..small() }).unwrap();
    assert_ne!(here, other);
}

#[test]
fn levels_and_upload_order() {
    let set = TileSet::generate(&small()).unwrap();
    assert_eq!(set.mips.len(), 8);
    for (level, bytes) in set.mips.iter().enumerate() {
        let size = set.level_size_px(level) as usize;
        assert_eq!(bytes.len(), size * size * 4 * TILE_COUNT);
        assert!(bytes.iter().skip(3).step_by(4).all(|&alpha| alpha == 255));
    }
    let bytes = set.gpu_bytes();
    let layer_length = bytes.len() / TILE_COUNT;
    assert_eq!(&bytes[layer_length..layer_length + 128 * 128 * 4], set.layer(0, 1));
    assert_eq!(&bytes[bytes.len() - 4..], set.layer(7, 3));
    // All levels show the same mean colour.
    let mean = |lod: f32| {
        let samples = 40;
        let places: Vec<Vec3> = (0..samples)
            .flat_map(|j| (0..samples - j).map(move |i| Vec2::new(i as f32 + 0.33, j as f32 + 0.33) / samples as f32))
            .map(|b| Vec3::new(1.0 - b.x - b.y, b.x, b.y))
            .collect();
        let sum: Vec3 = (0..TILE_COUNT)
            .flat_map(|tile| places.iter().map(move |&b| (tile, b)))
            .map(|(tile, b)| set.sample(tile, b, lod))
            .sum();
        srgb_steps(sum / (places.len() * TILE_COUNT) as f32)
    };
    for level in 1..set.mips.len() {
        let difference = (mean(level as f32) - mean(0.0)).abs().max_element();
        assert!(difference < 2.0, "level {level} is off by {difference}/255");
    }
}

#[test]
fn rotation_and_texture_coordinates() {
    let corners = [Vec3::X, Vec3::Y, Vec3::Z];
    for rotation in 0..3u8 {
        assert_eq!(rotate_barycentric(corners[rotation as usize], rotation), Vec3::X);
        assert_eq!(rotate_barycentric(corners[(rotation as usize + 1) % 3], rotation), Vec3::Y);
    }
    // Corners lie on the centres of texels (16, 16), (496, 16) and (16, 496) of 512.
    let texel = |corner| tile_uv(corner, 0, 512) * 512.0 - 0.5;
    assert_eq!(texel(Vec3::X), Vec2::new(16.0, 16.0));
    assert_eq!(texel(Vec3::Y), Vec2::new(496.0, 16.0));
    assert_eq!(texel(Vec3::Z), Vec2::new(16.0, 496.0));
}

#[test]
fn png_files_bring_the_same_tiles_back() {
    let folder = tempfile::tempdir().unwrap();
    let set = TileSet::generate(&small()).unwrap();
    let paths = set.save_png(folder.path(), "liver").unwrap();
    assert_eq!(paths[3].file_name().unwrap(), "liver-3.png");
    let back = TileSet::from_png_files(paths.each_ref().map(|path| path.as_path())).unwrap();
    assert_eq!(set, back);
    let missing = set.save_png(&folder.path().join("nowhere"), "liver");
    assert!(matches!(missing, Err(TileError::Png { name, .. }) if name.contains("liver-0.png")));
}

fn png(image: &image::RgbaImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Four plain images that a designer might hand in, each passed through an edit.
fn designer_files(size: u32, edit: impl Fn(usize, &mut image::RgbaImage)) -> Result<TileSet, TileError> {
    let files: Vec<Vec<u8>> = (0..TILE_COUNT)
        .map(|tile| {
            let mut image = image::RgbaImage::from_pixel(size, size, image::Rgba([120, 60, 50, 255]));
            edit(tile, &mut image);
            png(&image)
        })
        .collect();
    let names = ["a.png", "b.png", "c.png", "d.png"];
    TileSet::from_png_bytes(std::array::from_fn(|tile| (names[tile], files[tile].as_slice())))
}

#[test]
fn a_designers_files_are_checked() {
    // Texel (p + i, p) of 64 lies on the first edge, with p = 2 and 60 steps.
    let on_first_edge = (2 + 15, 2);
    let slightly_off = designer_files(64, |tile, image| {
        if tile == 2 {
            image.get_pixel_mut(on_first_edge.0, on_first_edge.1).0[1] += EDGE_TOLERANCE;
            image.get_pixel_mut(20, 20).0 = [255, 255, 255, 255];
            image.get_pixel_mut(0, 0).0 = [0, 0, 0, 0];
        }
    });
    let set = slightly_off.unwrap();
    assert_eq!(set.worst_edge().difference, 0, "edges within the tolerance are made equal");
    assert!(worst_seam(&set, 0.0, 100, 1) <= 1.0);

    let error = designer_files(64, |tile, image| {
        if tile == 2 {
            image.get_pixel_mut(on_first_edge.0, on_first_edge.1).0[1] += 40;
        }
    })
    .unwrap_err();
    let TileError::Edges { names, worst } = &error else { panic!("{error}") };
    assert_eq!((names[1].as_str(), worst.tiles[1], worst.edges[1], worst.along[1]), ("c.png", 2, 0, 0.25));
    assert_eq!(worst.difference, 40);
    let message = error.to_string();
    for part in ["c.png", "tile 2", "edge 0", "25.0 %", "40/255"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn wrong_files_are_named() {
    let good = png(&image::RgbaImage::new(64, 64));
    let with =
        |bad: &[u8]| TileSet::from_png_bytes([("a", &good), ("b", bad), ("c", &good), ("d", &good)]).unwrap_err();
    let named = |error: TileError| matches!(error, TileError::Png { name, .. } if name == "b");
    assert!(named(with(b"no picture")));
    assert!(named(with(&good[..good.len() / 2])));
    assert!(named(with(&png(&image::RgbaImage::new(64, 32)))));
    assert!(named(with(&png(&image::RgbaImage::new(48, 48)))));
    assert!(named(with(&png(&image::RgbaImage::new(8192, 1)))));
    let sizes = with(&png(&image::RgbaImage::new(128, 128)));
    assert_eq!(sizes, TileError::Sizes { names: ["a".into(), "b".into()], sizes_px: [64, 128] });
    let missing = TileSet::from_png_files([Path::new("no-such-tile.png"); 4]).unwrap_err();
    assert!(missing.to_string().starts_with("no-such-tile.png: "), "{missing}");
}

#[test]
fn silly_options_are_refused_by_name() {
    let field = |change: &dyn Fn(&mut TileOptions)| {
        let mut options = TileOptions::default();
        change(&mut options);
        match TileSet::generate(&options) {
            Err(TileError::Options { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    for resolution in [0, 1, 32, 500, 8192, u32::MAX] {
        assert_eq!(field(&|o| o.resolution_px = resolution), "resolution_px");
    }
    for cells in [f32::NAN, f32::INFINITY, -4.0, 0.0, 2.9, 61.0] {
        assert_eq!(field(&|o| o.cells_per_edge = cells), "cells_per_edge");
    }
    assert_eq!(field(&|o| o.cell_jitter = f32::NAN), "cell_jitter");
    assert_eq!(field(&|o| o.wobble = 0.6), "wobble");
    assert_eq!(field(&|o| o.detail.cells_ratio = 0.5), "detail.cells_ratio");
    assert_eq!(field(&|o| o.detail.relief = -0.1), "detail.relief");
    assert_eq!(field(&|o| o.detail.net = f32::NAN), "detail.net");
    assert_eq!(field(&|o| o.detail.net_srgb[2] = 1.1), "detail.net_srgb");
    assert_eq!(field(&|o| o.ramp.stops.clear()), "ramp");
    assert_eq!(field(&|o| o.ramp.stops[0].position = f32::NAN), "ramp");
    assert_eq!(field(&|o| o.ramp.stops[1].position = o.ramp.stops[0].position), "ramp");
    assert_eq!(field(&|o| o.ramp.stops[1].colour_srgb[0] = f32::NAN), "ramp");
}

#[test]
fn options_survive_a_file() {
    for (_, options) in presets() {
        let text = serde_json::to_string(&options).unwrap();
        assert_eq!(serde_json::from_str::<TileOptions>(&text).unwrap(), options);
    }
    assert_eq!(serde_json::from_str::<TileOptions>("{}").unwrap(), TileOptions::default());
}

fn any_options() -> impl Strategy<Value = TileOptions> {
    let stop = (0.01f32..0.6, prop::array::uniform3(0.0f32..=1.0));
    let ramp = prop::collection::vec(stop, 1..5).prop_map(|steps| {
        let mut position = -0.2;
        let stops = steps.into_iter().map(|(step, colour_srgb)| {
            position += step;
            RampStop { position, colour_srgb }
        });
        ColourRamp { stops: stops.collect() }
    });
    let detail = (1.0f32..=8.0, 0.0f32..=1.0, 0.0f32..=1.0, prop::array::uniform3(0.0f32..=1.0))
        .prop_map(|(cells_ratio, relief, net, net_srgb)| TileDetail { cells_ratio, relief, net, net_srgb });
    (prop::sample::select(vec![64u32, 128]), 0.0f32..=1.0, ramp, 0.0f32..=1.0, 0.0f32..=0.3, detail, any::<u64>())
        .prop_map(|(resolution_px, density, ramp, cell_jitter, wobble, detail, seed)| {
            let most_cells = resolution_px as f32 * 15.0 / 16.0 / 8.0;
            let cells_per_edge = 3.0 + density * (most_cells - 3.0);
            TileOptions { resolution_px, cells_per_edge, ramp, cell_jitter, wobble, detail, seed }
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn whatever_the_options_edges_fit_and_points_keep_their_distance(options in any_options()) {
        let points = TilePoints::generate(&options).unwrap();
        for layer in std::iter::once(&points.cells).chain(&points.detail) {
            prop_assert!(closest_pair(layer) >= 1.0 - 1e-9);
            prop_assert!(layer.edge_clearance() > 0.0);
        }
        let set = TileSet::from_points(&options, &points).unwrap();
        let worst = set.worst_edge();
        prop_assert!(worst.difference <= 1, "{:?}", worst);
    }

    #[test]
    fn no_bytes_crash_the_reader(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(TileSet::from_png_bytes([("x", &bytes); 4]).is_err());
    }
}
