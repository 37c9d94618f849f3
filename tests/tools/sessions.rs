//! Tools in the hand of a device whose loop is stepped: forces, cutting, soft bodies, clutch.

use super::*;
use bevy_surgery::haptics::device::scripted::{KeyPose, ScriptedDevice, ScriptedPath};
use bevy_surgery::haptics::device::{DeviceLimits, HapticDevice};
use bevy_surgery::haptics::safety::SafetySettings;
use bevy_surgery::haptics::servo::ServoSettings;
use bevy_surgery::tools::{RigFrame, ServoReading, ServoSession, ToolRig};

/// Settings whose force comes on at once, so that short tests see it.
fn prompt() -> ServoSettings {
    ServoSettings { safety: SafetySettings { ramp_s: 0.01, ..default() }, ..default() }
}

/// A hand that goes from one place to another, both in the world, and stays there; with a pedal.
fn hand(from_m: Vec3, to_m: Vec3, over_s: f64, pedal: f32) -> Box<dyn HapticDevice> {
    let key = |time_s, at_m: Vec3| KeyPose { axes: [pedal, 0.0], ..KeyPose::at(time_s, at_m.as_dvec3()) };
    let path = ScriptedPath::new(vec![key(0.0, from_m), key(0.3, from_m), key(0.3 + over_s, to_m)], None);
    Box::new(ScriptedDevice::new(path, 1e-3, DeviceLimits::OMNI))
}

fn reading(app: &TestApp, tool: Entity) -> &ServoReading {
    app.world().get::<ServoReading>(tool).expect("a session has one")
}

fn tip_m(app: &TestApp, tool: Entity) -> Vec3 {
    motion(app, tool).to.expect("it is held").tip_in_world_m
}

#[test]
fn a_probe_is_held_on_an_organ_and_never_pushed_through() {
    let (mut app, organ) = with_organ();
    let device = hand(Vec3::Z * 0.07, Vec3::Z * -0.2, 2.0, 0.0);
    let tool = app.world_mut().spawn((Tool::new(ToolKind::Probe), ServoSession::stepped(device, prompt()))).id();
    let radius_m = app.world().get::<Tool>(tool).expect("a tool").tip_radius_m();
    for step in 0..180 {
        app.step(1);
        let state = &reading(&app, tool).state;
        assert!(state.force_in_device_n.is_finite() && state.force_in_device_n.length() <= 3.3 + 1e-9);
        if step > 1 {
            assert!(tip_m(&app, tool).z > RADIUS_M + radius_m - 1e-3, "step {step}: {}", tip_m(&app, tool));
        }
    }
    let state = &reading(&app, tool).state;
    assert!(state.tip_in_world_m.z < -0.19, "the hand went through the organ: {}", state.tip_in_world_m);
    assert!(state.force_in_device_n.z > 3.0, "and is pushed back with all that the device can");
    // It is a contact with the force that was measured.
    let contact = contacts(&app, tool).of(organ, ToolPart::Tip).copied();
    let touched_n = app.world().get::<ToolForce>(tool).expect("a force").of_body_n(organ).expect("it is known");
    assert!(touched_n > 1.0);
    assert!(contact.is_none_or(|contact| contact.force_n == touched_n));
}

#[test]
fn a_moving_organ_pushes_the_hand_away() {
    let (mut app, organ) = with_organ();
    let device = hand(Vec3::Y * 0.06, Vec3::Y * 0.06, 1.0, 0.0);
    let tool = app.world_mut().spawn((Tool::new(ToolKind::Probe), ServoSession::stepped(device, prompt()))).id();
    app.step(30);
    assert_eq!(reading(&app, tool).state.contact_count, 0);
    for step in 0..30 {
        let rise_m = 0.012 * step as f32 / 30.0;
        app.world_mut().entity_mut(organ).insert(Transform::from_xyz(0.0, rise_m, 0.0));
        app.step(1);
    }
    // Risen by 11.6 mm, it is 3.8 mm over the tip's lower end; the loop shows it a step later.
    app.step(3);
    let state = reading(&app, tool).state;
    assert!(
        (state.contact_force_n.y / (SurfaceFeel::LIVER.stiffness_n_per_m * 3.8e-3) - 1.0).abs() < 0.2,
        "{}",
        state.contact_force_n
    );
    assert!(tip_m(&app, tool).y > 0.0625, "the tool lies on it: {}", tip_m(&app, tool));
}

#[test]
fn pressing_harder_drills_more_and_never_through() {
    let mut removed = Vec::new();
    for depth_mm in [1.0, 4.0] {
        let (mut app, bone) = with_bone(Transform::IDENTITY);
        let from_m = Vec3::new(-5.0, 0.0, 4.0) * 1e-3;
        let device = hand(from_m, from_m - Vec3::Z * (2.0 + depth_mm) * 1e-3, 0.2, 1.0);
        let tool = app.world_mut().spawn((drill(), ServoSession::stepped(device, prompt()))).id();
        let mut deepest_n: f64 = 0.0;
        for _ in 0..60 {
            app.step(1);
            let state = &reading(&app, tool).state;
            assert!(state.force_in_device_n.is_finite());
            deepest_n = deepest_n.max(state.burr.force_n);
        }
        let force_n = app.world().get::<ToolForce>(tool).expect("a force").drilling_n.expect("it is known");
        assert!(deepest_n > 0.1 && force_n <= 3.3, "{deepest_n} {force_n}");
        removed.push(app.world().get::<RemovedTissue>(bone).expect("counted").total_mm3());
        let ahead_mm = 2.0 - depth_mm;
        assert!(tip_m(&app, tool).z * 1e3 > ahead_mm - 0.1, "not further than the hand: {}", tip_m(&app, tool));
    }
    assert!(removed[0] > 0.05 && removed[1] > 1.3 * removed[0], "{removed:?}");
}

