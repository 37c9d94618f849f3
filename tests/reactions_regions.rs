//! Which rectangles of a reaction map travel: near the best grouping, nothing left out, nothing sent twice.

use bevy_surgery::reactions::regions::{
    Changes, KEPT_STEPS, MOST_RECTS, UploadLog, coalesce, group, group_snake, limit, texel_count,
};
use bevy_surgery::reactions::texels::{MapSize, TexelRect};
use proptest::collection::vec;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

const MAP: MapSize = MapSize { width_px: 1024, height_px: 512 };
const SPRITES: usize = 30;

fn rect(x: u32, y: u32, width: u32, height: u32) -> TexelRect {
    TexelRect { x, y, width, height }
}

fn box_around(rects: &[TexelRect]) -> TexelRect {
    rects.iter().fold(TexelRect::default(), |sum, &rect| sum.union(rect))
}

/// Fewest texels of any grouping into consecutive runs.
fn best_texels(boxes: &[TexelRect]) -> u64 {
    let mut best = vec![0];
    for end in 1..=boxes.len() {
        let costs = (0..end).map(|start| best[start] + box_around(&boxes[start..end]).area());
        best.push(costs.min().expect("a run ends here"));
    }
    best[boxes.len()]
}

/// The same by trying every set of cuts.
fn best_texels_by_enumeration(boxes: &[TexelRect]) -> u64 {
    let cost_of = |cuts: u32| {
        let mut start = 0;
        let mut cost = 0;
        for end in 1..=boxes.len() {
            if end == boxes.len() || cuts >> (end - 1) & 1 == 1 {
                cost += box_around(&boxes[start..end]).area();
                start = end;
            }
        }
        cost
    };
    (0..1 << (boxes.len() - 1)).map(cost_of).min().expect("no cut at all is one way")
}

/// How a drop rolls in texture space.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Path {
    /// Turns at a slowly changing rate, up to curling up.
    Winding,
    /// Starts anyhow and turns downhill.
    Falling,
    Diagonal,
    Horizontal,
    Vertical,
    Straight,
    /// Stands still and trembles.
    Still,
}

const PATHS: [Path; 7] =
    [Path::Winding, Path::Falling, Path::Diagonal, Path::Horizontal, Path::Vertical, Path::Straight, Path::Still];

/// Middle and half sides of every sprite of a snake, in texels; u is not wrapped.
fn trail(path: Path, radius_px: f64, spacing: f64, random: &mut Pcg32) -> Vec<[f64; 4]> {
    let mut angle = match path {
        Path::Diagonal => FRAC_PI_4 + random.random_range(-0.05..0.05),
        Path::Horizontal => 0.0,
        Path::Vertical => FRAC_PI_2,
        _ => random.random_range(0.0..TAU),
    };
    // The chart stretches sprites along u or v, and drops swell and shrink slowly.
    let aspect: f64 = random.random_range(0.6..1.6);
    let (phase, swell, taper) =
        (random.random_range(0.0..TAU), random.random_range(0.0..0.2), random.random_range(0.0..0.4));
    let curvature = random.random_range(-0.15..0.15);
    let mut wobble: f64 = 0.0;
    let (mut x, mut y) = (random.random_range(400.0..600.0), random.random_range(200.0..300.0));
    (0..SPRITES)
        .map(|index| {
            let age = index as f64 / SPRITES as f64;
            let radius = radius_px * (1.0 + swell * (phase + 6.0 * age).sin()) * (1.0 - taper * age);
            let sprite = [x, y, radius * aspect, radius];
            match path {
                Path::Winding => {
                    wobble = (wobble + random.random_range(-0.05..0.05)).clamp(-0.25, 0.25);
                    angle += 0.6 * curvature + wobble;
                }
                Path::Falling => angle += (FRAC_PI_2 - angle) * 0.12,
                _ => {}
            }
            let step = if path == Path::Still { 0.05 * random.random_range(0.0..1.0) } else { spacing } * radius;
            x += step * angle.cos();
            y += step * angle.sin();
            sprite
        })
        .collect()
}

