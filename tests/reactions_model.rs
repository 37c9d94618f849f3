//! Reactions of an organ in the ECS: bleeding, pressing, burning, and everything that can go wrong.

use crate::support::{place_towards, sphere_organ, told};
use bevy::ecs::message::Messages;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::prelude::*;
use bevy_surgery::reactions::ReactionFault;
use bevy_surgery::reactions::drops::{DropFate, DropHead, walk};
use bevy_surgery::reactions::kind::{Ageing, Motion, SpriteFate, SpriteLook};
use bevy_surgery::reactions::kinds::Blood;
use bevy_surgery::reactions::regions::Changes;
use bevy_surgery::reactions::snake::Sprite;
use bevy_surgery::testing::TestApp;
use std::time::Duration;

const RADIUS_M: f32 = 0.1;

/// An app with a reacting sphere.
fn bleeding_app(name: &str) -> (TestApp, Entity) {
    // Listens from now on.
    told("");
    let mut app = TestApp::cpu();
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
    let organ = app.world_mut().spawn((Organ(organ), Reactions::default(), Name::new(name.to_string()))).id();
    app.idle_until("the organ", |app| app.world().get::<ReactionModel>(organ).is_some());
    (app, organ)
}

fn touch(app: &mut TestApp, organ: Entity, direction: DVec3, action: ReactionAction) {
    let point = place_towards(app, organ, direction);
    app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
}

fn reactions(app: &TestApp, organ: Entity) -> &ReactionModel {
    app.world().get::<ReactionModel>(organ).expect("a reacting organ")
}

fn assert_nothing_shows(model: &ReactionModel) {
    assert!(model.map().colour().iter().all(|texel| *texel == [0; 4]));
    assert!(model.map().gloss().iter().all(|&gloss| gloss == 128));
}

#[test]
fn a_drop_rolls_down_and_leaves_a_wet_trail() {
    let (mut app, organ) = bleeding_app("rolling");
    touch(&mut app, organ, DVec3::new(0.6, 0.8, 0.1), ReactionAction::Bleed { volume_m3: 1.2e-8 });
    app.step(120);
    let model = reactions(&app, organ);
    let [snake] = model.snakes() else { panic!("{} snakes", model.snakes().len()) };
    assert!(snake.sprites.len() > 5, "a trail of {} sprites", snake.sprites.len());
    let handle = app.world().get::<Organ>(organ).expect("an organ").0.clone();
    let organ_model = app.world().resource::<Assets<OrganModel>>().get(&handle).expect("loaded");
    let surface = organ_model.surface(app.world().get::<OrganShape>(organ).expect("a shape"));
    let heights: Vec<f64> = snake.sprites.iter().map(|sprite| surface.position_m(sprite.point).y).collect();
    assert!(heights.windows(2).all(|pair| pair[0] < pair[1] + 1e-9), "the head is lowest: {heights:?}");
    // Wet under the head, and along the trail.
    for sprite in &snake.sprites {
        let uv = organ_model.atlas.uv(sprite.point);
        let size = model.size();
        let at = (uv.y * f64::from(size.height_px)) as usize * size.width_px as usize
            + (uv.x * f64::from(size.width_px)) as usize;
        assert!(model.map().gloss()[at] > 140, "gloss {}", model.map().gloss()[at]);
        assert!(model.map().colour()[at][3] > 60, "{:?}", model.map().colour()[at]);
    }
}

#[test]
fn no_liquid_appears_or_vanishes() {
    let (mut app, organ) = bleeding_app("volume");
    for k in 0..10 {
        let angle = f64::from(k) * 0.7;
        let direction = DVec3::new(0.4 * angle.cos(), 1.0, 0.4 * angle.sin());
        let wound = Wound { rate_m3_per_s: 1.7e-8, clotting_time_s: 5.0, drop_volume_m3: 6e-9 };
        touch(&mut app, organ, direction, ReactionAction::Wound(wound));
    }
    for _ in 0..25 {
        app.step(60);
        let model = reactions(&app, organ);
        let tally = *model.tally();
        let known = model.volume_m3() + tally.fallen_m3 + tally.dried_m3 + tally.lost_m3;
        assert!((known / tally.bled_m3 - 1.0).abs() < 1e-9, "{known} of {} m3: {tally:?}", tally.bled_m3);
    }
    let tally = reactions(&app, organ).tally();
    // Ten wounds: a drop of 6 uL at once, then 17 uL/s that fall to 1/e in 5 s. Less than a drop stays in each.
    let wanted = 10.0 * 1.7e-8 * 5.0;
    let most = 1.01 * wanted + 10.0 * 6e-9;
    assert!((0.98 * wanted..most).contains(&tally.bled_m3), "{} of {wanted} m3", tally.bled_m3);
    assert!(tally.merged_drops + tally.cancelled_sprites > 0 && tally.fallen_drops > 0, "{tally:?}");
    assert!(reactions(&app, organ).wounds().is_empty(), "clotted");
}

