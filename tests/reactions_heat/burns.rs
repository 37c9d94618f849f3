//! What a cautery leaves, how it looks, and who is told.

use super::phantom::{Phantom, STEP_S, all_doses, real_organ};
use bevy_surgery::reactions::burn::{BurnRamp, Cautery};
use bevy_surgery::reactions::heat::{HeatMap, HeatSettings};
use bevy_surgery::reactions::texels::{TILE_PX, TexelRect, TileMask};
use glam::DVec2;

#[test]
fn a_line_is_even_and_not_a_row_of_spots() {
    let phantom = Phantom::ellipsoid(1024);
    let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
    let centre = DVec2::new(0.31, 0.5);
    let at = |x_m: f64| phantom.beside(centre, DVec2::new(x_m, 0.0));
    phantom.pass(&mut heat, &Cautery::default(), at(-0.008), at(0.008), 0.02);
    phantom.rest(&mut heat, 1.0);
    let doses: Vec<f32> = (-50..=50).map(|k| phantom.peak_dose(&heat, at(f64::from(k) * 1e-4), 5e-4)).collect();
    let mean = doses.iter().sum::<f32>() / doses.len() as f32;
    assert!(mean > 0.1 && doses.iter().all(|dose| (dose / mean - 1.0).abs() < 0.08), "{mean}: {doses:?}");
}

#[test]
fn light_passes_mark_yellow_and_crossings_and_standing_char() {
    let liver = real_organ("liver-smooth.obj", 1024).map(|liver| ("liver-smooth.obj", liver, DVec2::new(0.3, 0.5)));
    let ramp = BurnRamp::default();
    let unit = Cautery::default();
    for (name, phantom, centre) in
        liver.into_iter().chain([("ellipsoid", Phantom::ellipsoid(1024), DVec2::new(0.31, 0.45))])
    {
        let at = |x_m: f64, y_m: f64| phantom.beside(centre, DVec2::new(x_m, y_m));
        let ends =
            [(at(-0.01, 0.0), at(0.01, 0.0)), (at(0.0, -0.01), at(0.0, 0.01)), (at(-0.007, -0.007), at(0.007, 0.007))];
        let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
        let mut at_crossing = Vec::new();
        let mut beside = 0.0;
        for (from, to) in ends {
            phantom.pass(&mut heat, &unit, from, to, 0.02);
            phantom.rest(&mut heat, 2.0);
            at_crossing.push(phantom.peak_dose(&heat, centre, 5e-4));
            beside = phantom.peak_dose(&heat, at(-0.006, 0.0), 5e-4);
        }
        let mut standing = HeatMap::new(phantom.size, HeatSettings::default());
        phantom.hold(&mut standing, &unit, centre, 60);
        let stood = phantom.peak_dose(&standing, centre, 5e-4);
        let colour = |dose: f32| ramp.look(ramp.index(dose)).colour.map(f32::from);
        // Yellow over the skin, and translucent.
        for dose in [beside, at_crossing[0]] {
            let [r, g, b, a] = colour(dose);
            assert!(r / a > 0.8 && g / a > 0.65 && b / a < 0.6 && (60.0..190.0).contains(&a), "{name}: {dose}");
        }
        // Each crossing is darker, and the third brown-black.
        let brightness: Vec<f32> = at_crossing.iter().map(|&dose| colour(dose)[0] / colour(dose)[3]).collect();
        assert!(brightness[1] < 0.75 * brightness[0] && brightness[2] < 0.6 * brightness[1], "{name}: {brightness:?}");
        for dose in [at_crossing[2], stood] {
            let [r, g, b, a] = colour(dose);
            assert!(r < 64.0 && g < 40.0 && b < 30.0 && a > 240.0, "{name}: {dose}: {r} {g} {b} {a}");
        }
        // Four millimetres off the standing tip the skin is as it was.
        assert!(phantom.dose_at(&standing, at(0.004, 0.0)) < 0.02, "{name}");
    }
}

#[test]
fn cutting_leaves_a_narrower_mark_than_coagulating() {
    let phantom = Phantom::ellipsoid(2048);
    let centre = DVec2::new(0.31, 0.45);
    let at = |x_m: f64| phantom.beside(centre, DVec2::new(x_m, 0.0));
    let ramp = BurnRamp::default();
    let width = |unit: Cautery| {
        let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
        phantom.pass(&mut heat, &unit, at(-0.006), at(0.006), 0.01);
        phantom.rest(&mut heat, 3.0);
        let across = |k: i32| phantom.beside(centre, DVec2::new(0.0, f64::from(k) * 5e-5));
        (-100..=100).filter(|&k| ramp.index(phantom.dose_at(&heat, across(k))) > 60).count()
    };
    let [cut, blend, coagulation] = [Cautery::cut(40.0), Cautery::blend(40.0), Cautery::coagulate(40.0)].map(width);
    assert!(cut > 10 && blend > cut && 2 * cut < coagulation, "{cut} {blend} {coagulation}");
}

