//! Disks on organs: round and of the right size seen along the normal, whole over the date line and the poles; painting
//! that leaves the same bits however it is done.

use super::organ_chart::{hook, read};
use bevy_surgery::organ::atlas::{Atlas, FaceTable};
use bevy_surgery::organ::chart::{self, ChartOptions};
use bevy_surgery::organ::load::{LoadOptions, MeshUnit};
use bevy_surgery::organ::mesh::SurfaceMesh;
use bevy_surgery::organ::planar::PlanarChart;
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::organ::sphere::{SphereMesh, SurfacePoint};
use bevy_surgery::organ::surface::Surface;
use bevy_surgery::reactions::footprint::Footprint;
use bevy_surgery::reactions::paint::{PermanentMap, Profile, ReactionMap, Stroke, paint, restore};
use bevy_surgery::reactions::texels::{MapSize, TexelRect, TileMask};
use glam::{DMat2, DVec2, DVec3, Vec2, Vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Everything that a [`Surface`] borrows.
struct Scene {
    mesh: SurfaceMesh,
    normals: Vec<Vec3>,
    atlas: Atlas,
    table: FaceTable,
}

impl Scene {
    fn new(mesh: SurfaceMesh, atlas: Atlas) -> Self {
        let table = atlas.table(1024, 512);
        Self { normals: mesh.vertex_normals(), mesh, atlas, table }
    }

    fn charted(mesh: SurfaceMesh) -> Self {
        let (sphere, _) = chart::build(&mesh, &ChartOptions::default()).expect("a chart");
        Self::new(mesh, Atlas::Spherical(sphere))
    }

    /// A sphere whose chart is the identity: what lies where is known.
    fn ball(radius_m: f32) -> Self {
        let mesh = procedural_ellipsoid(Vec3::splat(radius_m), 16);
        let directions = mesh.positions_m.iter().map(|p| p.as_dvec3().normalize()).collect();
        let sphere = SphereMesh::new(directions, mesh.triangles.clone());
        assert!(sphere.is_positive());
        Self::new(mesh, Atlas::Spherical(sphere))
    }

    fn surface(&self) -> Surface<'_> {
        Surface { atlas: &self.atlas, table: &self.table, positions_m: &self.mesh.positions_m, normals: &self.normals }
    }

    fn at(&self, direction: DVec3) -> SurfacePoint {
        self.atlas.chart().locate(0, direction)
    }

    /// Places evenly spread over the surface.
    fn sites(&self, seed: u64, count: usize) -> Vec<SurfacePoint> {
        let mut rng = Pcg32::seed_from_u64(seed);
        let mut sum = 0.0;
        let sums: Vec<f64> = (0..self.mesh.triangles.len() as u32)
            .map(|face| {
                sum += self.mesh.face_area_m2(face);
                sum
            })
            .collect();
        let mut place = || {
            let at: f64 = rng.random_range(0.0..sum);
            let face = sums.partition_point(|&sum| sum <= at) as u32;
            let (a, b): (f64, f64) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
            SurfacePoint { face, barycentric: DVec3::new(1.0 - a - b, a, b) }
        };
        (0..count).map(|_| place()).collect()
    }
}

/// Texels of a footprint with the squares of their distances; fails where one comes twice or lies outside the rectangles.
fn texels(footprint: &Footprint) -> BTreeMap<(u32, u32), f32> {
    let mut texels = BTreeMap::new();
    footprint.for_each_texel(|x, y, r_squared| {
        assert!((0.0..1.0).contains(&r_squared), "{r_squared} at {x}, {y}");
        let texel = TexelRect { x, y, width: 1, height: 1 };
        let holders = footprint.rects().iter().filter(|rect| rect.contains(texel)).count();
        assert_eq!(holders, 1, "texel {x}, {y} in {:?}", footprint.rects());
        assert_eq!(texels.insert((x, y), r_squared), None, "texel {x}, {y} comes twice");
    });
    assert!(footprint.rects().iter().all(|&rect| footprint.size().rect().contains(rect) && !rect.is_empty()));
    // Every side of every rectangle has a texel on it.
    for rect in footprint.rects() {
        let has = |test: &dyn Fn(u32, u32) -> bool| {
            let inside = |&&(x, y): &&(u32, u32)| rect.contains(TexelRect { x, y, width: 1, height: 1 });
            texels.keys().filter(inside).any(|&(x, y)| test(x, y))
        };
        assert!(has(&|x, _| x == rect.x) && has(&|x, _| x + 1 == rect.right()), "{rect:?} is too wide");
        assert!(has(&|_, y| y == rect.y) && has(&|_, y| y + 1 == rect.bottom()), "{rect:?} is too high");
    }
    texels
}

