//! What the trainee is told: goals, time and score, warnings where the guidance is on, and how it ended.

use crate::common::{Args, Backend, add_interface};
use crate::hands::Mouse;
use bevy::prelude::*;
use bevy::text::FontSize;
use bevy_surgery::scenario::log::{EndReason, LogRecord};
use bevy_surgery::scenario::{Guide, RunPhase, ScenarioEye, ScenarioRun, ScenarioTold};

/// How long a violation is shown, steps.
const SHOWN_STEPS: u64 = 180;

/// A piece of text over the picture.
#[derive(Component, Clone, Copy, PartialEq, Eq)]
enum Sheet {
    /// Goals, time and score; what the keys do.
    Progress,
    /// What was done wrong, and what is told meanwhile.
    Warnings,
    /// How it ended.
    Verdict,
}

/// The last violation, and when it was.
#[derive(Resource, Default)]
struct Last(Option<(u64, String)>);

pub fn build(app: &mut App) {
    app.init_resource::<Last>();
    if app.world().resource::<Args>().backend == Some(Backend::Cpu) {
        return;
    }
    add_interface(app);
    app.add_systems(Update, (spawn, write).chain()).add_systems(FixedLast, remember);
}

fn spawn(mut commands: Commands, eyes: Query<Entity, (Added<Camera>, With<ScenarioEye>)>) {
    for eye in &eyes {
        let mut sheet = |sheet: Sheet, size: f32, colour: Color, place: Node, moved: UiTransform| {
            let (horizontal, vertical) = (px(0.8 * size), px(0.4 * size));
            commands.spawn((
                sheet,
                Text::default(),
                TextFont { font_size: FontSize::Px(size), ..default() },
                TextColor(colour),
                Node {
                    position_type: PositionType::Absolute,
                    display: Display::None,
                    padding: UiRect::axes(horizontal, vertical),
                    ..place
                },
                // They are read over bone as well as over what is dark.
                BackgroundColor(Color::srgba(0.03, 0.035, 0.04, 0.75)),
                moved,
                UiTargetCamera(eye),
            ));
        };
        let (plain, amber) = (Color::srgb(0.88, 0.9, 0.92), Color::srgb(1.0, 0.75, 0.3));
        let top = Node { left: px(6), top: px(6), ..default() };
        sheet(Sheet::Progress, 13.0, plain, top, default());
        let bottom = Node { left: px(6), bottom: px(6), ..default() };
        sheet(Sheet::Warnings, 15.0, amber, bottom, default());
        let middle = Node { left: percent(50), top: percent(40), ..default() };
        let centred = UiTransform { translation: Val2::percent(-50.0, 0.0), ..default() };
        sheet(Sheet::Verdict, 22.0, plain, middle, centred);
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

fn write(
    run: Res<ScenarioRun>,
    guide: Res<Guide>,
    last: Res<Last>,
    mouse: Option<Res<Mouse>>,
    mut sheets: Query<(&Sheet, &mut Text, &mut Node)>,
) {
    for (sheet, mut shown, mut node) in &mut sheets {
        let text = match sheet {
            Sheet::Progress => progress(&run, mouse.as_ref().map(|mouse| mouse.tool)),
            Sheet::Warnings => {
                let recent = last.0.as_ref().filter(|(step, _)| run.steps() < step + SHOWN_STEPS);
                let recent = recent.map(|(_, text)| text.clone());
                recent.into_iter().chain(guide.lines()).collect::<Vec<_>>().join("\n")
            }
            Sheet::Verdict => verdict(&run),
        };
        let display = if text.is_empty() { Display::None } else { Display::Flex };
        if shown.0 != text {
            shown.0 = text;
        }
        if node.display != display {
            node.display = display;
        }
    }
}

/// How far it is, and the instruments for who holds one of them with the mouse.
fn progress(run: &ScenarioRun, held: Option<usize>) -> String {
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
        RunPhase::Ended(_) => text += &format!("over after {:.0} s", run.time_s()),
    }
    for (goal, state) in scenario.goals.iter().zip(run.goals()) {
        let share = if state.is_reached { "done".into() } else { format!("{:.0} %", 100.0 * state.progress) };
        text += &format!("\n{share:>6}  {}", goal.title);
    }
    if let Some(held) = held.filter(|_| *run.phase() == RunPhase::Running && !run.is_replaying()) {
        for (place, tool) in scenario.tools.iter().enumerate() {
            let mark = if place == held { '>' } else { ' ' };
            text += &format!("\n{mark:>4} {}  {}", place + 1, tool.name);
        }
        text += "\n     G  guidance on or off\n     Escape  end the run";
    }
    text
}

/// How it ended; nothing before that.
fn verdict(run: &ScenarioRun) -> String {
    let RunPhase::Ended(end) = run.phase() else { return String::new() };
    let passed = if end.is_passed { "Passed" } else { "Not passed" };
    let reason = match end.reason {
        EndReason::Done => "All goals are reached",
        EndReason::OutOfTime => "The time is over",
        EndReason::Stopped => "It was ended",
    };
    format!("{passed}: {:.0} of 100 points\n{reason}", end.score)
}