/// Exact box of a sprite, split where it goes over the date line.
fn split_box([x, y, half_width, half_height]: [f64; 4], map: MapSize) -> Vec<TexelRect> {
    let width = f64::from(map.width_px);
    let top = (y - half_height).floor().max(0.0) as u32;
    let bottom = (y + half_height).ceil().min(f64::from(map.height_px)) as u32;
    let shift = ((x - half_width) / width).floor() * width;
    let (left, right) = ((x - half_width - shift).floor() as u32, (x + half_width - shift).ceil() as u32);
    let height = bottom - top;
    if right <= map.width_px {
        return vec![rect(left, top, right - left, height)];
    }
    vec![rect(left, top, map.width_px - left, height), rect(0, top, right - map.width_px, height)]
}

fn boxes_of(trail: &[[f64; 4]]) -> Vec<TexelRect> {
    trail
        .iter()
        .map(|&sprite| {
            let split = split_box(sprite, MapSize { width_px: 1 << 20, height_px: 1 << 20 });
            assert_eq!(split.len(), 1);
            split[0]
        })
        .collect()
}

fn covers(groups: &[TexelRect], boxes: &[TexelRect]) -> bool {
    boxes.iter().all(|&one| groups.iter().any(|group| group.contains(one)))
}

#[test]
fn the_reference_finds_the_best_of_all_groupings() {
    let mut random = Pcg32::seed_from_u64(1);
    for _ in 0..40 {
        for path in PATHS {
            let (radius_px, spacing) = (random.random_range(3.0..12.0), random.random_range(0.3..2.0));
            let boxes = boxes_of(&trail(path, radius_px, spacing, &mut random));
            let count = random.random_range(1..=11);
            assert_eq!(best_texels(&boxes[..count]), best_texels_by_enumeration(&boxes[..count]));
        }
    }
}

#[test]
fn groups_are_within_a_quarter_of_the_best() {
    for path in PATHS {
        let mut random = Pcg32::seed_from_u64(7);
        let (mut worst, mut sent, mut best) = (0.0f64, 0, 0);
        for _ in 0..1000 {
            let (radius_px, spacing) = (random.random_range(3.0..12.0), random.random_range(0.3..1.0));
            let boxes = boxes_of(&trail(path, radius_px, spacing, &mut random));
            for whole in [true, false] {
                let mut groups = Vec::new();
                if whole {
                    group(&boxes, &mut groups);
                } else {
                    group_snake(boxes.iter().map(std::slice::from_ref), &mut groups);
                }
                assert!(covers(&groups, &boxes), "{path:?}: a sprite is left out");
                let (texels, best_of_all) = (texel_count(&groups), best_texels(&boxes));
                assert!(texels >= best_of_all, "{path:?}: better than the best");
                worst = worst.max(texels as f64 / best_of_all as f64);
                sent += texels;
                best += best_of_all;
            }
        }
        println!("{path:?}: worst {worst:.3}, mean {:.3} of the best", sent as f64 / best as f64);
        assert!(worst <= 1.25, "{path:?}: {worst:.3} of the best");
    }
}

#[test]
fn ten_drops_send_a_tenth_of_the_map_at_most() {
    let mut largest = 0.0f64;
    for seed in 0..200 {
        let mut random = Pcg32::seed_from_u64(seed);
        let mut groups = Vec::new();
        let mut best = 0;
        // Radii of 3 to 12 texels and spacings of 0.3 to 1 radius, evenly spread over the ten drops.
        for drop in 0..10 {
            let path = if drop % 2 == 0 { Path::Falling } else { Path::Winding };
            let spacing = 0.3 + 0.7 * f64::from((drop * 7 + 3) % 10) / 9.0;
            let boxes = boxes_of(&trail(path, 3.0 + f64::from(drop), spacing, &mut random));
            best += best_texels(&boxes);
            group_snake(boxes.iter().map(std::slice::from_ref), &mut groups);
        }
        let separate = texel_count(&groups);
        assert!(separate as f64 <= 1.25 * best as f64, "seed {seed}: {separate} texels, {best} at best");
        coalesce(&mut groups);
        assert!(texel_count(&groups) <= separate);
        largest = largest.max(texel_count(&groups) as f64 / MAP.area() as f64);
    }
    println!("ten drops send at most {largest:.4} of the map");
    assert!(largest <= 0.1, "{largest:.4} of the map");
}

