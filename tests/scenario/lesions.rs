//! Lesions are seen on their organs.

use super::begin;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::reactions::ReactionModel;
use bevy_surgery::scenario::{GoalKind, Lesion, ReadyScenario, RunPhase, ScenarioRun};
use bevy_surgery::testing::TestApp;

/// Opacity of each texel of what is permanent on the liver, the size of the map, and how far it is from the nearest lesion in shares of
/// its radius.
fn looked_at(app: &mut TestApp, lesions: &[Lesion]) -> Vec<(u8, f64)> {
    let mut organs = app.world_mut().query::<(&ReactionModel, &Organ, &OrganShape)>();
    let (reactions, organ, shape) = organs.single(app.world()).expect("one liver");
    let model = app.world().resource::<Assets<OrganModel>>().get(&organ.0).expect("a model");
    let surface = model.surface(shape);
    let place = |uv: glam::DVec2| Some(surface.position_m(model.atlas.locate_uv(uv, &model.table)?));
    let middles: Vec<_> = lesions
        .iter()
        .map(|lesion| (place(lesion.uv.as_dvec2()).expect("on the liver"), f64::from(lesion.radius_m)))
        .collect();
    let size = reactions.size();
    let mut seen = Vec::new();
    for y in 0..size.height_px {
        for x in 0..size.width_px {
            let uv = glam::DVec2::new(
                (f64::from(x) + 0.5) / f64::from(size.width_px),
                (f64::from(y) + 0.5) / f64::from(size.height_px),
            );
            let Some(at) = place(uv) else { continue };
            let away =
                middles.iter().map(|(middle, radius_m)| at.distance(*middle) / radius_m).fold(f64::MAX, f64::min);
            seen.push((reactions.permanent().texel(x, y).0[3], away));
        }
    }
    seen
}

#[test]
fn they_are_where_the_scenario_says_and_nowhere_else() {
    let scenario = ReadyScenario::find("lesions").expect("it is ready").scenario().expect("it is good");
    let mut app = TestApp::cpu();
    app.insert_resource(ScenarioRun::new(scenario));
    begin(&mut app);
    app.step(10);
    let run = app.world().resource::<ScenarioRun>();
    assert_eq!(*run.phase(), RunPhase::Running);
    let lesions: Vec<Lesion> = run
        .scenario()
        .goals
        .iter()
        .find_map(|goal| match &goal.kind {
            GoalKind::Mark { lesions, .. } => Some(lesions.clone()),
            _ => None,
        })
        .expect("lesions to mark");
    let seen = looked_at(&mut app, &lesions);
    let inside: Vec<u8> = seen.iter().filter(|(_, away)| *away < 0.5).map(|(opacity, _)| *opacity).collect();
    assert!(inside.len() > 50 && inside.iter().all(|opacity| *opacity > 100), "{inside:?}");
    let spilt = seen.iter().filter(|(opacity, away)| *opacity > 0 && *away > 1.15).count();
    assert_eq!(spilt, 0, "texels beyond all lesions");
    // Not round: at the rim some of it is ill and some is not.
    let rim: Vec<bool> = seen.iter().filter(|(_, away)| (0.85..0.95).contains(away)).map(|(it, _)| *it > 20).collect();
    assert!(rim.contains(&true) && rim.contains(&false));
    // For good.
    app.step(600);
    assert_eq!(looked_at(&mut app, &lesions), seen);
}