#[test]
fn cold_tiles_cost_nothing_and_burns_stay() {
    let phantom = Phantom::ellipsoid(1024);
    let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
    assert_eq!(heat.hot_tiles(), 0);
    phantom.hold(&mut heat, &Cautery::default(), DVec2::new(0.4, 0.5), 30);
    assert!((1..=9).contains(&heat.hot_tiles()), "{}", heat.hot_tiles());
    phantom.rest(&mut heat, 10.0);
    let doses = all_doses(&phantom, &heat);
    assert!(doses.iter().any(|&dose| dose > 1.0));
    phantom.rest(&mut heat, 30.0);
    assert_eq!((heat.hot_tiles(), heat.total_energy_j()), (0, 0.0));
    assert_eq!(all_doses(&phantom, &heat), doses);
    // Warm again, the tile still knows.
    heat.deposit(&phantom.surface(), &phantom.spot(DVec2::new(0.4, 0.5), 0.002, |_| 1.0), 1e-3);
    assert_eq!(all_doses(&phantom, &heat), doses);
}

#[test]
fn changed_looks_are_reported_once_and_tightly() {
    let phantom = Phantom::ellipsoid(1024);
    let ramp = BurnRamp::default();
    let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
    let looks = |heat: &HeatMap| -> Vec<u8> { phantom.texels().map(|(x, y)| ramp.index(heat.dose(x, y))).collect() };
    let mut before = looks(&heat);
    let ask = |heat: &mut HeatMap| {
        let (mut mask, mut rects) = (TileMask::new(phantom.size), Vec::new());
        heat.changed(&ramp, &mut mask, &mut rects);
        let tiles: Vec<(u32, u32)> = rects.iter().map(|rect| (rect.x / TILE_PX, rect.y / TILE_PX)).collect();
        assert_eq!(tiles, mask.marked().collect::<Vec<_>>(), "one rectangle for each tile, in order");
        rects
    };
    let wanted = |before: &[u8], after: &[u8]| {
        let mut rects: Vec<TexelRect> = Vec::new();
        for (k, (x, y)) in phantom.texels().enumerate() {
            if before[k] == after[k] {
                continue;
            }
            let own = TexelRect { x, y, width: 1, height: 1 };
            let same = |rect: &&mut TexelRect| (rect.x / TILE_PX, rect.y / TILE_PX) == (x / TILE_PX, y / TILE_PX);
            match rects.iter_mut().find(same) {
                Some(rect) => *rect = rect.union(own),
                None => rects.push(own),
            }
        }
        rects.sort_by_key(|rect| (rect.y / TILE_PX, rect.x / TILE_PX));
        rects
    };
    let mut reported = 0;
    // Over the date line, then a pause in which conduction goes on, then until all is cold.
    for k in 0..40u32 {
        let uv = DVec2::new((0.99 + f64::from(k) * 0.0008) % 1.0, 0.4);
        match k {
            0..20 => phantom.hold(&mut heat, &Cautery::coagulate(60.0), uv, 1),
            20..39 => heat.step(&phantom.surface(), STEP_S),
            _ => phantom.rest(&mut heat, 40.0),
        }
        let after = looks(&heat);
        let rects = ask(&mut heat);
        assert_eq!(rects, wanted(&before, &after), "{k}");
        reported += rects.len();
        before = after;
    }
    assert!(reported > 20, "{reported}");
    assert_eq!((heat.hot_tiles(), ask(&mut heat)), (0, vec![]), "nothing new");
    for (k, (x, y)) in phantom.texels().enumerate() {
        let look = heat
            .looks(x / TILE_PX, y / TILE_PX)
            .map_or(0, |looks| looks[(y % TILE_PX) as usize][(x % TILE_PX) as usize]);
        assert_eq!(look, before[k], "{x}, {y}");
    }
    let burnt = wanted(&vec![0; before.len()], &before);
    heat.forget_looks();
    assert_eq!(ask(&mut heat), burnt);
    heat.clear();
    assert_eq!(ask(&mut heat), burnt, "wiping changes what was burnt");
    assert!(looks(&heat).iter().all(|&look| look == 0) && ask(&mut heat).is_empty());
    assert_eq!(heat.looks(0, phantom.size.height_px / TILE_PX), None);
}