#[test]
fn a_snake_over_the_date_line_is_grouped_on_both_sides() {
    // Straight along a row over the line: one box on each side.
    let sprites: Vec<Vec<TexelRect>> =
        (0..SPRITES).map(|index| split_box([960.0 + 5.0 * index as f64, 100.5, 9.5, 9.5], MAP)).collect();
    let mut groups = Vec::new();
    group_snake(sprites.iter().map(Vec::as_slice), &mut groups);
    groups.sort();
    let left_end = sprites.last().unwrap()[0].right();
    assert_eq!(groups, [rect(0, 91, left_end, 19), rect(950, 91, 74, 19)]);
}

#[test]
fn a_snake_that_weaves_over_the_date_line_sends_little() {
    for seed in 0..300 {
        let mut random = Pcg32::seed_from_u64(seed);
        let (radius, amplitude) = (random.random_range(3.0..12.0f64), random.random_range(2.0..60.0f64));
        let offset = random.random_range(-0.5..0.5) * amplitude;
        let waves = random.random_range(0.5..3.0);
        let mut x_before = None;
        let mut y = 150.0;
        let sprites: Vec<Vec<TexelRect>> = (0..SPRITES)
            .map(|index| {
                let x = 1024.0 + offset + amplitude * (waves * TAU * index as f64 / SPRITES as f64).sin();
                // As far down as keeps the spacing near half a radius.
                let across: f64 = x - x_before.replace(x).unwrap_or(x);
                y += (0.25 * radius * radius - across * across).max(0.04 * radius * radius).sqrt();
                split_box([x, y, radius, radius], MAP)
            })
            .collect();
        let boxes: Vec<TexelRect> = sprites.concat();
        let mut groups = Vec::new();
        group_snake(sprites.iter().map(Vec::as_slice), &mut groups);
        assert!(covers(&groups, &boxes));
        let widest = groups.iter().map(|group| group.width).max().unwrap();
        assert!(f64::from(widest) <= 2.0 * (amplitude + radius) + 2.0, "seed {seed}: a box of {widest} columns");
        // Against the same snake away from the line: cutting it in two costs little.
        let moved: Vec<TexelRect> = {
            let mut whole = Vec::new();
            for pieces in &sprites {
                let shifted =
                    pieces.iter().map(|piece| rect((piece.x + 512) % 1024, piece.y, piece.width, piece.height));
                whole.push(box_around(&shifted.collect::<Vec<_>>()));
            }
            whole
        };
        let ratio = texel_count(&groups) as f64 / best_texels(&moved) as f64;
        assert!(ratio <= 1.25, "seed {seed}: {ratio}");
    }
}

#[test]
fn a_snake_over_the_pole_does_not_send_the_map() {
    // Full rows while the pole is inside, the far meridian afterwards.
    let mut sprites: Vec<Vec<TexelRect>> =
        (0..10).map(|index| vec![rect(200, 60 - 5 * index, 20 + 3 * index, 12)]).collect();
    sprites.extend((0..4).map(|index| vec![rect(0, 0, 1024, 8 + index % 2)]));
    sprites.extend((0..10).map(|index| vec![rect(712, 3 + 5 * index, 50 - 3 * index, 12)]));
    let boxes = sprites.concat();
    let mut groups = Vec::new();
    group_snake(sprites.iter().map(Vec::as_slice), &mut groups);
    assert!(covers(&groups, &boxes));
    assert!(texel_count(&groups) as f64 <= 1.25 * best_texels(&boxes) as f64);
}

#[test]
fn coalescing_drops_what_is_inside_and_joins_what_fits() {
    let mut rects =
        vec![rect(10, 10, 5, 5), rect(0, 0, 40, 40), rect(40, 0, 7, 40), rect(100, 100, 4, 4), rect(0, 0, 0, 9)];
    coalesce(&mut rects);
    assert_eq!(rects, [rect(0, 0, 47, 40), rect(100, 100, 4, 4)]);
    // Corner to corner they stay apart.
    let apart = [rect(0, 0, 10, 10), rect(9, 9, 10, 10)];
    let mut rects = apart.to_vec();
    coalesce(&mut rects);
    assert_eq!(rects, apart);
}

