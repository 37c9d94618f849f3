use super::*;
use crate::organ::surface::NEUTRAL_GLOSS;
use glam::{Mat2, Vec2};
use proptest::prelude::*;

const SIZE: MapSize = MapSize { width_px: 192, height_px: 96 };

/// All ways to blend that this processor has.
#[cfg(target_arch = "x86_64")]
const WAYS: &[Blend] = &[vectors::paint, vectors::paint_without_avx512];
#[cfg(not(target_arch = "x86_64"))]
const WAYS: &[Blend] = &[portable::paint];

fn full_mask() -> TileMask {
    let mut mask = TileMask::new(SIZE);
    mask.mark(SIZE.rect());
    mask
}

proptest! {
    #[test]
    fn vectors_and_plain_code_leave_the_same_bits(
        ellipses in prop::collection::vec(
            (-20.0..212.0f32, -20.0..116.0f32, 0.0..3.2f32, 0.3..60.0f32, 0.3..60.0f32, 0.0..1.0f32, 0.2..1.2f32),
            1..12,
        ),
        colour: [u8; 3],
        gloss: u8,
        marks in prop::collection::vec((0..192u32, 0..96u32), 1..8),
    ) {
        let footprints: Vec<Footprint> = ellipses
            .iter()
            .map(|&(x, y, angle, a, b, _, _)| {
                let jacobian = Mat2::from_diagonal(Vec2::new(a, b).recip()) * Mat2::from_angle(-angle);
                Footprint::ellipse(SIZE, Vec2::new(x, y), jacobian).expect("an ellipse")
            })
            .collect();
        let profile = Profile::new(|r| if r < 0.5 { 0.9 } else { (1.0 - r) * 1.7 });
        let strokes: Vec<Stroke> = footprints
            .iter()
            .zip(&ellipses)
            .map(|(footprint, &(.., opacity, radius_m))| Stroke { footprint, radius_m, profile: &profile, colour, gloss, opacity })
            .collect();
        let mut mask = TileMask::new(SIZE);
        for (x, y) in marks {
            mask.mark(crate::reactions::texels::TexelRect { x, y, width: 1, height: 1 });
        }
        let mut plain = ReactionMap::new(SIZE);
        paint_with(portable::paint, &mut plain, &mask, &strokes);
        for &blend in WAYS {
            let mut fast = ReactionMap::new(SIZE);
            paint_with(blend, &mut fast, &mask, &strokes);
            prop_assert_eq!(&plain, &fast);
        }
        let is_premultiplied = |&[r, g, b, a]: &[u8; 4]| r.max(g).max(b) <= a;
        prop_assert!(plain.colour().iter().all(is_premultiplied));
    }
}

#[test]
fn blending_on_a_blank_map_gives_the_profile() {
    let footprint = Footprint::ellipse(SIZE, Vec2::new(60.0, 40.0), Mat2::from_diagonal(Vec2::splat(1.0 / 30.0)));
    let footprint = footprint.expect("a disk");
    let profile = Profile::new(|r| 0.8 * (1.0 - r * r));
    let stroke = Stroke {
        footprint: &footprint,
        radius_m: 1.0,
        profile: &profile,
        colour: [200, 100, 0],
        gloss: 255,
        opacity: 0.5,
    };
    let mut map = ReactionMap::new(SIZE);
    paint(&mut map, &full_mask(), &[stroke]);
    let mut covered = 0;
    for y in 0..96u32 {
        for x in 0..192u32 {
            let [r, g, b, a] = map.colour()[(y * 192 + x) as usize];
            let gloss = map.gloss()[(y * 192 + x) as usize];
            let (dx, dy) = (f64::from(x) + 0.5 - 60.0, f64::from(y) + 0.5 - 40.0);
            let alpha = 0.4 * (1.0 - (dx * dx + dy * dy) / 900.0).max(0.0);
            covered += usize::from(a > 0);
            for (got, asked) in [(r, 200.0), (g, 100.0), (b, 0.0), (a, 255.0)] {
                assert!((f64::from(got) - asked * alpha).abs() < 0.7, "{x}, {y}: {got} for {}", asked * alpha);
            }
            assert!((f64::from(gloss) - 128.0 - 127.0 * alpha).abs() < 0.7, "{x}, {y}: {gloss}");
        }
    }
    assert!(covered > 2600, "{covered} texels");
}

