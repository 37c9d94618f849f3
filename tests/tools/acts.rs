//! What tools do to what they touch.

use super::*;
use bevy_surgery::tools::tool_number;

/// Presses a tool onto the top of the organ for some steps, one after another with a pedal each.
fn press(app: &mut TestApp, tool: Entity, pedals: &[f32]) {
    for &pedal in pedals {
        let radius_m = app.world().get::<Tool>(tool).expect("a tool").tip_radius_m();
        hold(app, tool, Vec3::Y * (RADIUS_M + radius_m - 2e-3), pedal);
        app.step(1);
    }
}

#[test]
fn a_probe_presses_the_blood_out() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    press(&mut app, tool, &[0.0; 3]);
    let touches = written::<OrganTouch>(&app);
    let [touch] = &touches[..] else { panic!("one touch a step, not {touches:?}") };
    assert_eq!((touch.organ, touch.instrument), (organ, tool_number(tool)));
    let ReactionAction::Press { pressure, .. } = touch.action else { panic!("it presses: {touch:?}") };
    // 2 mm into a liver of 250 N/m are half a newton.
    assert!((0.3..0.6).contains(&pressure), "{pressure}");
}

#[test]
fn an_electrode_burns_while_a_pedal_is_down() {
    let (mut app, organ) = with_organ();
    let kind = ToolKind::CauteryHook(Electrodes { coagulation: Cautery::coagulate(20.0), cut: Cautery::cut(40.0) });
    let tool = app.world_mut().spawn(Tool::new(kind)).id();
    press(&mut app, tool, &[0.0, 0.3]);
    assert!(written::<OrganTouch>(&app).is_empty(), "the pedal is not down");
    assert_eq!(app.world().get::<ToolWork>(tool), Some(&ToolWork::Idle));
    press(&mut app, tool, &[1.0; 10]);
    let Some(&ToolWork::Burning { water: wet, heat }) = app.world().get::<ToolWork>(tool) else { panic!("it burns") };
    assert!(wet > 0.3 && heat > 0.3, "{wet} {heat}");
    press(&mut app, tool, &[1.0; 100]);
    let Some(&ToolWork::Burning { water: dry, .. }) = app.world().get::<ToolWork>(tool) else { panic!("it burns") };
    assert!(dry < 0.2, "after two seconds it is char: {dry}");
    let reactions = app.world().get::<ReactionModel>(organ).expect("it reacts");
    assert!(reactions.heat().total_energy_j() + reactions.heat().vented_energy_j() > 1.0);
    // The second pedal cuts.
    app.world_mut().entity_mut(tool).insert(ToolCommand { second_pedal: 1.0, ..default() });
    app.step(1);
    let touches = written::<OrganTouch>(&app);
    let [OrganTouch { action: ReactionAction::Cauterize(cut), .. }] = &touches[..] else { panic!("{touches:?}") };
    assert_eq!(cut.duty_cycle, 1.0);
}

#[test]
fn a_needle_bites_once_per_thrust() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::BiopsyNeedle(Wound::default()))).id();
    press(&mut app, tool, &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.8, 0.9, 0.0]);
    let reactions = app.world().get::<ReactionModel>(organ).expect("it reacts");
    assert_eq!(reactions.wounds().len(), 2);
    // Jaws that close bite as well.
    app.world_mut().entity_mut(tool).insert(ToolCommand { grip: 1.0, ..default() });
    app.step(2);
    assert_eq!(app.world().get::<ReactionModel>(organ).expect("it reacts").wounds().len(), 3);
}