/// What is seen of a disk along the normal of its middle.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Longer by shorter axis of the ellipse with the same second moments.
    axis_ratio: f64,
    /// Area over that of the disk that was asked for.
    area_share: f64,
}

/// Sums of what is seen: area, and its first and second moments.
struct Moments {
    area: f64,
    first: DVec2,
    second: DMat2,
}

impl Moments {
    fn add(&mut self, place: DVec2, area: f64) {
        self.area += area;
        self.first += area * place;
        self.second += area * DMat2::from_cols(place * place.x, place * place.y);
    }

    fn seen(&self, radius_m: f64) -> Seen {
        let middle = self.first / self.area;
        let spread = self.second * (1.0 / self.area) - DMat2::from_cols(middle * middle.x, middle * middle.y);
        let (half, determinant) = (0.5 * (spread.x_axis.x + spread.y_axis.y), spread.determinant());
        let root = (half * half - determinant).max(0.0).sqrt();
        Seen { axis_ratio: ((half + root) / (half - root)).sqrt(), area_share: self.area / (PI * radius_m * radius_m) }
    }
}

/// Looks along the normal at the part of the surface where `r_squared` is less than one; that function is read at the
/// texels' centres of a box and between them from the quadratic through the nine nearest, as a sharp mask would be
/// drawn from it. Texels at the border are cut into `cuts * cuts` parts. Every part has its exact place and area.
fn seen(
    scene: &Scene,
    size: MapSize,
    point: SurfacePoint,
    radius_m: f64,
    cuts: u32,
    r_squared: &BTreeMap<(u32, u32), f64>,
) -> Seen {
    let surface = scene.surface();
    let middle_m = surface.position_m(point);
    let normal = surface.normal(point);
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let far = 4.0;
    let at = |x: i64, y: i64| {
        let key = (x.rem_euclid(i64::from(size.width_px)) as u32, y as u32);
        r_squared.get(&key).copied().unwrap_or(far)
    };
    let mut moments = Moments { area: 0.0, first: DVec2::ZERO, second: DMat2::ZERO };
    for &(x, y) in r_squared.keys() {
        let (x, y) = (i64::from(x), i64::from(y));
        let near: [[f64; 3]; 3] = [-1, 0, 1].map(|dy| [-1, 0, 1].map(|dx| at(x + dx, y + dy)));
        if near.iter().flatten().all(|&r_squared| r_squared >= 1.0) {
            continue;
        }
        // Only the border needs to be cut finely.
        let cuts = if near.iter().flatten().all(|&r_squared| r_squared < 1.0) { 1 } else { cuts };
        for part in 0..cuts * cuts {
            let offset = DVec2::new(f64::from(part % cuts), f64::from(part / cuts));
            let offset = (offset + 0.5) / f64::from(cuts) - 0.5;
            let weights = |t: f64| [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
            let (wx, wy) = (weights(offset.x), weights(offset.y));
            let value: f64 = (0..9).map(|k| near[k / 3][k % 3] * wx[k % 3] * wy[k / 3]).sum();
            if value >= 1.0 {
                continue;
            }
            let map = DVec2::new(f64::from(size.width_px), f64::from(size.height_px));
            let uv = (DVec2::new(x as f64, y as f64) + 0.5 + offset) / map;
            let Some(place) = scene.atlas.locate_uv(uv, &scene.table) else { continue };
            let frame = surface.frame(place);
            let texel_m2 = frame.dposition_du_m.cross(frame.dposition_dv_m) / (map.x * map.y);
            // What lies behind the organ's border is not seen.
            let facing = frame.face_normal.dot(normal);
            if facing > 0.0 {
                let local = frame.position_m - middle_m;
                let area = texel_m2.length() * facing / f64::from(cuts * cuts);
                moments.add(DVec2::new(local.dot(tangent), local.dot(bitangent)), area);
            }
        }
    }
    moments.seen(radius_m)
}

/// Squares of the distances in shares of `radius_m`, also a little beyond it, from the footprint of a larger disk.
fn wide_texels(footprint: &Footprint, radius_m: f64) -> BTreeMap<(u32, u32), f64> {
    let mut texels = BTreeMap::new();
    let widened = (f64::from(footprint.radius_m()) / radius_m).powi(2);
    footprint.for_each_texel(|x, y, r_squared| {
        texels.insert((x, y), f64::from(r_squared) * widened);
    });
    texels
}

/// The ellipse of the Jacobian at the middle, as in the paper of 2002, in the texels of another footprint.
fn constant_jacobian(
    scene: &Scene,
    size: MapSize,
    point: SurfacePoint,
    radius_m: f64,
    texels: &BTreeMap<(u32, u32), f64>,
) -> BTreeMap<(u32, u32), f64> {
    let frame = scene.surface().frame(point);
    let map = DVec2::new(f64::from(size.width_px), f64::from(size.height_px));
    let r_squared = |&(x, y): &(u32, u32)| {
        let mut away = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / map - frame.uv;
        away.x -= away.x.round();
        ((frame.dposition_du_m * away.x + frame.dposition_dv_m * away.y) / radius_m).length_squared()
    };
    texels.keys().map(|key| (*key, r_squared(key))).collect()
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

/// Shares of sites that look round, and that have the area that was asked for.
fn report(name: &str, seen: &[Seen]) -> (f64, f64) {
    let share = |test: fn(&Seen) -> bool| seen.iter().filter(|seen| test(seen)).count() as f64 / seen.len() as f64;
    let round = share(|seen| seen.axis_ratio < 1.1);
    let sized = share(|seen| (seen.area_share - 1.0).abs() < 0.1);
    let mut ratios: Vec<f64> = seen.iter().map(|seen| seen.axis_ratio).collect();
    let mut off: Vec<f64> = seen.iter().map(|seen| (seen.area_share - 1.0).abs()).collect();
    println!(
        "{name}: axis ratio {:.3} / {:.3} / {:.3}, {:.1}% under 1.1; area off by {:.1}% / {:.1}% / {:.1}%, {:.1}% within \
         10% (median / 95% / 99%)",
        quantile(&mut ratios, 0.5),
        quantile(&mut ratios, 0.95),
        quantile(&mut ratios, 0.99),
        100.0 * round,
        100.0 * quantile(&mut off, 0.5),
        100.0 * quantile(&mut off, 0.95),
        100.0 * quantile(&mut off, 0.99),
        100.0 * sized
    );
    (round, sized)
}

/// Organs as large as they are in a body.
fn organs() -> impl Iterator<Item = (&'static str, Scene)> {
    [("liver-smooth.obj", 0.22), ("gallbladder.stl", 0.09)].into_iter().filter_map(|(name, extent_m)| {
        let options = LoadOptions { unit: MeshUnit::LargestExtent(extent_m), ..LoadOptions::default() };
        Some((name, Scene::charted(read(name, &options)?)))
    })
}

#[test]
fn disks_on_organs_look_round() {
    for (name, scene) in organs() {
        let sites = scene.sites(2002, 500);
        for (radius_m, width_px, cuts) in [(0.002, 1024, 6), (0.002, 2048, 4), (0.008, 1024, 3)] {
            let size = MapSize::from_width(width_px);
            let both: Vec<(Seen, Seen)> = sites
                .par_iter()
                .map(|&point| {
                    let surface = scene.surface();
                    let wide = Footprint::new(&surface, size, point, 1.6 * radius_m as f32).expect("a footprint");
                    let wide = wide_texels(&wide, radius_m);
                    let constant = constant_jacobian(&scene, size, point, radius_m, &wide);
                    let look = |texels| seen(&scene, size, point, radius_m, cuts, texels);
                    (look(&wide), look(&constant))
                })
                .collect();
            let (ours, constant): (Vec<Seen>, Vec<Seen>) = both.into_iter().unzip();
            let title = format!("{name}, {} mm, {width_px} texels", radius_m * 1e3);
            let (round, sized) = report(&title, &ours);
            let (constant_round, constant_sized) = report(&format!("{title}, constant Jacobian"), &constant);
            assert!(round >= constant_round && sized >= constant_sized);
            // A disk of 16 mm is wider than what is flat of a gallbladder: there is less of it to be seen.
            if radius_m < 0.005 || name == "liver-smooth.obj" {
                assert!(round >= 0.95 && sized >= 0.95, "{title}: {round} round, {sized} of the right area");
            }
        }
    }
}

const SIZE: MapSize = MapSize { width_px: 1024, height_px: 512 };

/// Holds every texel of the map against a squared distance (in shares of the radius; `None` for what must not be
/// covered) that is known otherwise. `slack` is how far off a share of the radius may be.
fn check_texels(footprint: &Footprint, slack: f32, known: impl Fn(u32, u32) -> Option<f32>) -> usize {
    let found = texels(footprint);
    for y in 0..footprint.size().height_px {
        for x in 0..footprint.size().width_px {
            let r = known(x, y).map_or(f32::INFINITY, f32::sqrt);
            match found.get(&(x, y)) {
                Some(r_squared) => {
                    assert!((r_squared.sqrt() - r).abs() < slack, "{x}, {y}: {} for {r}", r_squared.sqrt())
                }
                None => assert!(r > 1.0 - slack, "{x}, {y} is left out at {r}"),
            }
        }
    }
    found.len()
}

#[test]
fn disks_on_a_ball_are_whole_over_the_date_line_and_the_poles() {
    let ball = Scene::ball(0.1);
    let direction = |u: f64, v: f64| ball.atlas.direction_from_uv(DVec2::new(u, v));
    let cases = [
        (direction(0.3, 0.5), 0.01, 1),
        (direction(0.6, 0.3), 0.03, 1),
        (direction(0.0, 0.5), 0.01, 2),
        (direction(0.999, 0.7), 0.01, 2),
        (DVec3::Y, 0.004, 1),
        (DVec3::NEG_Y, 0.02, 1),
        (direction(0.37, 0.02), 0.01, 1),
        (direction(0.001, 0.97), 0.015, 1),
        (direction(0.45, 0.04), 0.011, 1),
        (direction(0.2, 0.6), 0.08, 1),
    ];
    for (middle, radius_m, rects) in cases {
        let footprint = Footprint::new(&ball.surface(), SIZE, ball.at(middle), radius_m).expect("a footprint");
        let covered = check_texels(&footprint, 0.05, |x, y| {
            let direction = ball
                .atlas
                .direction_from_uv((DVec2::new(f64::from(x), f64::from(y)) + 0.5) / DVec2::new(1024.0, 512.0));
            let away = direction - middle * direction.dot(middle);
            (direction.dot(middle) > 0.0).then(|| (0.1 * away.length() / f64::from(radius_m)).powi(2) as f32)
        });
        assert!(covered > 100, "{covered} texels at {middle}");
        let whole_rows = footprint.rects().iter().map(|rect| rect.width).sum::<u32>() == SIZE.width_px;
        assert!(footprint.rects().len() == rects || whole_rows, "{middle}: {:?}", footprint.rects());
        // A smaller disk has a part of these texels.
        let smaller = Footprint::new(&ball.surface(), SIZE, ball.at(middle), 0.7 * radius_m).expect("a footprint");
        let (larger, smaller) = (texels(&footprint), texels(&smaller));
        for (texel, r_squared) in &smaller {
            let scaled = larger.get(texel).map(|r_squared| r_squared / 0.49);
            assert!(scaled.is_some_and(|scaled| (scaled - r_squared).abs() < 0.1), "{texel:?}: {r_squared} {scaled:?}");
        }
    }
}

#[test]
fn both_halves_of_a_disk_on_the_date_line_are_painted() {
    let ball = Scene::ball(0.1);
    let footprint = Footprint::new(&ball.surface(), SIZE, ball.at(DVec3::Z), 0.01).expect("a footprint");
    let [west, east] = footprint.rects() else { panic!("{:?}", footprint.rects()) };
    let (west, east) = if west.x == 0 { (east, west) } else { (west, east) };
    assert_eq!((west.right(), east.x), (1024, 0));
    assert!(west.width.abs_diff(east.width) <= 1 && west.height.abs_diff(east.height) <= 1, "{west:?} {east:?}");
    let mut map = ReactionMap::new(SIZE);
    let mut mask = TileMask::new(SIZE);
    footprint.rects().iter().for_each(|&rect| mask.mark(rect));
    let profile = Profile::new(|_| 1.0);
    paint(&mut map, &mask, &[stroke(&footprint, &profile)]);
    let painted = |x: u32, y: u32| map.colour()[(y * 1024 + x) as usize][3] == 255;
    assert!(painted(0, 256) && painted(1023, 256) && !painted(500, 256));
    let count = map.colour().iter().filter(|colour| colour[3] > 0).count();
    assert_eq!(count, texels(&footprint).len());
}

/// A square of two metres over the left half of the texture.
fn square() -> Scene {
    let corners = [Vec2::new(0.0, 0.0), Vec2::new(1.0, 0.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 1.0)];
    let mesh = SurfaceMesh {
        positions_m: corners.iter().map(|c| Vec3::new(2.0 * c.x, 2.0 * c.y, 0.0)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: Some(corners.iter().map(|c| Vec2::new(0.5 * c.x, c.y)).collect()),
    };
    let planar = PlanarChart::new(&mesh).expect("a chart");
    Scene::new(mesh, Atlas::Planar(planar))
}

#[test]
fn disks_on_a_planar_chart_end_with_its_faces() {
    let square = square();
    let size = MapSize::from_width(512);
    for (x_m, y_m, radius_m) in [(1.0, 1.0, 0.3), (1.9, 1.0, 0.3), (0.0, 0.0, 0.5), (2.0, 1.4, 0.2), (1.0, 1.0, 5.0)] {
        let uv = DVec2::new(0.25 * x_m, 0.5 * y_m);
        let point = square.atlas.locate_uv(uv, &square.table).expect("a place");
        let footprint = Footprint::new(&square.surface(), size, point, radius_m as f32).expect("a footprint");
        let covered = check_texels(&footprint, 1e-4, |x, y| {
            let place =
                (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / DVec2::new(512.0, 256.0) * DVec2::new(4.0, 2.0);
            (place.x < 2.0).then(|| (place.distance_squared(DVec2::new(x_m, y_m)) / (radius_m * radius_m)) as f32)
        });
        assert!(covered > 100, "{covered} texels");
    }
}

#[test]
fn disks_stay_on_their_side_of_a_thin_rim() {
    let leaf = Scene::charted(procedural_ellipsoid(Vec3::new(0.05, 0.004, 0.05), 16));
    let surface = leaf.surface();
    let size = MapSize::from_width(1024);
    let (mut near_rim, mut covered, mut facing_away) = (0, 0, 0);
    for point in leaf.sites(5, 200) {
        let (middle_m, normal) = (surface.position_m(point), surface.normal(point));
        near_rim += usize::from(middle_m.length() > 0.044);
        let footprint = Footprint::new(&surface, size, point, 0.006).expect("a footprint");
        for (x, y) in texels(&footprint).into_keys() {
            let uv = leaf.table.centre_uv(x, y);
            let place = leaf.atlas.locate_uv(uv, &leaf.table).expect("a place");
            covered += 1;
            facing_away += usize::from(surface.face_normal(place.face).dot(normal) < -1e-9);
            // The height counts where it is greater than the distance along the plane: at most the diagonal of both.
            let away = surface.position_m(place).distance(middle_m);
            assert!(away < 0.006 * 1.5, "{x}, {y} is {away} m away");
        }
    }
    assert!(near_rim > 20, "{near_rim} sites near the rim");
    // Interpolation may take in a texel just beyond the edge.
    assert!(covered > 10_000 && facing_away * 1000 < covered, "{facing_away} of {covered} texels face away");
}

fn stroke<'a>(footprint: &'a Footprint, profile: &'a Profile) -> Stroke<'a> {
    let radius_m = footprint.radius_m();
    Stroke { footprint, radius_m, profile, colour: [150, 20, 10], gloss: 255, opacity: 1.0 }
}

#[test]
fn no_input_is_too_bad_for_a_footprint() {
    let ball = Scene::ball(0.1);
    let surface = ball.surface();
    let point = ball.at(DVec3::new(0.3, 0.4, -0.2).normalize());
    for radius_m in [0.0, -0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(Footprint::new(&surface, SIZE, point, radius_m), None, "{radius_m}");
    }
    assert_eq!(Footprint::new(&surface, MapSize::default(), point, 0.01), None);
    assert_eq!(Footprint::new(&surface, SIZE, SurfacePoint { face: u32::MAX, ..point }, 0.01), None);
    assert_eq!(Footprint::new(&surface, SIZE, SurfacePoint { barycentric: DVec3::NAN, ..point }, 0.01), None);
    // Too small to hold a texel's centre, and larger than the organ: half of the ball faces the disk.
    for radius_m in [f32::MIN_POSITIVE, 1e-30, 1e-9] {
        let footprint = Footprint::new(&surface, SIZE, point, radius_m).expect("a footprint");
        assert!(texels(&footprint).len() <= 1, "{radius_m}");
    }
    for radius_m in [0.2, 1.0, 1e6, f32::MAX] {
        let footprint = Footprint::new(&surface, SIZE, point, radius_m).expect("a footprint");
        let mut seen = 0.0;
        for &(_, y) in texels(&footprint).keys() {
            seen += (PI * (f64::from(y) + 0.5) / 512.0).sin();
        }
        let share = seen * PI / (1024.0 * 512.0) / 2.0;
        assert!((share - 0.5).abs() < 0.02, "{radius_m}: {share} of the ball");
    }
    // Vertices that are no numbers: none where the disk is, and a hole where they are.
    let vertex = ball.mesh.triangles[point.face as usize][0] as usize;
    for bad in [Vec3::NAN, Vec3::INFINITY] {
        let mut positions_m = ball.mesh.positions_m.clone();
        positions_m[vertex] = bad;
        let broken = Surface { positions_m: &positions_m, ..surface };
        assert_eq!(Footprint::new(&broken, SIZE, point, 0.01), None);
        let beside = ball.atlas.chart().directions[vertex].any_orthonormal_vector() * 0.35
            + ball.atlas.chart().directions[vertex];
        let footprint = Footprint::new(&broken, SIZE, ball.at(beside.normalize()), 0.05).expect("a footprint");
        let (x, y) = {
            let uv = ball.atlas.uv_from_direction(ball.atlas.chart().directions[vertex]) * DVec2::new(1024.0, 512.0);
            (uv.x as u32, uv.y as u32)
        };
        let texels = texels(&footprint);
        assert!(texels.len() > 500 && !texels.contains_key(&(x, y)));
    }
    let short = Surface { normals: &ball.normals[..3], ..surface };
    assert_eq!(Footprint::new(&short, SIZE, point, 0.01), None);
    // A normal that is no number: the face's own serves.
    let nan = vec![Vec3::NAN; ball.normals.len()];
    let plain = Surface { normals: &nan, ..surface };
    assert!(Footprint::new(&plain, SIZE, point, 0.01).is_some_and(|footprint| texels(&footprint).len() > 100));
}

#[test]
fn footprints_on_an_uneven_chart_are_exact_to_a_twentieth() {
    let scene = Scene::charted(hook());
    let surface = scene.surface();
    let size = MapSize::from_width(512);
    for (k, point) in scene.sites(3, 60).into_iter().enumerate() {
        let radius_m = [0.02, 0.05, 0.15][k % 3];
        let footprint = Footprint::new(&surface, size, point, radius_m as f32).expect("a footprint");
        let (middle_m, normal) = (surface.position_m(point), surface.normal(point));
        let facing = surface.face_normal(point.face).dot(normal);
        assert!(facing > 0.1, "the disk lies square to the blended normal");
        for ((x, y), r_squared) in texels(&footprint) {
            let uv = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / DVec2::new(512.0, 256.0);
            let place = scene.atlas.locate_uv(uv, &scene.table).expect("a place");
            let away = surface.position_m(place) - middle_m;
            let height = away.dot(normal);
            let exact = (away - height * normal).length().max(height.abs()) / radius_m;
            let off = (f64::from(r_squared.sqrt()) - exact).abs();
            assert!(off < 0.05, "site {k}: texel {x}, {y} at {} and not {exact}", r_squared.sqrt());
        }
    }
}

/// Disks of several sizes all over the ball.
fn footprints(ball: &Scene, size: MapSize, count: usize) -> Vec<Footprint> {
    let sites = ball.sites(77, count).into_iter().enumerate();
    sites
        .filter_map(|(k, point)| Footprint::new(&ball.surface(), size, point, 0.004 + 0.002 * (k % 9) as f32))
        .collect()
}

#[test]
fn painting_is_the_same_for_any_number_of_threads() {
    let ball = Scene::ball(0.1);
    let footprints = footprints(&ball, SIZE, 400);
    let profile = Profile::new(|r| 0.7 * (1.0 - r));
    let strokes: Vec<Stroke> = footprints.iter().map(|footprint| stroke(footprint, &profile)).collect();
    let mut mask = TileMask::new(SIZE);
    mask.mark(SIZE.rect());
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut map = ReactionMap::new(SIZE);
        pool.install(|| paint(&mut map, &mask, &strokes));
        map
    };
    let one = with(1);
    assert_eq!(one, with(4));
    assert!(one.colour().iter().filter(|colour| colour[3] > 0).count() > 100_000);
}

#[test]
fn restoring_and_painting_marked_tiles_is_painting_all_of_them() {
    let ball = Scene::ball(0.1);
    let footprints = footprints(&ball, SIZE, 60);
    let profile = Profile::default();
    let strokes: Vec<Stroke> = footprints.iter().map(|footprint| stroke(footprint, &profile)).collect();
    let mut permanent = PermanentMap::new(SIZE);
    permanent.bake(&Stroke { colour: [40, 30, 20], gloss: 0, ..strokes[7] });
    let mut all = TileMask::new(SIZE);
    all.mark(SIZE.rect());
    let render = |map: &mut ReactionMap, mask: &TileMask, strokes: &[Stroke]| {
        restore(map, &permanent, mask);
        paint(map, mask, strokes);
    };
    let mut whole = ReactionMap::new(SIZE);
    render(&mut whole, &all, &strokes);
    let once = whole.clone();
    render(&mut whole, &all, &strokes);
    assert_eq!(whole, once, "twice is the same as once");

    // Some strokes fade: only their tiles are marked.
    let mut marked = TileMask::new(SIZE);
    let mut faded = strokes.clone();
    for k in [3, 20, 41] {
        faded[k].opacity = 0.3;
        footprints[k].rects().iter().for_each(|&rect| marked.mark(rect));
    }
    assert!(marked.marked().count() < all.marked().count() / 4);
    let before = whole.clone();
    render(&mut whole, &marked, &faded);
    let mut anew = ReactionMap::new(SIZE);
    render(&mut anew, &all, &faded);
    assert_eq!(whole, anew);
    assert_ne!(whole, before);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn colours_stay_premultiplied(
        strokes in prop::collection::vec((any::<[u8; 3]>(), any::<u8>(), -0.5..1.5f32, 0.0..0.03f32, 0..20usize), 1..40),
        burns in prop::collection::vec((0..1024u32, 0..512u32, any::<[u8; 4]>(), any::<u8>()), 0..50),
    ) {
        let ball = Scene::ball(0.1);
        let footprints = footprints(&ball, SIZE, 20);
        let profile = Profile::new(|r| 1.2 - r);
        let strokes: Vec<Stroke> = strokes
            .iter()
            .map(|&(colour, gloss, opacity, radius_m, k)| {
                Stroke { footprint: &footprints[k], radius_m, profile: &profile, colour, gloss, opacity }
            })
            .collect();
        let mut permanent = PermanentMap::new(SIZE);
        burns.iter().for_each(|&(x, y, colour, gloss)| permanent.set_texel(x, y, colour, gloss));
        permanent.bake(&strokes[0]);
        let mut mask = TileMask::new(SIZE);
        mask.mark(SIZE.rect());
        let mut map = ReactionMap::new(SIZE);
        restore(&mut map, &permanent, &mask);
        paint(&mut map, &mask, &strokes);
        prop_assert!(map.colour().iter().all(|&[r, g, b, a]| r.max(g).max(b) <= a));
    }
}