#[test]
fn a_soft_organ_gives_way_and_pushes_back() {
    let (mut app, organ) = with_organ();
    let models = app.world().resource::<Assets<OrganModel>>();
    let model = models.get(&app.world().get::<Organ>(organ).expect("an organ").0).expect("a model");
    let lattice = DeformLattice::around_organ(model, 3, 0.02).expect("a lattice");
    let body = ElasticBody::of_organ(&lattice, model, ElasticTissue::LIVER).expect("a body");
    let mut body = body.pinned_where(|rest_m| rest_m.z < -0.02);
    body.rests_under_m_per_s2 = app.world().resource::<SurgeryGravity>().world_m_per_s2;
    app.world_mut().entity_mut(organ).insert((lattice, body));
    let device = hand(Vec3::Z * 0.06, Vec3::Z * 0.042, 0.5, 0.0);
    let tool = app.world_mut().spawn((Tool::new(ToolKind::Probe), ServoSession::stepped(device, prompt()))).id();
    let (mut last_n, mut roughest_n) = (0.0, 0.0_f64);
    for step in 0..150 {
        app.step(1);
        let force_n = reading(&app, tool).state.force_in_device_n.z;
        assert!(force_n.is_finite());
        if step > 60 {
            roughest_n = roughest_n.max((force_n - last_n).abs());
        }
        last_n = force_n;
    }
    // The hand is 10.2 mm in (its tip has a radius of 2.2 mm): the organ is dented, and pushes.
    assert!(last_n > 0.2, "it pushes back: {last_n} N");
    let tip_m = tip_m(&app, tool);
    assert!(tip_m.z < 0.0455, "the tool goes in with the hand: {tip_m}");
    let shape = app.world().get::<OrganShape>(organ).expect("a shape");
    let above = shape.positions_m().iter().filter(|at| at.truncate().length() < 4e-3 && at.z > 0.0);
    let surface_m = above.map(|at| at.z).fold(0.0, f32::max);
    assert!(surface_m < RADIUS_M - 4e-3, "the surface gives way: {surface_m}");
    assert!(roughest_n < 0.3, "held still, the force is steady: steps of {roughest_n} N");
}

#[test]
fn a_clutch_leaves_the_tool_where_it_is() {
    let (mut app, _) = with_organ();
    let held = |time_s, x_m: f64, buttons| KeyPose { buttons, ..KeyPose::at(time_s, DVec3::new(x_m, 0.2, 0.0)) };
    // Right by 2 cm; back by 2 cm with the clutch held; right by another 2 cm.
    let keys = vec![held(0.0, 0.0, 0), held(0.3, 0.02, 4), held(0.7, 0.0, 0), held(1.0, 0.02, 0)];
    let device = Box::new(ScriptedDevice::new(ScriptedPath::new(keys, None), 1e-3, DeviceLimits::OMNI));
    let frame = app.world_mut().spawn(Transform::from_rotation(Quat::from_rotation_y(std::f32::consts::PI))).id();
    app.step(1);
    let rig = ToolRig { frame: RigFrame::Of(frame), scale: 0.5, ..default() };
    let tool = app.world_mut().spawn((Tool::new(ToolKind::Probe), rig, ServoSession::stepped(device, prompt()))).id();
    let mut places = Vec::new();
    for _ in 0..75 {
        app.step(1);
        // The loop has to know where the rig stands first.
        places.push(motion(&app, tool).to.map_or(0.0, |to| to.tip_in_world_m.x));
    }
    // Half scale, and the frame is turned round.
    assert!((places[17] + 0.01).abs() < 2e-4, "{}", places[17]);
    assert!((places[41] + 0.01).abs() < 2e-4, "while it was held: {}", places[41]);
    assert!((places[74] + 0.02).abs() < 2e-4, "{}", places[74]);
    let steps = places[3..].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
    assert!(steps < 2e-3, "no jump: {steps}");
    assert_eq!(motion(&app, tool).jumps, 0);
}

#[test]
fn stepped_sessions_are_the_same_to_the_bit() {
    let run = || {
        let (mut app, bone) = with_bone(Transform::from_rotation(Quat::from_rotation_y(0.1)));
        let from_m = Vec3::new(-5.0, 0.0, 4.0) * 1e-3;
        let device = hand(from_m, from_m + Vec3::new(3.0, 1.0, -5.0) * 1e-3, 0.8, 1.0);
        let tool = app.world_mut().spawn((drill(), ServoSession::stepped(device, prompt()))).id();
        app.step(70);
        let cut = app.world().get::<CutVolume>(bone).expect("a cut").save([0; 32]);
        (reading(&app, tool).clone(), cut)
    };
    let (first, second) = (run(), run());
    assert!(first.0.state.burr_impulse_n_s > 0.0);
    assert!(first == second);
}
