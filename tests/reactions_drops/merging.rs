//! Drops that meet.

use super::*;

const BLOOD: KindId = KindId::BLOOD;

fn sprite(settings: &DropSettings, point: SurfacePoint, volume_m3: f64, radius_m: f64) -> Sprite {
    let mut sprite = Sprite::default();
    sprite.point = point;
    sprite.volume_m3 = volume_m3;
    sprite.radius_m = if radius_m > 0.0 { radius_m } else { settings.radius_m(volume_m3) } as f32;
    sprite.opacity = 1.0;
    sprite
}

fn blood(id: u64, sprites: impl IntoIterator<Item = Sprite>) -> Snake {
    let mut snake = Snake::default();
    (snake.kind, snake.id, snake.is_active) = (BLOOD, id, true);
    snake.sprites.extend(sprites);
    snake
}

/// Liquid in each sprite of a trail: so little that it changes no radius.
const FILM_M3: f64 = 1e-13;

/// A snake of disks of 2 mm radius on the plane.
fn snake(stage: &Stage, id: u64, head_m3: f64, places_mm: &[(f64, f64)]) -> Snake {
    let settings = DropSettings::default();
    let sprites = places_mm.iter().enumerate().map(|(k, &(x, y))| {
        let point = on_plane(stage, 1e-3 * x, 1e-3 * y);
        if k == 0 { sprite(&settings, point, head_m3, 2e-3) } else { sprite(&settings, point, FILM_M3, 2e-3) }
    });
    blood(id, sprites)
}

fn settle(stage: &Stage, snakes: &mut [Snake]) -> DropCollisions {
    let mut collisions = DropCollisions::default();
    collisions.settle(&stage.surface(), &DropSettings::default(), BLOOD, snakes);
    collisions
}

fn volume_m3(snakes: &[Snake]) -> f64 {
    snakes.iter().map(Snake::volume_m3).sum()
}

#[test]
fn the_larger_head_swallows_the_smaller() {
    let stage = plane(30, DQuat::IDENTITY);
    let settings = DropSettings::default();
    let mut snakes =
        [snake(&stage, 1, 3e-9, &[(0.0, 0.0), (20.0, 0.0)]), snake(&stage, 2, 9e-9, &[(2.0, 0.0), (20.0, 20.0)])];
    snakes[0].velocity_m_per_s = DVec3::new(0.0, 0.4, 0.0);
    snakes[1].velocity_m_per_s = DVec3::new(0.2, 0.0, 0.0);
    let collisions = settle(&stage, &mut snakes);
    assert_eq!((collisions.merges, collisions.cancelled_sprites), (1, 0));
    assert_eq!(collisions.is_wet, [false, true]);
    assert!(!snakes[0].is_active && snakes[1].is_active);
    assert!((snakes[1].sprites[0].volume_m3 - 12e-9).abs() < 1e-22);
    assert!((f64::from(snakes[1].sprites[0].radius_m) - settings.radius_m(12e-9)).abs() < 1e-9);
    assert!(snakes[1].velocity_m_per_s.distance(DVec3::new(0.15, 0.1, 0.0)) < 1e-12);
    assert_eq!((snakes[0].sprites[0].volume_m3, snakes[0].sprites[1].volume_m3), (0.0, FILM_M3));
    assert!(snakes[0].sprites[0].is_cancelled && !snakes[0].sprites[1].is_cancelled);
    // The trail that is left can be run over, the swallowed head cannot.
    assert_eq!(settle(&stage, &mut snakes).merges, 0);
}

#[test]
fn of_equal_heads_the_older_swallows() {
    let stage = plane(30, DQuat::IDENTITY);
    for swap in [false, true] {
        let mut snakes = [snake(&stage, 5, 4e-9, &[(0.0, 0.0)]), snake(&stage, 9, 4e-9, &[(1.0, 1.0)])];
        if swap {
            snakes.swap(0, 1);
        }
        assert_eq!(settle(&stage, &mut snakes).merges, 1);
        assert!(snakes.iter().all(|snake| snake.is_active == (snake.id == 5)));
    }
}

#[test]
fn heads_meet_where_their_disks_share_enough() {
    let stage = plane(30, DQuat::IDENTITY);
    let share = DropSettings::default().contact_share;
    for (distance_mm, merges) in [(4.0 * share - 0.01, 1), (4.0 * share + 0.01, 0)] {
        let mut snakes = [snake(&stage, 1, 4e-9, &[(0.0, 0.0)]), snake(&stage, 2, 4e-9, &[(0.0, distance_mm)])];
        assert_eq!(settle(&stage, &mut snakes).merges, merges, "{distance_mm} mm");
    }
}