#[test]
fn a_drill_turns_with_its_pedal_and_removes_more_when_pressed_harder() {
    let mut removed = Vec::new();
    for force_n in [0.0, 1.0, 4.0] {
        let (mut app, bone) = with_bone(Transform::IDENTITY);
        let tool = app.world_mut().spawn(drill()).id();
        let force = ToolForce { drilling_n: Some(force_n), is_known: true, ..default() };
        app.world_mut().entity_mut(tool).insert(force);
        for step in 0..30 {
            hold(&mut app, tool, Vec3::new(-5.0, 0.0, 1.0) * 1e-3, if step < 5 { 0.0 } else { 0.5 });
            app.step(1);
        }
        let strokes = written::<DrillVolume>(&app);
        let [stroke] = &strokes[..] else { panic!("one stroke a step, not {strokes:?}") };
        assert_eq!((stroke.volume, stroke.tool, stroke.speed_rpm), (bone, Some(tool), 30_000.0));
        assert_eq!((stroke.force_n, stroke.begins_stroke), (force_n, false));
        let Some(&ToolWork::Drilling { speed_rpm, force_n: felt_n, hardness, .. }) = app.world().get::<ToolWork>(tool)
        else {
            panic!("it drills")
        };
        assert_eq!(speed_rpm, 30_000.0);
        if contacts(&app, tool).of(bone, ToolPart::Tip).is_some() {
            assert_eq!((felt_n, hardness), (force_n, 1.0));
        }
        removed.push(app.world().get::<RemovedTissue>(bone).expect("counted").total_mm3());
    }
    assert_eq!(removed[0], 0.0);
    assert!(removed[1] > 0.1 && removed[2] > 1.5 * removed[1], "{removed:?}");
}

#[test]
fn a_sucker_sucks_with_its_pedal() {
    let (mut app, _) = with_bone(Transform::IDENTITY);
    let tool = app.world_mut().spawn(Tool::new(ToolKind::SuctionIrrigator)).id();
    hold(&mut app, tool, Vec3::Z * 5e-3, 0.0);
    app.step(2);
    let is_sucking = |app: &TestApp| app.world().get::<SuctionIrrigator>(tool).expect("it has one").is_sucking;
    assert!(!is_sucking(&app));
    hold(&mut app, tool, Vec3::Z * 5e-3, 1.0);
    app.step(1);
    assert!(is_sucking(&app));
    assert!(matches!(app.world().get::<ToolWork>(tool), Some(ToolWork::Sucking { .. })));
    app.world_mut().entity_mut(tool).insert(ToolPose::default());
    app.step(1);
    assert!(!is_sucking(&app), "a tool that is away sucks nothing");
}

#[test]
fn a_grasper_lifts_a_soft_organ() {
    let (mut app, organ) = with_organ();
    let models = app.world().resource::<Assets<OrganModel>>();
    let model = models.get(&app.world().get::<Organ>(organ).expect("an organ").0).expect("a model");
    let lattice = DeformLattice::around_organ(model, 2, 0.02).expect("a lattice");
    let mut body = ElasticBody::of_organ(&lattice, model, ElasticTissue::LIVER)
        .expect("a body")
        .pinned_where(|rest_m| rest_m.y < -0.03);
    body.rests_under_m_per_s2 = app.world().resource::<SurgeryGravity>().world_m_per_s2;
    app.world_mut().entity_mut(organ).insert((lattice, body));
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Grasper(Jaws::default()))).id();
    let top = |app: &TestApp| {
        let shape = app.world().get::<OrganShape>(organ).expect("a shape");
        shape.positions_m().iter().map(|position| position.y).fold(0.0, f32::max)
    };
    let grip = |app: &mut TestApp, y_m: f32, grip: f32| {
        hold(app, tool, Vec3::Y * y_m, 0.0);
        app.world_mut().entity_mut(tool).insert(ToolCommand { grip, ..default() });
        app.step(1);
    };
    for _ in 0..3 {
        grip(&mut app, RADIUS_M, 0.0);
    }
    for step in 0..60 {
        grip(&mut app, RADIUS_M + 1e-4 * step as f32, 1.0);
    }
    assert!(top(&app) > RADIUS_M + 3e-3, "lifted by 6 mm, it follows: {}", top(&app));
    for _ in 0..60 {
        grip(&mut app, RADIUS_M + 0.02, 0.0);
    }
    assert!(top(&app) < RADIUS_M + 1e-3, "let go of, it falls back: {}", top(&app));
}
