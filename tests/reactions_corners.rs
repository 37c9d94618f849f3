//! Reactions in corners that scenes get into: several instruments at once, settings and kinds exchanged while they are in
//! use, copies, odd kinds of users, and random scenes.

use crate::support::{place_towards, sphere_organ, told};
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::reactions::burn::BurnRamp;
use bevy_surgery::reactions::drops::{DropFate, DropHead, DropSettings};
use bevy_surgery::reactions::kind::{Ageing, Motion, SpriteFate, SpriteLook};
use bevy_surgery::reactions::kinds::Blood;
use bevy_surgery::reactions::snake::Sprite;
use bevy_surgery::testing::TestApp;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

fn app_with(settings: Reactions) -> (TestApp, Entity) {
    told("");
    let mut app = TestApp::cpu();
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.1));
    let organ = app.world_mut().spawn((Organ(organ), settings)).id();
    app.idle_until("the organ", |app| app.world().get::<ReactionModel>(organ).is_some());
    (app, organ)
}

fn touch(app: &mut TestApp, organ: Entity, direction: DVec3, action: ReactionAction) {
    let point = place_towards(app, organ, direction);
    app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
}

fn model(app: &TestApp, organ: Entity) -> &ReactionModel {
    app.world().get::<ReactionModel>(organ).expect("it reacts")
}

/// Heat that has come so far, joules, of an organ that does not cool in the meantime.
fn heat_j(app: &TestApp, organ: Entity) -> f64 {
    let heat = model(app, organ).heat();
    heat.total_energy_j() + heat.vented_energy_j()
}

/// A copy of the map that follows only the upload log, as the GPU does.
struct Follower {
    revision: u64,
    colour: Vec<[u8; 4]>,
    gloss: Vec<u8>,
}

impl Follower {
    fn new(model: &ReactionModel) -> Self {
        let map = model.map();
        Self { revision: model.uploads().revision(), colour: map.colour().to_vec(), gloss: map.gloss().to_vec() }
    }

    fn follow(&mut self, model: &ReactionModel) {
        let width = model.size().width_px;
        for rect in model.uploads().since(self.revision).into_rects(model.size()) {
            for y in rect.y..rect.bottom() {
                for x in rect.x..rect.right() {
                    let place = (y * width + x) as usize;
                    self.colour[place] = model.map().colour()[place];
                    self.gloss[place] = model.map().gloss()[place];
                }
            }
        }
        self.revision = model.uploads().revision();
    }

    fn stale(&self, model: &ReactionModel) -> usize {
        let is_stale = |place: &usize| {
            self.colour[*place] != model.map().colour()[*place] || self.gloss[*place] != model.map().gloss()[*place]
        };
        (0..self.colour.len()).filter(is_stale).count()
    }
}

#[test]
fn a_slow_drag_of_a_probe_leaves_a_fading_trail() {
    let (mut app, organ) = app_with(default());
    let press = ReactionAction::Press { pressure: 1.0, radius_m: 0.008 };
    // A second in one place, then 2 cm/s.
    let mut most = 0;
    for step in 0..150_u32 {
        let way_m = 0.02 * f64::from(step.saturating_sub(60)) / 60.0;
        touch(&mut app, organ, DVec3::new(way_m / 0.1, 1.0, 0.1), press.clone());
        app.step(1);
        assert_eq!(model(&app, organ).snakes().len(), 1, "one probe, one snake");
        most = most.max(model(&app, organ).sprite_count());
    }
    assert!(most > 4, "{most} sprites along three centimetres");
}

/// A burn that stays for a while.
struct Lingering;

impl ReactionKind for Lingering {
    fn name(&self) -> &str {
        "lingering"
    }

    fn profile(&self, _: f32) -> f32 {
        1.0
    }

    fn look(&self, _: &Sprite) -> SpriteLook {
        default()
    }

    fn age(&self, sprite: &mut Sprite, _: &Ageing) -> SpriteFate {
        if sprite.age_s > 0.5 { SpriteFate::Ends } else { SpriteFate::Stays }
    }
}

#[test]
fn heat_is_laid_once() {
    let heat = |is_replaced: bool| {
        let (mut app, organ) = app_with(default());
        if is_replaced {
            app.world_mut().resource_mut::<ReactionKinds>().replace(KindId::CAUTERIZATION, Lingering);
        }
        touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(30.0)));
        app.step(15);
        heat_j(&app, organ)
    };
    let (own, other) = (heat(false), heat(true));
    assert!((other / own - 1.0).abs() < 0.01, "{other} J instead of {own}");
}

