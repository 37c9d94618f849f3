//! What ready scenarios ask for is where trainees look.

use super::begin;
use bevy::prelude::*;
use bevy_surgery::organ::pick::OrganPicker;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::{
    GoalKind, PatientEventKind, READY_SCENARIOS, Scenario, ScenarioEye, ScenarioRun, ScenarioScene,
};
use bevy_surgery::testing::TestApp;

/// Half of the angle that an `Endoscope` sees, which is there with the feature `render`.
const HALF_VIEW_RAD: f64 = 30.0 / 180.0 * std::f64::consts::PI;

/// Places of an organ that are to be treated, and how far they reach, metres.
fn places(scenario: &Scenario) -> Vec<(Vec2, f32)> {
    let lesions = scenario.goals.iter().filter_map(|goal| match &goal.kind {
        GoalKind::Mark { lesions, .. } | GoalKind::Coagulate { lesions, .. } => Some(lesions),
        _ => None,
    });
    let wounds = scenario.events.iter().map(|event| {
        let PatientEventKind::Bleed { uv, .. } = &event.what;
        (*uv, 0.0)
    });
    lesions.flatten().map(|lesion| (lesion.uv, lesion.radius_m)).chain(wounds).collect()
}

#[test]
fn of_every_patient() {
    let on_liver = READY_SCENARIOS.map(|ready| ready.scenario().expect("it is good"));
    let on_liver: Vec<Scenario> = on_liver.into_iter().filter(|it| it.scene == ScenarioScene::Liver).collect();
    assert_eq!(on_liver.len(), 2);
    let mut app = TestApp::cpu();
    app.insert_resource(ScenarioRun::new(on_liver[0].clone()));
    begin(&mut app);
    let mut eyes = app.world_mut().query_filtered::<&Transform, With<ScenarioEye>>();
    let eye = *eyes.single(app.world()).expect("one eye");
    let mut organs = app.world_mut().query::<(&Organ, &OrganShape, &OrganPicker)>();
    let (organ, shape, picker) = organs.single(app.world()).expect("one liver");
    let model = app.world().resource::<Assets<OrganModel>>().get(&organ.0).expect("a model");
    let surface = model.surface(shape);
    let eye_m = eye.translation.as_dvec3();
    for scenario in &on_liver {
        for seed in 0..40 {
            for (uv, radius_m) in places(&scenario.for_patient(seed)) {
                let which = format!("{}, patient {seed}, {uv}", scenario.name);
                let point = model.atlas.locate_uv(uv.as_dvec2(), &model.table).expect("a place");
                let to_m = surface.position_m(point) - eye_m;
                let along = to_m.normalize();
                let facing = -surface.normal(point).dot(along);
                assert!(facing > 0.4, "{which} is turned away: {facing}");
                let aside_rad = eye.forward().as_dvec3().angle_between(along) + f64::from(radius_m) / to_m.length();
                assert!(aside_rad < HALF_VIEW_RAD, "{which} is out of view: {aside_rad} rad");
                let hit = picker.cast_ray(eye_m, along, 1.0).expect("it is met");
                assert!((hit.distance_m - to_m.length()).abs() < 1e-4, "{which} is hidden: {}", hit.distance_m);
            }
        }
    }
}
