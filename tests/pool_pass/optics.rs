//! The twin on the processor against closed forms, and the texels against the solver.

use bevy::prelude::*;
use bevy_surgery::pool::software::{
    PoolMixture, fresnel, in_scattered, optical_displacement_m, refracted, refractive_index, transmittance,
};
use bevy_surgery::pool::{
    Dissolved, FluidAction, FluidSolver, FluidSource, FresnelModel, PoolGrid, PoolLook, PoolSurface, SURFACE_TILE,
    SolverSettings, WetMask,
};
use half::f16;

#[test]
fn rays_bend_as_snell_says() {
    for degrees in [0.0_f32, 10.0, 45.0, 80.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let bent = refracted(Vec3::new(sin, 0.0, -cos), Vec3::Z, 1.33);
        assert!((bent.length() - 1.0).abs() < 1e-5);
        assert!((bent.x - sin / 1.33).abs() < 1e-6, "{degrees} degrees: {bent}");
    }
}

#[test]
fn displacement_is_the_third_side() {
    // Equation 9 is equation 8 for rays that go straight down.
    let bent = refracted(Vec3::NEG_Z, Vec3::new(0.3, -0.1, 1.0).normalize(), 1.33);
    let shift = optical_displacement_m(bent, Vec3::NEG_Z, 0.004);
    assert!((shift - bent * (0.004 / bent.z.abs())).length() < 1e-8);
    // It ends as deep along the incident ray as that itself.
    let along = Vec3::new(0.4, 0.2, -0.8).normalize();
    let shift = optical_displacement_m(refracted(along, Vec3::Z, 1.39), along, 0.004);
    assert!((shift.dot(along) - 0.004).abs() < 1e-8);
}

#[test]
fn reflectivity_goes_from_the_index_to_one() {
    let straight = (0.33_f32 / 2.33).powi(2);
    assert!((fresnel(FresnelModel::Schlick, 1.0, 1.33) - straight).abs() < 1e-7);
    assert!((fresnel(FresnelModel::Schlick, 0.0, 1.33) - 1.0).abs() < 1e-6);
    assert_eq!([0.0, 0.5, 1.0].map(|cosine| fresnel(FresnelModel::Paper, cosine, 1.33)), [1.0, 0.25, 0.0]);
}

#[test]
fn light_fades_with_the_way() {
    let look = PoolLook::default();
    let half = PoolMixture { blood: 0.5, dust: 0.0 };
    assert!((refractive_index(&look, half) - 1.36).abs() < 1e-6);
    let wanted =
        (-(look.water_absorption_per_m.y + 0.5 * look.blood_absorption_per_m.y + 0.5 * look.blood_scattering_per_m)
            * 1e-4)
            .exp();
    assert!((transmittance(&look, half, 1e-4).y - wanted).abs() < 1e-6);
    let once = transmittance(&look, half, 3e-4);
    assert!((transmittance(&look, half, 6e-4) - once * once).abs().max_element() < 1e-6);
    let water = PoolMixture::default();
    assert!(transmittance(&look, water, 0.01).min_element() > 0.95 && in_scattered(&look, water, 1.0) == Vec3::ZERO);
    // Deep blood is dark red, deep dust nearly white.
    let blood = in_scattered(&look, PoolMixture { blood: 1.0, dust: 0.0 }, 1.0);
    assert!(blood.x > 0.1 && blood.x < 0.4 && blood.y < 0.05 * blood.x, "{blood}");
    let dust = in_scattered(&look, PoolMixture { blood: 0.0, dust: 1.0 }, 1.0);
    assert!(dust.min_element() > 0.5, "{dust}");
}

#[test]
fn looks_out_of_range_are_clamped() {
    let bad = PoolLook { wave_height: f32::NAN, room: -1.0, water_index: 9.0, meniscus: [f32::NAN; 6], ..default() };
    let sane = bad.sane();
    let wanted = PoolLook { room: 0.0, water_index: 3.0, ..default() };
    assert_eq!(sane, wanted);
    assert_eq!(PoolLook::default().sane(), PoolLook::default());
}

#[test]
fn texels_are_what_the_solver_has() {
    let grid = PoolGrid::new(UVec2::new(150, 100), 1e-4).expect("a good grid");
    let mut solver = FluidSolver::new(grid);
    let is_wet = |cell: UVec2| cell.as_vec2().distance(Vec2::new(60.0, 40.0)) < 25.0;
    let mask = WetMask::from_fn(&grid, is_wet);
    solver.set_mask(&mask).expect("of its size");
    let source = FluidSource {
        place_m: grid.pool_from_cell(UVec2::new(55, 42)),
        radius_m: 5e-4,
        stir_m_s: 0.1,
        amount: [30.0, 12.0],
        ..default()
    };
    let action = FluidAction { sources: vec![source], ..default() };
    for _ in 0..5 {
        solver.step_with(1.0 / 60.0, &SolverSettings::default(), &action);
    }
    let mut surface = PoolSurface::new(PoolGrid::new(UVec2::splat(10), 1e-3).expect("a good grid"), 0.0);
    surface.update(&solver, 0.002, 1.0 / 60.0, 9.81);
    assert_eq!((surface.grid, surface.level_m), (grid, 0.002));
    let mut waves = 0;
    for y in 0..100 {
        for x in 0..150 {
            let cell = UVec2::new(x, y);
            let texel = surface.texels[(y * 150 + x) as usize].map(|half| f16::from_bits(half).to_f32());
            let wet = f32::from(u8::from(is_wet(cell)));
            let height_mm = solver.height_m(cell, 1.0 / 60.0, 9.81) * 1e3;
            let [blood, dust] = [Dissolved::Blood, Dissolved::Dust].map(|what| solver.share(what, cell));
            for (got, wanted) in texel.into_iter().zip([height_mm, blood, dust, wet]) {
                assert!((got - wanted).abs() <= 1e-3 * wanted.abs() + 1e-6, "{cell}: {got} instead of {wanted}");
            }
            waves += u32::from(height_mm.abs() > 1e-3);
            // Every wet cell and its neighbours lie in a tile.
            if wet > 0.0 {
                for side in [-1, 0, 1] {
                    let tile = (cell.as_ivec2() + side).as_uvec2() / SURFACE_TILE;
                    assert!(surface.wet_tiles.contains(&tile), "{cell} has no tile {tile}");
                }
            }
        }
    }
    assert!(waves > 200, "{waves} cells are lifted");
    assert!(surface.wet_tiles.len() < 9, "{:?}", surface.wet_tiles);
    let revision = surface.revision;
    // What falls dry leaves nothing.
    solver.set_mask(&WetMask::from_fn(&grid, |cell| cell.x > 100 && is_wet(cell - 50))).expect("of its size");
    surface.update(&solver, 0.002, 1.0 / 60.0, 9.81);
    assert!(surface.revision > revision);
    assert!(surface.texels[40 * 150 + 60] == [0; 4] && !surface.wet_tiles.contains(&UVec2::ONE));
}