/// Heads after every step.
#[derive(Resource, Default, PartialEq, Debug)]
struct Paths(Vec<Vec<(u64, SurfacePoint)>>);

#[test]
fn paths_do_not_depend_on_the_frame_rate() {
    let paths = |frames_per_second: f64| {
        let (mut app, organ) = bleeding_app("pace");
        let points: Vec<SurfacePoint> =
            (0..6).map(|k| place_towards(&app, organ, DVec3::new(0.1 * f64::from(k) - 0.25, 1.0, 0.15))).collect();
        let mut step = 0_usize;
        let bleed = move |mut touches: MessageWriter<OrganTouch>| {
            if let Some(&point) = points.get(step / 5).filter(|_| step.is_multiple_of(5)) {
                let action = ReactionAction::Bleed { volume_m3: 8e-9 + 1e-9 * step as f64 };
                touches.write(OrganTouch { organ, point, instrument: 0, action });
            }
            step += 1;
        };
        let watch = move |mut paths: ResMut<Paths>, models: Query<&ReactionModel>| {
            let snakes = models.iter().flat_map(ReactionModel::snakes);
            paths.0.push(snakes.filter_map(|snake| Some((snake.id, snake.head()?.point))).collect());
        };
        app.init_resource::<Paths>()
            .add_systems(FixedUpdate, bleed.in_set(SurgerySystems::Touch))
            .add_systems(FixedUpdate, watch.in_set(SurgerySystems::Judge));
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / frames_per_second)));
        while app.world().resource::<Paths>().0.len() < 180 {
            app.update();
        }
        assert_eq!(app.world().resource::<Pacing>().lost_s, 0.0);
        let mut paths = std::mem::take(&mut *app.world_mut().resource_mut::<Paths>());
        paths.0.truncate(180);
        paths
    };
    let at_60 = paths(60.0);
    assert!(at_60.0.iter().any(|heads| heads.len() > 3), "some drops are on their way");
    for rate in [10.0, 25.0, 240.0] {
        assert!(paths(rate) == at_60, "other paths at {rate} frames per second");
    }
}

#[test]
fn pressed_skin_turns_pale_and_recovers_without_a_trace() {
    let (mut app, organ) = bleeding_app("pale");
    let up = DVec3::new(0.3, 1.0, 0.2);
    for _ in 0..60 {
        touch(&mut app, organ, up, ReactionAction::Press { pressure: 1.0, radius_m: 0.012 });
        app.step(1);
    }
    let model = reactions(&app, organ);
    let opacity = model.map().colour().iter().map(|texel| texel[3]).max();
    assert!(opacity > Some(130), "{opacity:?}");
    assert_eq!(model.snakes().len(), 1, "one snake is kept up");
    app.step(60);
    let half = reactions(&app, organ).map().colour().iter().map(|texel| texel[3]).max();
    assert!(half < opacity && half > Some(20), "{half:?} after a second");
    app.step(60 * 20);
    assert_nothing_shows(reactions(&app, organ));
    assert!(reactions(&app, organ).snakes().is_empty());
    assert_eq!(reactions(&app, organ).permanent().tiles_in_use(), 0);
}

