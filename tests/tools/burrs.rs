//! A drill with several burrs: the hand asks for the next one, and it is put on while it stands still.

use super::{hold, with_bone};
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrShape};

fn burr(kind: BurrKind, diameter_m: f32) -> Burr {
    Burr { kind, shape: BurrShape::Sphere, diameter_m }
}

fn three() -> [Burr; 3] {
    [burr(BurrKind::Cutting, 6e-3), burr(BurrKind::Cutting, 4e-3), burr(BurrKind::Diamond, 2e-3)]
}

fn with_burrs() -> Tool {
    let [on, others @ ..] = three();
    Tool { burrs: others.to_vec(), ..Tool::new(ToolKind::Drill(DrillHead { burr: on, ..default() })) }
}

fn is_on(app: &bevy_surgery::testing::TestApp, drill: Entity) -> Burr {
    match app.world().get::<Tool>(drill).expect("a tool").kind {
        ToolKind::Drill(head) => head.burr,
        _ => panic!("it is a drill"),
    }
}

#[test]
fn burrs_are_put_on_in_turn_while_they_stand_still() {
    let (mut app, _) = with_bone(Transform::default());
    let drill = app.world_mut().spawn(with_burrs()).id();
    let press = |app: &mut bevy_surgery::testing::TestApp, pedal: f32, next_burr: bool| {
        app.world_mut().entity_mut(drill).insert(ToolCommand { pedal, next_burr, ..default() });
        app.step(1);
        is_on(app, drill)
    };
    let [first, second, third] = three();
    assert_eq!(press(&mut app, 0.0, false), first);
    assert_eq!(press(&mut app, 0.0, true), second);
    assert_eq!(press(&mut app, 0.0, true), second, "it is asked for once");
    press(&mut app, 0.0, false);
    assert_eq!(press(&mut app, 1.0, true), second, "one that turns stays on");
    press(&mut app, 1.0, false);
    assert_eq!(press(&mut app, 0.0, true), second, "it has only just stopped");
    press(&mut app, 0.0, false);
    assert_eq!(press(&mut app, 0.0, true), third);
    press(&mut app, 0.0, false);
    assert_eq!(press(&mut app, 0.0, true), first, "and again from the first");
    assert_eq!(app.world().get::<Tool>(drill).expect("a tool").burrs, [second, third]);
    // Where there are no others nothing is changed.
    let plain = app.world_mut().spawn(Tool::new(ToolKind::Drill(DrillHead::default()))).id();
    app.world_mut().entity_mut(plain).insert(ToolCommand { next_burr: true, ..default() });
    app.step(1);
    assert_eq!(is_on(&app, plain), Burr::default());
}

#[test]
fn the_burr_that_is_on_touches_and_cuts() {
    let (mut app, bone) = with_bone(Transform::default());
    let drill = app.world_mut().spawn(with_burrs()).id();
    // 2 mm over the bone: a ball of 6 mm is in it, one of 2 mm is not.
    let at_m = Vec3::Z * 2e-3;
    let touches = |app: &bevy_surgery::testing::TestApp| {
        app.world().get::<ToolContacts>(drill).expect("contacts").at_tip().is_some()
    };
    hold(&mut app, drill, at_m, 0.0);
    app.step(1);
    assert!(touches(&app));
    for _ in 0..2 {
        for next_burr in [true, false] {
            app.world_mut().entity_mut(drill).insert(ToolCommand { next_burr, ..default() });
            app.step(1);
        }
    }
    assert_eq!(is_on(&app, drill), three()[2]);
    assert!(!touches(&app));
    let removed = |app: &bevy_surgery::testing::TestApp| {
        app.world().get::<RemovedTissue>(bone).expect("beside the cut").total_mm3()
    };
    hold(&mut app, drill, at_m, 1.0);
    app.step(20);
    assert_eq!(removed(&app), 0.0);
    hold(&mut app, drill, Vec3::Z * 5e-4, 1.0);
    app.step(20);
    assert!(removed(&app) > 0.0);
}

#[test]
fn commands_and_tools_of_before_are_read() {
    let command: ToolCommand =
        serde_json::from_str(r#"{"pedal":0.5,"second_pedal":0.0,"grip":1.0}"#).expect("of before");
    assert_eq!(command, ToolCommand { pedal: 0.5, grip: 1.0, ..default() });
    let tool: Tool = ron::from_str("(kind: Drill(()), hand: Left)").expect("of before");
    assert_eq!(tool, Tool { kind: ToolKind::Drill(DrillHead::default()), hand: ToolHand::Left, ..default() });
}