#[test]
fn heat_narrower_than_a_texel_arrives() {
    let (mut app, organ) = app_with(Reactions { map_width_px: 128, ..default() });
    for k in 0..40 {
        let angle = f64::from(k) * 0.157;
        let before = heat_j(&app, organ);
        let direction = DVec3::new(angle.cos(), 0.3 * (7.0 * angle).sin(), angle.sin());
        let cautery = Cautery::cut(40.0);
        touch(&mut app, organ, direction, ReactionAction::Cauterize(cautery));
        app.step(1);
        let arrived = (heat_j(&app, organ) - before) / cautery.heat_j(1.0 / 60.0);
        // What is there cools by half a per cent in the meantime.
        assert!(arrived > 0.7, "touch {k}: {arrived} of the heat");
        app.step(300);
    }
}

#[test]
fn an_instrument_may_press_and_burn_at_once() {
    let (mut app, organ) = app_with(default());
    for _ in 0..60 {
        touch(&mut app, organ, DVec3::Y, ReactionAction::Press { pressure: 1.0, radius_m: 0.01 });
        touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(5.0)));
        app.step(1);
        assert_eq!(model(&app, organ).snakes().len(), 1, "one pale spot");
    }
    // Along a fast stroke, heat is laid between the touches whether it presses or not.
    let warm = |presses: bool| {
        let (mut app, organ) = app_with(default());
        for k in 0..30 {
            let direction = DVec3::new(f64::from(k) * 0.05, 1.0, 0.0);
            if presses {
                touch(&mut app, organ, direction, ReactionAction::Press { pressure: 1.0, radius_m: 0.01 });
            }
            touch(&mut app, organ, direction, ReactionAction::Cauterize(Cautery::coagulate(200.0)));
            app.step(1);
        }
        let size = model(&app, organ).size();
        let texels = (0..size.height_px).flat_map(|y| (0..size.width_px).map(move |x| (x, y)));
        let heat = model(&app, organ).heat();
        texels.filter(|&(x, y)| heat.temperature_rise_k(x, y) > 5.0).count()
    };
    let (alone, both) = (warm(false), warm(true));
    assert!(alone > 300 && both == alone, "{alone} warm texels, {both} when it presses as well");
}

#[test]
fn a_short_move_of_the_surface_is_measured() {
    let (mut app, organ) = app_with(default());
    touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(5.0)));
    app.step(34);
    for _ in 0..5 {
        let mut shape = app.world_mut().get_mut::<OrganShape>(organ).expect("a shape");
        shape.move_vertices().iter_mut().for_each(|place| *place *= 2.0_f32.powf(0.2));
        app.step(1);
    }
    app.step(120);
    let hottest = |app: &TestApp, organ: Entity| {
        let size = model(app, organ).size();
        let texels = (0..size.height_px).flat_map(|y| (0..size.width_px).map(move |x| (x, y)));
        texels.map(|(x, y)| model(app, organ).heat().temperature_rise_k(x, y)).fold(0.0, f32::max)
    };
    // The first touch has left a little.
    let before = hottest(&app, organ);
    touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(5.0)));
    app.step(1);
    let measured = hottest(&app, organ) - before;
    // The same touch on an organ of that size from the start.
    let (mut fresh, other) = app_with(default());
    let mut shape = fresh.world_mut().get_mut::<OrganShape>(other).expect("a shape");
    shape.move_vertices().iter_mut().for_each(|place| *place *= 2.0);
    fresh.step(1);
    touch(&mut fresh, other, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(5.0)));
    fresh.step(1);
    let wanted = hottest(&fresh, other);
    // With the old areas it would be four times as hot.
    assert!((measured / wanted - 1.0).abs() < 0.15, "{measured} K instead of {wanted}");
}

#[test]
fn taking_reactions_away_takes_the_model_away() {
    let (mut app, organ) = app_with(default());
    touch(&mut app, organ, DVec3::Y, ReactionAction::Wound(default()));
    app.step(5);
    app.world_mut().entity_mut(organ).remove::<Reactions>();
    app.step(5);
    assert!(app.world().get::<ReactionModel>(organ).is_none());
}

#[test]
fn a_restored_copy_is_told_from_the_one_that_went_on() {
    let (mut app, organ) = app_with(default());
    touch(&mut app, organ, DVec3::new(0.5, 1.0, 0.1), ReactionAction::Bleed { volume_m3: 2e-8 });
    app.step(5);
    let saved = model(&app, organ).clone();
    app.step(2);
    assert_ne!(saved.number(), model(&app, organ).number());
}

#[test]
fn a_ramp_without_burns_hides_them() {
    let (mut app, organ) = app_with(default());
    for _ in 0..60 {
        touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(40.0)));
        app.step(1);
    }
    app.step(600);
    let seen = |app: &TestApp| model(app, organ).map().colour().iter().filter(|texel| texel[3] > 0).count();
    assert!(seen(&app) > 0);
    app.world_mut().get_mut::<Reactions>(organ).expect("it reacts").burns = BurnRamp::from_stops(&[]);
    app.step(3);
    assert_eq!(seen(&app), 0);
    app.world_mut().get_mut::<Reactions>(organ).expect("it reacts").burns = BurnRamp::default();
    app.step(3);
    assert!(seen(&app) > 0, "the dose was kept");
}