#[test]
fn burns_stay_and_close_wounds() {
    let (mut app, organ) = bleeding_app("burn");
    let up = DVec3::new(0.2, 1.0, 0.1);
    touch(&mut app, organ, up, ReactionAction::Wound(Wound { clotting_time_s: 1e9, ..default() }));
    app.step(30);
    assert_eq!(reactions(&app, organ).wounds().len(), 1);
    for _ in 0..180 {
        touch(&mut app, organ, up, ReactionAction::Cauterize(Cautery::coagulate(45.0)));
        app.step(1);
    }
    let model = reactions(&app, organ);
    assert!(model.wounds().is_empty() && model.tally().sealed_wounds == 1, "{:?}", model.tally());
    assert!(model.permanent().tiles_in_use() > 0);
    app.step(60 * 60);
    let model = reactions(&app, organ);
    let darkest = model.map().colour().iter().filter(|texel| texel[3] > 200).map(|texel| texel[0]).min();
    assert!(darkest < Some(70), "charred to {darkest:?}");
    let dullest = model.map().gloss().iter().min();
    assert!(dullest < Some(&60), "burnt skin is dull: {dullest:?}");
    assert_eq!(model.heat().hot_tiles(), 0, "it has cooled");
}

#[test]
fn film_stains_only_where_it_is_asked_to() {
    let opaque_in_the_end = |stains: bool| {
        let (mut app, organ) = bleeding_app("stain");
        let blood = Blood { stains, fading_time_s: 0.5, longest: 6, ..default() };
        app.world_mut().resource_mut::<ReactionKinds>().replace(KindId::BLOOD, blood);
        touch(&mut app, organ, DVec3::new(0.5, 0.8, 0.1), ReactionAction::Bleed { volume_m3: 4e-8 });
        app.step(60 * 60);
        let model = reactions(&app, organ);
        assert_eq!(model.snakes().iter().filter(|snake| snake.is_active).count(), 0, "it fell off");
        let seen = model.map().colour().iter().filter(|texel| texel[3] > 0).count();
        (seen, model.tally().baked_sprites)
    };
    let (seen, baked) = opaque_in_the_end(true);
    assert!(seen > 20 && baked > 3, "{seen} texels of {baked} sprites");
    assert_eq!(opaque_in_the_end(false), (0, 0));
}

#[test]
fn of_too_many_touches_the_newest_are_kept() {
    let (mut app, organ) = bleeding_app("many touches");
    for k in 0..100 {
        let direction = DVec3::new(0.01 * f64::from(k), 1.0, 0.0);
        touch(&mut app, organ, direction, ReactionAction::Bleed { volume_m3: 1e-9 * (1.0 + f64::from(k)) });
    }
    app.step(1);
    let model = reactions(&app, organ);
    assert_eq!(model.tally().dropped_touches, 68);
    let wanted: f64 = (68..100).map(|k| 1e-9 * (1.0 + f64::from(k))).sum();
    assert!((model.tally().bled_m3 / wanted - 1.0).abs() < 1e-9);
    assert_eq!(told("many touches").len(), 1);
}

#[test]
fn every_changed_texel_is_uploaded() {
    let (mut app, organ) = bleeding_app("uploads");
    let mut revision = reactions(&app, organ).uploads().revision();
    let mut before = reactions(&app, organ).map().clone();
    let mut sent = 0_u64;
    for step in 0..400_u32 {
        let angle = f64::from(step) * 0.02;
        if step % 20 == 0 && step < 200 {
            // At the date line, at a pole, and elsewhere.
            let direction = DVec3::new(0.3 * angle.sin(), 1.0, 0.3 * angle.cos());
            touch(&mut app, organ, direction, ReactionAction::Bleed { volume_m3: 1e-8 });
        }
        if (50..150).contains(&step) {
            let direction = DVec3::new(0.05 * angle.sin(), 0.2, 1.0);
            let action = ReactionAction::Cauterize(Cautery::coagulate(40.0));
            touch(&mut app, organ, direction, action);
        }
        if (200..260).contains(&step) {
            touch(&mut app, organ, DVec3::new(0.1, 1.0, 0.0), ReactionAction::Press { pressure: 0.8, radius_m: 0.02 });
        }
        app.step(1);
        let model = reactions(&app, organ);
        let size = model.size();
        let Changes::Rects(rects) = model.uploads().since(revision) else { panic!("only a step has passed") };
        sent += rects.iter().map(|rect| rect.area()).sum::<u64>();
        let changed = |place: usize| {
            model.map().colour()[place] != before.colour()[place] || model.map().gloss()[place] != before.gloss()[place]
        };
        for place in (0..size.area()).filter(|&place| changed(place)) {
            let (x, y) = (place as u32 % size.width_px, place as u32 / size.width_px);
            let is_sent = rects.iter().any(|r| (r.x..r.right()).contains(&x) && (r.y..r.bottom()).contains(&y));
            assert!(is_sent, "step {step}: texel {x},{y} is in none of {} rectangles", rects.len());
        }
        revision = model.uploads().revision();
        before = model.map().clone();
    }
    let full = 400 * reactions(&app, organ).size().area() as u64;
    assert!(sent > 0 && sent < full / 10, "{sent} of {full} texels");
}

