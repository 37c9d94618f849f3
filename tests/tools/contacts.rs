//! Where tools are, and what they touch.

use super::*;
use bevy_surgery::tools::ToolLimits;

#[test]
fn poses_that_are_none_are_left_out_and_counted() {
    let (mut app, _) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    hold(&mut app, tool, Vec3::X, 0.0);
    app.step(1);
    for (tip_m, rotation) in [
        (Vec3::NAN, Quat::IDENTITY),
        (Vec3::new(0.0, f32::INFINITY, 0.0), Quat::IDENTITY),
        (Vec3::X, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        (Vec3::X, Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0)),
    ] {
        app.world_mut().entity_mut(tool).insert(ToolPose::at(tip_m, rotation));
        app.step(1);
        assert_eq!(motion(&app, tool).to.expect("it stays").tip_in_world_m, Vec3::X);
    }
    assert_eq!((motion(&app, tool).dropped_poses, motion(&app, tool).jumps), (4, 0));
    let transform = app.world().get::<Transform>(tool).expect("a transform");
    assert_eq!(transform.translation, Vec3::X);
    assert!((transform.rotation * Vec3::Z).abs_diff_eq(Vec3::Y, 1e-6), "the shaft goes up");
    app.world_mut().entity_mut(tool).insert(ToolPose::default());
    app.step(1);
    assert_eq!((motion(&app, tool).to, motion(&app, tool).from), (None, None));
}

#[test]
fn a_jump_is_no_motion() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    hold(&mut app, tool, Vec3::Y * 0.2, 0.0);
    app.step(1);
    // 0.4 m within a sixtieth of a second are 24 m/s.
    hold(&mut app, tool, Vec3::Y * -0.2, 0.0);
    app.step(1);
    assert_eq!(motion(&app, tool).jumps, 1);
    assert_eq!(motion(&app, tool).from, None);
    assert_eq!(contacts(&app, tool).of(organ, ToolPart::Tip), None, "what lies between was not passed");
    app.world_mut().insert_resource(ToolLimits { max_speed_m_per_s: 50.0 });
    hold(&mut app, tool, Vec3::Y * 0.2, 0.0);
    app.step(1);
    let passed = contacts(&app, tool).of(organ, ToolPart::Tip).copied();
    assert!(passed.is_some(), "a fast tool touches what lies on its way");
    assert_eq!(motion(&app, tool).jumps, 1);
}

#[test]
fn a_tip_touches_an_organ_where_it_is() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    let radius_m = app.world().get::<Tool>(tool).expect("a tool").tip_radius_m();
    let out = Vec3::new(0.3, 0.8, -0.4).normalize();
    for (depth_mm, touches) in [(-0.5, false), (0.5, true), (2.0, true), (4.0, true)] {
        let tip_m = out * (RADIUS_M + radius_m - depth_mm * 1e-3);
        app.world_mut().entity_mut(tool).insert(ToolPose::with_shaft_towards(tip_m, tip_m + out));
        app.step(1);
        let contacts = contacts(&app, tool);
        assert_eq!(contacts.near, [organ]);
        let Some(contact) = contacts.of(organ, ToolPart::Tip) else {
            assert!(!touches, "{depth_mm} mm");
            continue;
        };
        // The ball is made of triangles, whose middles lie 0.4 mm inside.
        assert!(touches && (contact.depth_m * 1e3 - depth_mm).abs() < 0.4, "{} for {depth_mm}", contact.depth_m * 1e3);
        assert!(contact.normal_world.dot(out) > 0.99, "{}", contact.normal_world);
        assert!(contact.point_world_m.abs_diff_eq(out * RADIUS_M, 5e-4), "{}", contact.point_world_m);
        let ContactMatter::Organ { point, uv } = contact.matter else { panic!("an organ was touched") };
        let models = app.world().resource::<Assets<OrganModel>>();
        let model = models.get(&app.world().get::<Organ>(organ).expect("an organ").0).expect("a model");
        let shape = app.world().get::<OrganShape>(organ).expect("a shape");
        let at_m = model.surface(shape).position_m(point).as_vec3();
        assert!(at_m.abs_diff_eq(contact.point_world_m, 1e-6));
        assert!(model.atlas.uv(point).as_vec2().abs_diff_eq(uv, 1e-6));
        let expected_n = SurfaceFeel::LIVER.stiffness_n_per_m as f32 * contact.depth_m;
        assert!((contact.force_n - expected_n).abs() < 1e-4);
    }
}

#[test]
fn a_fast_tip_never_tunnels() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::BiopsyNeedle(default()))).id();
    // 4.8 m/s: 80 mm in a step, and the organ is 100 mm thick; with a chord near its rim it is much thinner.
    for x_mm in [0.0, 30.0, 47.0, 49.5] {
        let at = |y_mm: f32| Vec3::new(x_mm, y_mm, 0.0) * 1e-3;
        hold(&mut app, tool, at(75.0), 0.0);
        app.step(1);
        app.world_mut().entity_mut(tool).insert(ToolPose { is_tracked: false, ..default() });
        app.step(1);
        hold(&mut app, tool, at(70.0), 0.0);
        app.step(1);
        assert!(contacts(&app, tool).list.is_empty(), "{x_mm} mm");
        hold(&mut app, tool, at(-10.0), 0.0);
        app.step(1);
        let contact = contacts(&app, tool).of(organ, ToolPart::Tip).copied();
        let contact = contact.unwrap_or_else(|| panic!("{x_mm} mm from the middle it went through"));
        // Where it only grazes the rim it has left it again.
        let grazes = x_mm > 45.0;
        assert!(grazes || contact.normal_world.y > -1e-3, "it came from above: {}", contact.normal_world);
    }
}