#[test]
fn a_hundred_drops_stay_few_rectangles() {
    let map = MapSize::from_width(2048);
    let mut random = Pcg32::seed_from_u64(3);
    let (mut groups, mut boxes) = (Vec::new(), Vec::new());
    for _ in 0..100 {
        let (radius_px, spacing) = (random.random_range(3.0..12.0), random.random_range(0.3..1.0));
        let (dx, dy) = (random.random_range(-200.0..1200.0), random.random_range(0.0..300.0));
        let sprites: Vec<Vec<TexelRect>> = trail(Path::Winding, radius_px, spacing, &mut random)
            .into_iter()
            .map(|[x, y, half_width, half_height]| split_box([x + dx, y + dy, half_width, half_height], map))
            .collect();
        group_snake(sprites.iter().map(Vec::as_slice), &mut groups);
        boxes.extend(sprites.concat());
    }
    let mut log = UploadLog::new(map);
    log.push(&groups);
    let Changes::Rects(sent) = log.since(1) else { panic!("far from the whole map") };
    println!(
        "{} boxes of {} texels, {} groups of {}, sent {} of {}",
        boxes.len(),
        texel_count(&boxes),
        groups.len(),
        texel_count(&groups),
        sent.len(),
        texel_count(&sent)
    );
    assert!(sent.len() <= MOST_RECTS);
    assert!(boxes.iter().all(|&one| sent.iter().any(|group| group.contains(one)) || holds_on_map(map, &sent, one)));
    assert!(texel_count(&sent) as f64 <= 1.25 * texel_count(&groups) as f64);
}

/// Whether every texel of a box is in some rectangle.
fn holds_on_map(map: MapSize, rects: &[TexelRect], one: TexelRect) -> bool {
    let one = one.intersection(map.rect());
    (one.y..one.bottom())
        .all(|y| (one.x..one.right()).all(|x| rects.iter().any(|group| group.contains(rect(x, y, 1, 1)))))
}

#[test]
fn what_is_all_over_the_map_sends_the_map_once() {
    let mut random = Pcg32::seed_from_u64(3);
    let map = MapSize::from_width(4096);
    let rects: Vec<TexelRect> =
        (0..3000).map(|_| rect(random.random_range(0..4072), random.random_range(0..2024), 24, 24)).collect();
    let mut log = UploadLog::new(map);
    let seen = log.revision();
    log.push(&rects);
    let sent = log.since(seen).into_rects(map);
    assert!(sent.len() <= MOST_RECTS && texel_count(&sent) <= map.area() as u64);
    assert!(covers(&sent, &rects));
}

#[test]
fn readers_get_what_changed_since_they_looked() {
    let mut log = UploadLog::new(MAP);
    assert_eq!(log.since(0), Changes::All, "who has seen nothing needs all");
    assert_eq!(log.since(log.revision()), Changes::Rects(vec![]));
    assert_eq!(log.since(log.revision() + 5), Changes::All, "a revision of another log");
    let start = log.revision();
    let first = log.push(&[rect(0, 0, 10, 10)]);
    let second = log.push(&[rect(2, 2, 4, 4), rect(500, 500, 40, 40)]);
    assert_eq!(log.push(&[rect(2000, 0, 4, 4), rect(5, 5, 0, 3)]), second, "nothing on the map changed");
    assert_eq!(log.since(second), Changes::Rects(vec![]));
    assert_eq!(log.since(first), Changes::Rects(vec![rect(2, 2, 4, 4), rect(500, 500, 40, 12)]));
    assert_eq!(log.since(start), Changes::Rects(vec![rect(0, 0, 10, 10), rect(500, 500, 40, 12)]));
    for _ in 0..KEPT_STEPS - 2 {
        log.push(&[rect(0, 0, 10, 10)]);
    }
    assert!(matches!(log.since(start), Changes::Rects(_)), "as far back as the log goes");
    log.push(&[rect(0, 0, 10, 10)]);
    assert_eq!(log.since(start), Changes::All, "further back than the log goes");
    assert_eq!(log.since(first), Changes::Rects(vec![rect(0, 0, 10, 10), rect(500, 500, 40, 12)]));
    let seen = log.revision();
    log.push(&[MAP.rect()]);
    assert_eq!(log.since(seen), Changes::All);
    assert_eq!(log.since(seen).into_rects(MAP), [MAP.rect()]);
    let seen = log.reset(MapSize::from_width(64));
    assert_eq!(log.since(seen - 1), Changes::All);
    assert_eq!(log.since(seen), Changes::Rects(vec![]));
}