#[test]
fn what_rests_costs_no_uploads() {
    let (mut app, organ) = bleeding_app("rest");
    touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(40.0)));
    app.step(60 * 60);
    let revision = reactions(&app, organ).uploads().revision();
    app.step(60);
    assert_eq!(reactions(&app, organ).uploads().revision(), revision);
}

#[test]
fn the_same_scene_gives_the_same_bits() {
    let map = || {
        let (mut app, organ) = bleeding_app("bits");
        for step in 0..200_u32 {
            if step % 10 == 0 {
                let direction = DVec3::new(0.02 * f64::from(step % 50), 1.0, 0.1);
                touch(&mut app, organ, direction, ReactionAction::Bleed { volume_m3: 9e-9 });
            }
            touch(&mut app, organ, DVec3::new(-0.3, 1.0, 0.3), ReactionAction::Cauterize(Cautery::blend(30.0)));
            app.step(1);
        }
        reactions(&app, organ).map().clone()
    };
    assert!(map() == map());
}

/// A kind of a user: a spot of bile that runs east at a steady pace and grows.
struct Bile;

impl ReactionKind for Bile {
    fn name(&self) -> &str {
        "bile"
    }

    fn profile(&self, _: f32) -> f32 {
        1.0
    }

    fn look(&self, sprite: &Sprite) -> SpriteLook {
        SpriteLook { colour: [60, 120, 20], gloss: 255, opacity: (255.0 * sprite.opacity) as u8 }
    }

    fn age(&self, sprite: &mut Sprite, ageing: &Ageing) -> SpriteFate {
        sprite.radius_m += 1e-3 * ageing.dt_s;
        if sprite.age_s > 2.0 { SpriteFate::Bakes } else { SpriteFate::Stays }
    }

    fn move_head(&self, head: &mut DropHead, motion: &Motion) -> DropFate {
        let way = DVec3::new(0.01, 0.0, 0.0) * motion.dt_s;
        match walk(motion.surface, head.point, way) {
            Ok(walked) => {
                head.point = walked.point;
                DropFate::Slides { distance_m: walked.distance_m }
            }
            Err(_) => DropFate::Lost,
        }
    }
}

#[test]
fn a_kind_of_a_user_ages_moves_and_bakes() {
    let (mut app, organ) = bleeding_app("bile");
    let kind = app.add_reaction_kind(Bile);
    touch(&mut app, organ, DVec3::Y, ReactionAction::Start { kind, radius_m: 0.003, volume_m3: 0.0 });
    app.step(60);
    let model = reactions(&app, organ);
    let [snake] = model.snakes() else { panic!("{} snakes", model.snakes().len()) };
    let head = snake.head().expect("it lives");
    assert!((head.radius_m - 0.004).abs() < 1e-4, "{}", head.radius_m);
    // A centimetre in a second along the flat faces; projected, a little less.
    let moved = place_towards(&app, organ, DVec3::Y);
    assert!(head.point.face != moved.face && snake.sprites.len() > 5, "{} sprites", snake.sprites.len());
    app.step(180);
    let model = reactions(&app, organ);
    assert!(model.snakes().is_empty() && model.tally().baked_sprites > 5, "{:?}", model.tally());
    assert!(model.map().colour().contains(&[60, 120, 20, 255]), "it stays visible");
    // The id of a kind that nobody registered.
    let mut others = ReactionKinds::default();
    others.register(Bile);
    let stranger = others.register(Bile);
    touch(&mut app, organ, DVec3::Y, ReactionAction::Start { kind: stranger, radius_m: 0.003, volume_m3: 0.0 });
    app.step(1);
    assert_eq!(reactions(&app, organ).faults().collect::<Vec<_>>(), [ReactionFault::UnknownKind]);
}

