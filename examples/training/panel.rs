//! What the trainee is told: goals, time and score, and warnings where the guidance is on.

use crate::common::{Args, Backend, add_interface};
use bevy::prelude::*;
use bevy::text::FontSize;
use bevy_surgery::scenario::log::LogRecord;
use bevy_surgery::scenario::{Guide, RunPhase, ScenarioEye, ScenarioRun, ScenarioTold};

/// How long a violation is shown, steps.
const SHOWN_STEPS: u64 = 180;

#[derive(Component)]
struct Words;

#[derive(Component)]
struct Warnings;

/// The last violation, and when it was.
#[derive(Resource, Default)]
struct Last(Option<(u64, String)>);

pub fn build(app: &mut App) {
    app.init_resource::<Last>();
    if app.world().resource::<Args>().backend == Some(Backend::Cpu) {
        return;
    }
    add_interface(app);
    app.add_systems(Update, (spawn, write, warn).chain()).add_systems(FixedLast, remember);
}

fn spawn(mut commands: Commands, eyes: Query<Entity, (Added<Camera>, With<ScenarioEye>)>) {
    for eye in &eyes {
        let font = |size: f32| TextFont { font_size: FontSize::Px(size), ..default() };
        let at = |top: Val, bottom: Val| Node {
            position_type: PositionType::Absolute,
            left: px(12),
            top,
            bottom,
            ..default()
        };
        let camera = UiTargetCamera(eye);
        commands.spawn((
            Words,
            camera.clone(),
            Text::default(),
            font(13.0),
            TextColor(Color::srgb(0.88, 0.9, 0.92)),
            at(px(10), auto()),
        ));
        commands.spawn((
            Warnings,
            camera,
            Text::default(),
            font(15.0),
            TextColor(Color::srgb(1.0, 0.75, 0.3)),
            at(auto(), px(12)),
        ));
    }
}

fn remember(run: Res<ScenarioRun>, mut told: MessageReader<ScenarioTold>, mut last: ResMut<Last>) {
    for ScenarioTold { step, record } in told.read() {
        let LogRecord::Violation(violation) = record else { continue };
        let rule = run.scenario().rules.iter().find(|rule| rule.id == violation.rule);
        let message = rule.map_or(violation.rule.as_str(), |rule| rule.message.as_str());
        last.0 = Some((*step, format!("{message}  (-{:.0})", violation.penalty)));
    }
}

fn write(run: Res<ScenarioRun>, mut words: Query<&mut Text, With<Words>>) {
    let scenario = run.scenario();
    let mut text = format!("{}\n", scenario.name);
    match run.phase() {
        RunPhase::Waiting => text += "is being prepared",
        RunPhase::Refused(fault) => text += &fault.to_string(),
        RunPhase::Running => {
            let left = scenario.time_limit_s.map_or(String::new(), |limit_s| format!(" of {limit_s:.0}"));
            let again = if run.is_replaying() { "   replay" } else { "" };
            text += &format!("{:.0}{left} s   {:.0} points{again}", run.time_s(), run.score());
        }
        RunPhase::Ended(end) => {
            let passed = if end.is_passed { "passed" } else { "not passed" };
            text += &format!("over after {:.0} s: {:.0} points, {passed}", run.time_s(), end.score);
        }
    }
    for (goal, state) in scenario.goals.iter().zip(run.goals()) {
        let share = if state.is_reached { "done".into() } else { format!("{:.0} %", 100.0 * state.progress) };
        text += &format!("\n{share:>6}  {}", goal.title);
    }
    for mut shown in &mut words {
        if shown.0 != text {
            shown.0.clone_from(&text);
        }
    }
}

fn warn(run: Res<ScenarioRun>, guide: Res<Guide>, last: Res<Last>, mut words: Query<&mut Text, With<Warnings>>) {
    let recent = last.0.as_ref().filter(|(step, _)| run.steps() < step + SHOWN_STEPS).map(|(_, text)| text.clone());
    let text = recent.into_iter().chain(guide.lines()).collect::<Vec<_>>().join("\n");
    for mut shown in &mut words {
        if shown.0 != text {
            shown.0.clone_from(&text);
        }
    }
}