fn any_rect() -> impl Strategy<Value = TexelRect> {
    (0u32..200, 0u32..100, 0u32..40, 0u32..40).prop_map(|(x, y, width, height)| rect(x, y, width, height))
}

/// One bit per texel of the part of the map that `any_rect` reaches.
fn texels(rects: &[TexelRect]) -> Vec<bool> {
    let mut texels = vec![false; 240 * 140];
    for rect in rects {
        for y in rect.y..rect.bottom() {
            texels[(y * 240 + rect.x) as usize..(y * 240 + rect.right()) as usize].fill(true);
        }
    }
    texels
}

fn holds_all(outer: &[TexelRect], inner: &[TexelRect]) -> bool {
    texels(inner).iter().zip(texels(outer)).all(|(&inner, outer)| !inner || outer)
}

proptest! {
    #[test]
    fn every_box_is_in_a_group(sprites in vec(vec(any_rect(), 0..4), 0..40)) {
        let mut groups = Vec::new();
        group_snake(sprites.iter().map(Vec::as_slice), &mut groups);
        let boxes = sprites.concat();
        prop_assert!(covers(&groups, &boxes.into_iter().filter(|rect| !rect.is_empty()).collect::<Vec<_>>()));
        let area = |rects: &[Vec<TexelRect>]| rects.iter().map(|rects| texel_count(rects)).sum::<u64>();
        prop_assert!(texel_count(&groups) <= area(&sprites), "never more than box by box");
    }

    #[test]
    fn every_box_of_a_portion_is_in_a_group(boxes in vec(any_rect(), 0..40)) {
        let mut groups = Vec::new();
        group(&boxes, &mut groups);
        prop_assert!(covers(&groups, &boxes.iter().copied().filter(|rect| !rect.is_empty()).collect::<Vec<_>>()));
    }

    #[test]
    fn coalescing_keeps_texels_and_never_adds_to_the_total(rects in vec(any_rect(), 0..150), seed in 0u64..1000) {
        let mut coalesced = rects.clone();
        coalesce(&mut coalesced);
        prop_assert!(holds_all(&coalesced, &rects));
        prop_assert!(texel_count(&coalesced) <= texel_count(&rects));
        // In any order.
        let mut shuffled = rects.clone();
        let mut random = Pcg32::seed_from_u64(seed);
        for index in (1..shuffled.len()).rev() {
            shuffled.swap(index, random.random_range(0..=index));
        }
        coalesce(&mut shuffled);
        prop_assert_eq!(shuffled, coalesced);
    }

    #[test]
    fn few_rectangles_are_coalesced_to_the_end(rects in vec(any_rect(), 0..7)) {
        let mut coalesced = rects;
        coalesce(&mut coalesced);
        for (index, a) in coalesced.iter().enumerate() {
            for b in &coalesced[..index] {
                prop_assert!(a.union(*b).area() > a.area() + b.area(), "{a:?} and {b:?}");
            }
        }
    }

    #[test]
    fn limiting_keeps_texels(rects in vec(any_rect(), 0..150), most in 0usize..30) {
        let mut limited = rects.clone();
        limit(&mut limited, most);
        prop_assert!(limited.len() <= most.max(1));
        prop_assert!(holds_all(&limited, &rects));
    }

    #[test]
    fn a_reader_that_skips_steps_misses_nothing(
        steps in vec((vec(any_rect(), 0..6), any::<bool>()), 0..80)
    ) {
        let mut log = UploadLog::new(MAP);
        let (mut seen, mut owed) = (log.revision(), Vec::new());
        for (rects, looks) in steps {
            log.push(&rects);
            owed.extend(rects);
            if looks {
                let sent = log.since(seen).into_rects(MAP);
                prop_assert!(sent.len() <= MOST_RECTS);
                prop_assert!(sent == [MAP.rect()] || holds_all(&sent, &owed));
                seen = log.revision();
                owed.clear();
            }
        }
    }
}