#[test]
fn bad_touches_are_left_out_and_told_once() {
    let (mut app, organ) = bleeding_app("bad touches");
    let good = place_towards(&app, organ, DVec3::Y);
    let nowhere = SurfacePoint { face: u32::MAX, ..good };
    let no_number = SurfacePoint { barycentric: DVec3::new(f64::NAN, 0.5, 0.5), ..good };
    for _ in 0..3 {
        for point in [nowhere, no_number] {
            for action in [
                ReactionAction::Bleed { volume_m3: 1e-8 },
                ReactionAction::Press { pressure: 1.0, radius_m: 0.01 },
                ReactionAction::Cauterize(Cautery::coagulate(30.0)),
            ] {
                app.world_mut().write_message(OrganTouch { organ, point, instrument: 1, action });
            }
        }
        app.step(1);
    }
    assert_eq!(told("bad touches").len(), 1, "{:?}", told("bad touches"));
    assert!(reactions(&app, organ).is_blank());
    for size in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e30] {
        for action in [
            ReactionAction::Bleed { volume_m3: size },
            ReactionAction::Wound(Wound { rate_m3_per_s: size, drop_volume_m3: size, clotting_time_s: size as f32 }),
            ReactionAction::Press { pressure: size as f32, radius_m: size as f32 },
            ReactionAction::Press { pressure: 1.0, radius_m: size as f32 },
            ReactionAction::Cauterize(Cautery { power_w: size, duty_cycle: size, spot_radius_m: size }),
            ReactionAction::Start { kind: KindId::WHITENING, radius_m: size as f32, volume_m3: size },
        ] {
            app.world_mut().write_message(OrganTouch { organ, point: good, instrument: 2, action });
        }
        app.step(2);
    }
    let model = reactions(&app, organ);
    let faults: Vec<ReactionFault> = model.faults().collect();
    assert_eq!(faults, [ReactionFault::BadPlace, ReactionFault::BadSize], "and each of them once");
    assert_eq!(told("bad touches").len(), 2, "{:?}", told("bad touches"));
    assert!(model.snakes().iter().flat_map(|snake| &snake.sprites).all(|s| s.radius_m <= 0.1 && s.opacity.is_finite()));
    app.step(600);
    assert!(reactions(&app, organ).volume_m3().is_finite());
}

#[test]
fn vertices_that_are_no_numbers_lose_drops_and_nothing_else() {
    let (mut app, organ) = bleeding_app("nan vertices");
    for k in 0..5 {
        let direction = DVec3::new(0.2 * f64::from(k), 1.0, 0.1);
        touch(&mut app, organ, direction, ReactionAction::Bleed { volume_m3: 1e-8 });
    }
    app.step(30);
    let mut shape = app.world_mut().get_mut::<OrganShape>(organ).expect("a shape");
    shape.move_vertices().fill(Vec3::NAN);
    for _ in 0..10 {
        touch(&mut app, organ, DVec3::Y, ReactionAction::Cauterize(Cautery::coagulate(30.0)));
        touch(&mut app, organ, DVec3::Y, ReactionAction::Press { pressure: 1.0, radius_m: 0.01 });
        app.step(5);
    }
    let model = reactions(&app, organ);
    let tally = *model.tally();
    assert!(tally.lost_m3 > 0.0 && model.drop_count(app.world().resource::<ReactionKinds>()) == 0, "{tally:?}");
    let known = model.volume_m3() + tally.fallen_m3 + tally.dried_m3 + tally.lost_m3;
    assert!((known / tally.bled_m3 - 1.0).abs() < 1e-9);
    assert_eq!(told("nan vertices").len(), 2, "{:?}", told("nan vertices"));
    // It comes back, and bleeds again.
    let rest = procedural_ellipsoid(Vec3::splat(RADIUS_M), 12).positions_m;
    let mut shape = app.world_mut().get_mut::<OrganShape>(organ).expect("a shape");
    shape.move_vertices().copy_from_slice(&rest);
    app.step(2);
    touch(&mut app, organ, DVec3::Y, ReactionAction::Bleed { volume_m3: 1e-8 });
    app.step(5);
    assert_eq!(reactions(&app, organ).drop_count(app.world().resource::<ReactionKinds>()), 1);
}

#[test]
fn a_despawned_organ_is_told_of_once() {
    let (mut app, organ) = bleeding_app("despawned");
    let point = place_towards(&app, organ, DVec3::Y);
    app.world_mut().despawn(organ);
    for _ in 0..5 {
        let action = ReactionAction::Bleed { volume_m3: 1e-8 };
        app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
        app.step(2);
    }
    let about = told(&format!("a touch names {organ}"));
    assert_eq!(about.len(), 1, "{about:?}");
}