/// Blood with hard edges.
struct Flat(Blood);

impl ReactionKind for Flat {
    fn name(&self) -> &str {
        "flat"
    }

    fn profile(&self, _: f32) -> f32 {
        1.0
    }

    fn look(&self, sprite: &Sprite) -> SpriteLook {
        self.0.look(sprite)
    }

    fn age(&self, sprite: &mut Sprite, ageing: &Ageing) -> SpriteFate {
        self.0.age(sprite, ageing)
    }

    fn liquid(&self) -> Option<&DropSettings> {
        self.0.liquid()
    }
}

#[test]
fn a_kind_that_is_replaced_is_shown_and_sent() {
    let (mut app, organ) = app_with(default());
    for k in 0..6 {
        let direction = DVec3::new(0.02 * f64::from(k), 1.0, 0.0);
        touch(&mut app, organ, direction, ReactionAction::Bleed { volume_m3: 3e-9 });
    }
    app.step(30);
    let mut follower = Follower::new(model(&app, organ));
    let before = model(&app, organ).map().clone();
    app.world_mut().resource_mut::<ReactionKinds>().replace(KindId::BLOOD, Flat(Blood::default()));
    app.step(2);
    assert!(*model(&app, organ).map() != before, "other profiles look otherwise");
    follower.follow(model(&app, organ));
    // Something else repaints the same tiles.
    touch(&mut app, organ, DVec3::new(0.08, 1.0, 0.0), ReactionAction::Press { pressure: 1.0, radius_m: 0.002 });
    app.step(20);
    follower.follow(model(&app, organ));
    assert_eq!(follower.stale(model(&app, organ)), 0);
    // A list without it: what was of that kind goes.
    let kind = app.add_reaction_kind(Flat(Blood::default()));
    touch(&mut app, organ, DVec3::Z, ReactionAction::Start { kind, radius_m: 0.0, volume_m3: 1e-8 });
    app.step(5);
    app.insert_resource(ReactionKinds::default());
    app.step(2);
    assert!(model(&app, organ).snakes().iter().all(|snake| snake.kind != kind));
    follower.follow(model(&app, organ));
    assert_eq!(follower.stale(model(&app, organ)), 0);
}

#[test]
fn bad_places_take_no_share_of_the_heat() {
    let (mut app, organ) = app_with(default());
    let good = place_towards(&app, organ, DVec3::Y);
    let cautery = Cautery::coagulate(30.0);
    for point in [good, SurfacePoint { face: u32::MAX, ..good }] {
        let action = ReactionAction::Cauterize(cautery);
        app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
    }
    app.step(1);
    let arrived = heat_j(&app, organ) / cautery.heat_j(1.0 / 60.0);
    assert!(arrived > 0.9, "{arrived} of the heat");
}

#[test]
fn a_speck_of_blood_is_only_film() {
    let (mut app, organ) = app_with(default());
    touch(&mut app, organ, DVec3::new(1.0, 0.2, 0.0), ReactionAction::Bleed { volume_m3: 1e-12 });
    app.step(60 * 180);
    assert!(model(&app, organ).snakes().is_empty(), "{:?}", model(&app, organ).snakes());
}

#[test]
fn no_pressure_and_no_power_are_no_faults() {
    let (mut app, organ) = app_with(default());
    touch(&mut app, organ, DVec3::Y, ReactionAction::Press { pressure: 0.0, radius_m: 0.01 });
    touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(0.0)));
    app.step(1);
    assert_eq!(model(&app, organ).faults().count(), 0);
}

#[test]
fn visible_film_beyond_the_budget_is_baked() {
    let (mut app, organ) = app_with(Reactions { max_sprites: 20, ..default() });
    for k in 0..8 {
        let direction = DVec3::new(0.8, 0.6, 0.2 * f64::from(k));
        touch(&mut app, organ, direction, ReactionAction::Bleed { volume_m3: 2e-8 });
    }
    app.step(120);
    assert!(model(&app, organ).tally().baked_sprites > 0, "{:?}", model(&app, organ).tally());
}

#[test]
fn a_stain_that_stays_is_dry() {
    let (mut app, organ) = app_with(default());
    app.world_mut().resource_mut::<ReactionKinds>().replace(KindId::BLOOD, Blood { longest: 6, ..default() });
    touch(&mut app, organ, DVec3::new(0.5, 0.8, 0.1), ReactionAction::Bleed { volume_m3: 4e-8 });
    app.step(60 * 180);
    let model = model(&app, organ);
    assert!(model.snakes().is_empty() && model.tally().baked_sprites > 3, "{:?}", model.tally());
    assert_eq!(model.map().gloss().iter().max(), Some(&128));
}