#[test]
fn a_tail_is_cancelled_from_where_it_is_met() {
    let stage = plane(30, DQuat::IDENTITY);
    // A trail along X, its head ahead at 30 mm; the other comes down on it at 10 mm.
    let trail: Vec<(f64, f64)> = (0..31).map(|k| (30.0 - f64::from(k), 0.0)).collect();
    let head_m3 = DropSettings::default().volume_m3(2e-3);
    let mut snakes =
        [snake(&stage, 1, 8e-9, &trail), snake(&stage, 2, head_m3, &[(10.0, 2.0), (10.0, 4.0), (10.0, 6.0)])];
    snakes[1].velocity_m_per_s = DVec3::new(0.0, -0.1, 0.0);
    let before_m3 = volume_m3(&snakes);
    let collisions = settle(&stage, &mut snakes);
    // Within 2.8 mm: those at 12 mm down to 8 mm, and all that is older.
    let youngest = trail.iter().position(|&(x, _)| (x - 10.0f64).hypot(2.0) < 2.8).unwrap();
    assert_eq!((collisions.merges, collisions.cancelled_sprites), (0, 31 - youngest));
    assert_eq!(collisions.is_wet, [false, true]);
    for (k, sprite) in snakes[0].sprites.iter().enumerate() {
        assert_eq!(sprite.is_cancelled, k >= youngest, "sprite {k}");
        assert_eq!(sprite.volume_m3 == 0.0, k >= youngest, "sprite {k}");
    }
    assert!(snakes[0].is_active && snakes[1].is_active);
    assert!((snakes[1].sprites[0].volume_m3 - head_m3 - (31 - youngest) as f64 * FILM_M3).abs() < 1e-22);
    assert!((volume_m3(&snakes) / before_m3 - 1.0).abs() < 1e-12);
    // Cancelled sprites do not collide again; what lies just ahead still is wet ground.
    let again = settle(&stage, &mut snakes);
    assert_eq!((again.cancelled_sprites, again.is_wet), (0, vec![false, true]));
}

#[test]
fn a_drop_follows_on_wet_ground_until_it_meets_the_other() {
    let stage = plane(30, DQuat::IDENTITY);
    let trail: Vec<(f64, f64)> = (0..31).map(|k| (30.0 - f64::from(k), 0.0)).collect();
    let mut snakes = [snake(&stage, 1, 8e-9, &trail), snake(&stage, 2, 9e-9, &[(0.0, 0.0)])];
    let before_m3 = volume_m3(&snakes);
    for step in 0..400 {
        let x_mm = 0.1 * f64::from(step);
        snakes[1].sprites[0].point = on_plane(&stage, 1e-3 * x_mm, 0.0);
        let collisions = settle(&stage, &mut snakes);
        assert!((volume_m3(&snakes) / before_m3 - 1.0).abs() < 1e-12);
        if collisions.merges > 0 {
            assert!((24.0..29.0).contains(&x_mm), "at {x_mm} mm");
            assert!(!snakes[0].is_active && snakes[1].is_active);
            assert!((snakes[1].sprites[0].volume_m3 / before_m3 - 1.0).abs() < 1e-12);
            return;
        }
        assert!(collisions.is_wet[1], "dry at {x_mm} mm");
    }
    panic!("they never met");
}

#[test]
fn nobody_meets_its_own_trail_other_liquids_or_the_other_side() {
    let stage = plane(30, DQuat::IDENTITY);
    let mut snakes =
        [snake(&stage, 1, 8e-9, &[(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)]), snake(&stage, 2, 9e-9, &[(0.0, 0.0)])];
    snakes[1].kind = KindId::WHITENING;
    let collisions = settle(&stage, &mut snakes);
    assert_eq!((collisions.merges, collisions.cancelled_sprites), (0, 0));
    assert_eq!(collisions.is_wet, [false, false]);

    // A leaf a tenth of a millimetre thick, with a drop on either side.
    let leaf = Stage::star_shaped(&procedural_ellipsoid(Vec3::new(0.05, 0.05, 5e-5), 12));
    let settings = DropSettings::default();
    let drop =
        |id: u64, side: f64| blood(id, [sprite(&settings, leaf.towards(DVec3::new(1e-4, 1e-4, side)), 8e-9, 0.0)]);
    let mut both = [drop(1, 1e-4), drop(2, -1e-4)];
    assert!(leaf.position_m(both[0].sprites[0].point).distance(leaf.position_m(both[1].sprites[0].point)) < 5e-4);
    assert_eq!(settle(&leaf, &mut both).merges, 0);
    assert_eq!(settle(&leaf, &mut [drop(1, 1e-4), drop(2, 1.1e-4)]).merges, 1);
}