#[test]
fn a_shaft_touches_too() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    let radius_m = app.world().get::<Tool>(tool).expect("a tool").geometry.shaft_radius_m;
    // A rod along X above the ball: its tip is far beyond, its middle on the ball.
    let tip_m = Vec3::new(-0.1, RADIUS_M + radius_m - 1.5e-3, 0.0);
    app.world_mut().entity_mut(tool).insert(ToolPose::with_shaft_towards(tip_m, tip_m + Vec3::X));
    app.step(1);
    let contacts = contacts(&app, tool);
    assert_eq!(contacts.of(organ, ToolPart::Tip), None);
    let contact = contacts.of(organ, ToolPart::Shaft).expect("the shaft lies on it");
    assert!((contact.depth_m - 1.5e-3).abs() < 4e-4, "{} m", contact.depth_m);
    assert!(contact.normal_world.y > 0.99 && contact.point_world_m.x.abs() < 4e-3);
    // A scope touches nothing.
    let scope = app.world_mut().spawn((Tool::new(ToolKind::Scope), ToolPose::at(Vec3::ZERO, Quat::IDENTITY))).id();
    app.step(1);
    assert!(super::contacts(&app, scope).list.is_empty());
}

#[test]
fn what_is_only_seen_is_not_touched() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    hold(&mut app, tool, Vec3::Y * RADIUS_M, 0.0);
    app.step(1);
    assert!(!contacts(&app, tool).list.is_empty());
    app.world_mut().entity_mut(organ).insert(Intangible);
    app.step(1);
    assert!(contacts(&app, tool).list.is_empty());
}

#[test]
fn bone_is_touched_where_it_is_left() {
    let placed = Transform::from_xyz(0.02, 0.0, 0.01).with_rotation(Quat::from_rotation_x(-1.2));
    let (mut app, bone) = with_bone(placed);
    let tool = app.world_mut().spawn(drill()).id();
    let world = |local_m: Vec3| placed.transform_point(local_m);
    let press = |app: &mut TestApp, x_mm: f32, depth_mm: f32, pedal: f32| {
        let tip_m = world(Vec3::new(x_mm * 1e-3, 0.002, 2e-3 - depth_mm * 1e-3));
        let pose = ToolPose::with_shaft_towards(tip_m, tip_m + placed.rotation * Vec3::Z);
        app.world_mut().entity_mut(tool).insert((pose, ToolCommand { pedal, ..default() }));
        app.step(1);
    };
    for (x_mm, label) in [(-5.0, 1), (5.0, 2)] {
        for depth_mm in [-0.6, 0.3, 1.0] {
            press(&mut app, x_mm, depth_mm, 0.0);
            let contact = contacts(&app, tool).of(bone, ToolPart::Tip).copied();
            assert_eq!(contact.is_some(), depth_mm > 0.0, "{depth_mm} mm");
            let Some(contact) = contact else { continue };
            assert!((contact.depth_m * 1e3 - depth_mm).abs() < 0.26, "{} for {depth_mm}", contact.depth_m * 1e3);
            assert!(contact.normal_world.dot(placed.rotation * Vec3::Z) > 0.95);
            assert!(matches!(contact.matter, ContactMatter::Volume { label: found, .. } if found == label));
        }
    }
    // Drilled away, there is nothing to touch.
    for _ in 0..240 {
        press(&mut app, -5.0, 1.0, 1.0);
    }
    press(&mut app, -5.0, 0.3, 0.0);
    assert_eq!(contacts(&app, tool).of(bone, ToolPart::Tip), None);
    assert_eq!(contacts(&app, tool).near, [bone]);
}

#[test]
fn contacts_that_last_are_told_of_now_and_then() {
    let (mut app, organ) = with_organ();
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    let mut told = Vec::new();
    for step in 0..130 {
        let is_on = (10..125).contains(&step);
        hold(&mut app, tool, Vec3::Y * (RADIUS_M + if is_on { 0.0 } else { 0.009 }), 0.0);
        app.step(1);
        told.extend(written::<ToolTouched>(&app).into_iter().map(|touched| (step, touched)));
    }
    assert!(told.iter().all(|(_, touched)| touched.tool == tool && touched.contact.body == organ));
    let of =
        |phase| told.iter().filter(|(_, touched)| touched.phase == phase).map(|(step, _)| *step).collect::<Vec<_>>();
    assert_eq!(of(ContactPhase::Began), [10]);
    assert_eq!(of(ContactPhase::Ended), [125]);
    // Every third step is 20 times a second, the next slower rate below 25.
    assert_eq!(of(ContactPhase::Lasts), (1..=38).map(|n| 10 + 3 * n).collect::<Vec<_>>());
}