#[test]
fn an_organ_that_is_exchanged_while_it_bleeds_begins_anew() {
    let (mut app, organ) = bleeding_app("exchanged");
    touch(&mut app, organ, DVec3::new(0.5, 1.0, 0.0), ReactionAction::Wound(Wound::default()));
    app.step(90);
    assert!(!reactions(&app, organ).is_blank());
    let smaller = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.05));
    app.world_mut().entity_mut(organ).insert(Organ(smaller));
    app.step(3);
    let model = reactions(&app, organ);
    assert!(model.is_blank() && model.wounds().is_empty() && model.sprite_count() == 0);
    assert_nothing_shows(model);
    touch(&mut app, organ, DVec3::new(0.5, 1.0, 0.0), ReactionAction::Bleed { volume_m3: 5e-9 });
    app.step(30);
    assert_eq!(reactions(&app, organ).tally().bled_m3, 5e-9);
    // Another size of the map as well.
    app.world_mut().get_mut::<Reactions>(organ).expect("it reacts").map_width_px = 512;
    app.step(2);
    assert_eq!(reactions(&app, organ).size().width_px, 512);
    assert_eq!(told("exchanged").len(), 2, "{:?}", told("exchanged"));
}

#[test]
fn a_hundred_thousand_sprites_stay_within_bounds() {
    let (mut app, organ) = bleeding_app("crowd");
    let mut settings = app.world_mut().get_mut::<Reactions>(organ).expect("it reacts");
    (settings.max_sprites, settings.max_touches_per_step) = (500, u32::MAX);
    let points: Vec<SurfacePoint> = (0..1000)
        .map(|k| {
            let (turn, height) = (f64::from(k) * 2.4, f64::from(k) / 500.0 - 1.0);
            let ring = (1.0 - height * height).sqrt();
            place_towards(&app, organ, DVec3::new(ring * turn.cos(), height, ring * turn.sin()))
        })
        .collect();
    for round in 0..100 {
        let kind = if round % 2 == 0 { KindId::BLOOD } else { KindId::WHITENING };
        for &point in &points {
            let action = ReactionAction::Start { kind, radius_m: 0.002, volume_m3: 3e-9 };
            app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
        }
        app.step(1);
        assert!(reactions(&app, organ).sprite_count() <= 500);
    }
    let model = reactions(&app, organ);
    assert_eq!(told("crowd").len(), 1, "{:?}", told("crowd"));
    let tally = *model.tally();
    let known = model.volume_m3() + tally.fallen_m3 + tally.dried_m3 + tally.lost_m3;
    assert!((known / tally.bled_m3 - 1.0).abs() < 1e-9, "{known} of {}", tally.bled_m3);
    let waiting = app.world().resource::<Messages<OrganTouch>>().len();
    assert!(waiting <= 2 * points.len(), "{waiting} messages");
}

#[test]
fn a_fall_is_told_to_others() {
    #[derive(Resource, Default)]
    struct Fallen(Vec<OrganReacted>);
    let (mut app, organ) = bleeding_app("fall");
    app.init_resource::<Fallen>();
    let listen = |mut events: MessageReader<OrganReacted>, mut fallen: ResMut<Fallen>| fallen.0.extend(events.read());
    app.add_systems(FixedUpdate, listen.in_set(SurgerySystems::Flow));
    // A big drop under an overhang.
    touch(&mut app, organ, DVec3::new(0.3, -1.0, 0.0), ReactionAction::Bleed { volume_m3: 2e-7 });
    app.step(30);
    let fallen = &app.world().resource::<Fallen>().0;
    let [OrganReacted { organ: whose, event: ReactionEvent::DropFell { volume_m3, position_m, .. } }] = fallen[..]
    else {
        panic!("{fallen:?}")
    };
    assert_eq!(whose, organ);
    assert!(position_m.y < 0.0 && (position_m.length() / f64::from(RADIUS_M) - 1.0).abs() < 0.02);
    let tally = reactions(&app, organ).tally();
    assert_eq!((tally.fallen_drops, tally.fallen_m3), (1, volume_m3));
}