#[test]
fn strokes_of_no_use_leave_no_trace() {
    let disk = Footprint::ellipse(SIZE, Vec2::new(60.0, 40.0), Mat2::from_diagonal(Vec2::splat(1.0 / 9.0)));
    let disk = disk.expect("a disk");
    let (nothing, profile) = (Footprint::default(), Profile::default());
    let good =
        Stroke { footprint: &disk, radius_m: 1.0, profile: &profile, colour: [255; 3], gloss: 255, opacity: 1.0 };
    let bad = [
        Stroke { radius_m: 0.0, ..good },
        Stroke { radius_m: -1.0, ..good },
        Stroke { radius_m: f32::NAN, ..good },
        Stroke { opacity: 0.0, ..good },
        Stroke { opacity: f32::NAN, ..good },
        Stroke { opacity: -1.0, ..good },
        Stroke { footprint: &nothing, ..good },
        Stroke { radius_m: 1e-30, ..good },
    ];
    let mut map = ReactionMap::new(SIZE);
    paint(&mut map, &full_mask(), &bad);
    assert_eq!(map, ReactionMap::new(SIZE));
    let mut permanent = PermanentMap::new(SIZE);
    bad.iter().for_each(|stroke| permanent.bake(stroke));
    assert_eq!(permanent, PermanentMap::new(SIZE));
    // What is too much counts as the most.
    let most = [Stroke { radius_m: f32::INFINITY, opacity: f32::INFINITY, ..good }];
    let mut other = map.clone();
    paint(&mut map, &full_mask(), &most);
    paint(&mut other, &full_mask(), &[good]);
    assert!(map == other && map != ReactionMap::new(SIZE));
}

#[test]
fn permanent_maps_keep_what_is_set_and_baked() {
    let disk = Footprint::ellipse(SIZE, Vec2::new(64.0, 40.0), Mat2::from_diagonal(Vec2::splat(1.0 / 12.0)));
    let disk = disk.expect("a disk");
    let profile = Profile::default();
    let stroke =
        Stroke { footprint: &disk, radius_m: 1.0, profile: &profile, colour: [90, 60, 30], gloss: 0, opacity: 0.9 };
    let mut permanent = PermanentMap::new(SIZE);
    let empty = permanent.bytes_in_use();
    permanent.set_texel(5, 70, [9, 200, 9, 100], 40);
    permanent.set_texel(500, 70, [1; 4], 1);
    permanent.set_texel(100, 90, [0; 4], NEUTRAL_GLOSS);
    assert_eq!(permanent.texel(5, 70), ([9, 100, 9, 100], 40), "no component is greater than alpha");
    assert_eq!(permanent.texel(500, 70), ([0; 4], NEUTRAL_GLOSS));
    assert_eq!(permanent.tiles_in_use(), 1);
    permanent.bake(&stroke);
    permanent.bake(&stroke);
    assert_eq!(permanent.tiles_in_use(), 5, "the disk lies over the corner of four tiles");
    assert_eq!(permanent.bytes_in_use() - empty, 5 * 32 * 32 * 5);
    // The same as painting it on the shown map.
    let mut painted = ReactionMap::new(SIZE);
    paint(&mut painted, &full_mask(), &[stroke, stroke]);
    let mut restored = ReactionMap::new(SIZE);
    permanent.set_texel(5, 70, [0; 4], NEUTRAL_GLOSS);
    restore(&mut restored, &permanent, &full_mask());
    assert_eq!(painted, restored);
    permanent.clear();
    restore(&mut restored, &permanent, &full_mask());
    assert_eq!(restored, ReactionMap::new(SIZE));
    assert_eq!(permanent.bytes_in_use(), empty);
}

#[test]
fn maps_and_masks_of_other_sizes_do_no_harm() {
    let odd = MapSize { width_px: 100, height_px: 50 };
    let mut map = ReactionMap::new(odd);
    assert_eq!(map.size(), MapSize { width_px: 96, height_px: 32 });
    let disk = Footprint::ellipse(odd, Vec2::new(95.0, 30.0), Mat2::from_diagonal(Vec2::splat(1.0 / 40.0)));
    let disk = disk.expect("a disk");
    let profile = Profile::default();
    let stroke =
        Stroke { footprint: &disk, radius_m: 1.0, profile: &profile, colour: [255; 3], gloss: 255, opacity: 1.0 };
    paint(&mut map, &full_mask(), &[stroke]);
    let mut permanent = PermanentMap::new(odd);
    permanent.bake(&stroke);
    permanent.set_texel(99, 49, [255; 4], 0);
    assert_eq!((permanent.tiles_in_use(), permanent.texel(99, 49)), (0, ([0; 4], NEUTRAL_GLOSS)));
    permanent.set_texel(95, 31, [255; 4], 0);
    restore(&mut map, &permanent, &full_mask());
    assert_eq!(map.colour().iter().filter(|colour| colour[3] > 0).count(), 1);
    assert_eq!(map.colour()[31 * 96 + 95], [255; 4]);
    let before = map.clone();
    restore(&mut map, &PermanentMap::new(SIZE), &full_mask());
    assert_eq!(map, before);
}