#[test]
fn a_grown_drop_stays_within_bounds() {
    // The lower inner side of a hollow sphere fills with blood.
    let (mut app, organ) = app_with(default());
    app.world_mut().entity_mut(organ).insert(Hollow);
    let wound = Wound { rate_m3_per_s: 1e-4, clotting_time_s: 0.0, drop_volume_m3: 1e-6 };
    touch(&mut app, organ, DVec3::new(0.05, -1.0, 0.0), ReactionAction::Wound(wound));
    app.step(600);
    let sprites = model(&app, organ).snakes().iter().flat_map(|snake| &snake.sprites);
    let widest_m = sprites.map(|sprite| sprite.radius_m).fold(0.0, f32::max);
    assert!(widest_m <= 0.05 && model(&app, organ).volume_m3() > 5e-4, "{widest_m} m");
}

/// A kind that says nonsense.
struct Mad;

impl ReactionKind for Mad {
    fn name(&self) -> &str {
        "mad"
    }

    fn profile(&self, _: f32) -> f32 {
        f32::NAN
    }

    fn look(&self, _: &Sprite) -> SpriteLook {
        SpriteLook { opacity: 255, ..default() }
    }

    fn age(&self, sprite: &mut Sprite, _: &Ageing) -> SpriteFate {
        sprite.radius_m *= if sprite.age_s > 0.3 { f32::NAN } else { 2.0 };
        sprite.opacity = f32::INFINITY;
        SpriteFate::Stays
    }

    fn move_head(&self, head: &mut DropHead, motion: &Motion) -> DropFate {
        if motion.surface.position_m(head.point).x > 0.05 {
            head.point.face = u32::MAX;
        }
        DropFate::Slides { distance_m: f64::NAN }
    }
}

#[test]
fn nonsense_of_a_users_kind_does_not_spread() {
    let (mut app, organ) = app_with(default());
    let kind = app.add_reaction_kind(Mad);
    for direction in [DVec3::X, DVec3::Y] {
        touch(&mut app, organ, direction, ReactionAction::Start { kind, radius_m: 0.01, volume_m3: 0.0 });
    }
    app.step(60);
    let sprites = model(&app, organ).snakes().iter().flat_map(|snake| &snake.sprites);
    assert!(sprites.into_iter().all(|sprite| (0.0..=0.05).contains(&sprite.radius_m)));
}

#[test]
fn random_scenes_keep_uploads_and_volumes_right() {
    for seed in 0..6_u64 {
        let settings = Reactions {
            max_sprites: if seed % 2 == 0 { 60 } else { 8192 },
            map_width_px: if seed == 5 { 64 } else { 512 },
            ..default()
        };
        let (mut app, organ) = app_with(settings);
        if seed % 3 == 0 {
            app.world_mut().entity_mut(organ).insert(Hollow);
        }
        let mut random = Pcg32::seed_from_u64(seed);
        let mut follower = Follower::new(model(&app, organ));
        for step in 0..300_u32 {
            for instrument in 0..3 {
                let mut share = || random.random::<f64>();
                let [a, b, c, size, what] = std::array::from_fn(|_| share());
                let aside = DVec3::new(a, b, c) - 0.5;
                let direction = if what < 0.5 { DVec3::new(0.05 * aside.x, 1.0, 0.05 * aside.z) } else { aside };
                let point = place_towards(&app, organ, direction);
                let action = match (what * 1000.0) as u32 % 7 {
                    0 => ReactionAction::Bleed { volume_m3: 1e-10 + 5e-8 * size },
                    1 => ReactionAction::Press { pressure: a as f32, radius_m: 0.03 * size as f32 + 1e-4 },
                    2 => ReactionAction::Cauterize(Cautery::coagulate(60.0 * size)),
                    3 if step % 20 == 0 => ReactionAction::Wound(Wound::default()),
                    _ => continue,
                };
                app.world_mut().write_message(OrganTouch { organ, point, instrument, action });
            }
            if seed >= 3 && step % 7 == 0 {
                let factor = if step % 14 == 0 { 1.05 } else { 1.0 / 1.05 };
                let mut shape = app.world_mut().get_mut::<OrganShape>(organ).expect("a shape");
                shape.move_vertices().iter_mut().for_each(|place| place.y *= factor);
            }
            app.step(1);
            let model = model(&app, organ);
            follower.follow(model);
            assert_eq!(follower.stale(model), 0, "seed {seed} step {step}");
            let tally = *model.tally();
            let known = model.volume_m3() + tally.fallen_m3 + tally.dried_m3 + tally.lost_m3;
            assert!((known - tally.bled_m3).abs() <= 1e-9 * tally.bled_m3, "seed {seed} step {step}: {tally:?}");
        }
    }
}