#[test]
fn senseless_sprites_do_not_collide() {
    let stage = plane(30, DQuat::IDENTITY);
    let sound = || snake(&stage, 1, 8e-9, &[(0.0, 0.0), (1.0, 0.0)]);
    let with = |change: fn(&mut Sprite)| {
        let mut snakes = [sound(), snake(&stage, 2, 9e-9, &[(0.0, 0.0), (30.0, 0.0)])];
        change(&mut snakes[1].sprites[0]);
        let collisions = settle(&stage, &mut snakes);
        assert!(snakes[0].sprites[0].volume_m3.is_finite() && snakes[0].velocity_m_per_s.is_finite());
        (collisions.merges, collisions.cancelled_sprites)
    };
    assert_eq!(with(|_| ()), (1, 1));
    assert_eq!(with(|sprite| sprite.radius_m = f32::NAN), (0, 0));
    assert_eq!(with(|sprite| sprite.radius_m = 0.0), (0, 0));
    assert_eq!(with(|sprite| sprite.point.face = u32::MAX), (0, 0));
    assert_eq!(with(|sprite| sprite.point.barycentric = DVec3::NAN), (0, 0));
    assert_eq!(with(|sprite| sprite.volume_m3 = f64::NAN).0, 1);
    assert_eq!(with(|sprite| sprite.radius_m = f32::INFINITY).0, 1);
    let mut empty = [sound(), blood(2, [])];
    assert_eq!(settle(&stage, &mut empty).merges, 0);
    assert_eq!(settle(&stage, &mut []).is_wet, [false; 0]);
}

/// Snakes at random places of a liver, crowded enough to meet.
fn crowd(stage: &Stage, seed: u64, snakes: usize, sprites: usize) -> Vec<Snake> {
    let settings = DropSettings::default();
    let mut rng = Pcg32::seed_from_u64(seed);
    (0..snakes)
        .map(|id| {
            let mut point = random_point(&mut rng, stage.faces() as usize);
            let mut ahead = DVec3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), 0.5);
            let sprites: Vec<Sprite> = (0..rng.random_range(0..=sprites))
                .map(|_| {
                    let volume_m3 = rng.random_range(0.0..2e-8);
                    let made = sprite(&settings, point, volume_m3, 0.0);
                    let walked = walk(&stage.surface(), point, ahead.normalize() * 2e-3).unwrap();
                    (point, ahead) = (walked.point, walked.direction);
                    made
                })
                .collect();
            let mut snake = blood(id as u64, sprites);
            snake.velocity_m_per_s = ahead * rng.random_range(0.0..0.1);
            snake.is_active = rng.random_bool(0.8);
            snake
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn crowds_keep_their_volume_and_meet_as_by_brute_force(seed in any::<u64>(), count in 0usize..60) {
        let stage = &*LIVER;
        let surface = stage.surface();
        let mut snakes = crowd(stage, seed, count, 30);
        let before = snakes.clone();
        let mut collisions = DropCollisions::default();
        for round in 0..3 {
            let start = snakes.clone();
            collisions.settle(&surface, &DropSettings::default(), BLOOD, &mut snakes);
            let (first_m3, now_m3) = (volume_m3(&before), volume_m3(&snakes));
            prop_assert!((now_m3 - first_m3).abs() <= 1e-12 * first_m3);
            let count = |snakes: &[Snake]| snakes.iter().filter(|snake| snake.head().is_some()).count();
            prop_assert_eq!(count(&start) - count(&snakes), collisions.merges);
            for (k, snake) in snakes.iter().enumerate().filter(|(_, snake)| snake.head().is_some()) {
                // Heads do not move in here, so what was in reach can be told from before.
                let own = &start[k].sprites[0];
                let reaches = |sprite: &Sprite, share: f64| {
                    let reach_m = share * f64::from(own.radius_m + sprite.radius_m);
                    let apart_m = surface.position_m(own.point).distance(surface.position_m(sprite.point));
                    !sprite.is_cancelled
                        && apart_m < reach_m
                        && surface.normal(own.point).dot(surface.normal(sprite.point)) > 0.0
                };
                let tails = |other: &Snake| if other.is_active { 1 } else { 0 };
                let others = || start.iter().enumerate().filter(|&(other, _)| other != k);
                let is_wet = others().any(|(_, other)| other.sprites.iter().any(|sprite| reaches(sprite, 1.0)));
                prop_assert_eq!(collisions.is_wet[k], is_wet, "round {}, snake {}", round, k);
                for (other, was) in others() {
                    let met = was.sprites.iter().skip(tails(was)).position(|s| reaches(s, 0.7));
                    let Some(met) = met else { continue };
                    let rest = snakes[other].sprites.iter().skip(met + tails(was));
                    prop_assert!(rest.clone().all(|sprite| sprite.is_cancelled && sprite.volume_m3 == 0.0));
                }
                // No two heads are left in contact, unless one grew.
                let meets_head = others().any(|(other, was)| {
                    snakes[other].is_active && was.is_active && was.sprites.front().is_some_and(|s| reaches(s, 0.7))
                });
                prop_assert!(!meets_head, "round {}, snake {}", round, k);
                prop_assert!(snake.velocity_m_per_s.is_finite());
            }
        }
        // The order in which they are kept means nothing.
        let mut backwards: Vec<Snake> = before.iter().rev().cloned().collect();
        for _ in 0..3 {
            collisions.settle(&surface, &DropSettings::default(), BLOOD, &mut backwards);
        }
        backwards.reverse();
        prop_assert_eq!(format!("{snakes:?}"), format!("{backwards:?}"));
    }
}
