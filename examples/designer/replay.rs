//! Runs that are looked at again, on a timeline.

use crate::{Designer, files};
use bevy::prelude::*;
use bevy_egui::egui::{self, Key, Modifiers};
use bevy_surgery::panels::{Problems, Timeline, timeline_panel};
use bevy_surgery::scenario::log::RunLog;
use bevy_surgery::scenario::{RunPhase, ScenarioRun};
use std::path::{Path, PathBuf};

/// The run that is open.
#[derive(Resource)]
struct OpenRun {
    file: PathBuf,
    log: RunLog,
    is_new: bool,
}

pub fn build(app: &mut App) {
    app.init_resource::<Timeline>();
}

/// Opens a run: its scene takes the place of what there is.
pub fn open(world: &mut World, designer: &mut Designer, file: &Path) {
    let log = match RunLog::read(file) {
        Ok(log) => log,
        Err(reason) => return world.resource_mut::<Problems>().note(reason.to_string()),
    };
    files::when_safe(world, designer, files::Pending::New);
    if designer.asks.is_some() {
        designer.status = "Save or drop the scene first, then open the run again".into();
        return;
    }
    world.insert_resource(Timeline::of(&log));
    world.insert_resource(ScenarioRun::replay(log.clone()).kept());
    world.resource_mut::<Time<Virtual>>().unpause();
    designer.status = format!("{}: {}", file.display(), log.header.scenario.name);
    world.insert_resource(OpenRun { file: file.to_owned(), log, is_new: true });
}

/// Whether a run was opened since this was asked.
pub fn has_opened(world: &mut World) -> bool {
    world.get_resource_mut::<OpenRun>().is_some_and(|mut run| std::mem::replace(&mut run.is_new, false))
}

fn seek(world: &mut World, time_s: f64) {
    let Some(mut run) = world.get_resource_mut::<ScenarioRun>() else { return };
    if let Err(reason) = run.seek_to(time_s) {
        world.resource_mut::<Problems>().note(reason.to_string());
    }
}

/// The timeline and what the run says.
pub fn panel(ui: &mut egui::Ui, world: &mut World, designer: &mut Designer) {
    let Some(run) = world.get_resource::<ScenarioRun>().filter(|_| world.contains_resource::<OpenRun>()) else {
        ui.weak("Open a run (.mcap) to see what happened in it.");
        return;
    };
    let (now_s, score, goes_to) = (run.time_s(), run.score(), run.seeking_to());
    let diverged = run.diverged_s();
    let phase = match run.phase() {
        RunPhase::Waiting => "the scene is being loaded".to_owned(),
        RunPhase::Running if run.is_replaying() => "performed again".to_owned(),
        RunPhase::Running => "in your hand".to_owned(),
        RunPhase::Ended(end) => format!("ended with {:.0} points", end.score),
        RunPhase::Refused(reason) => reason.to_string(),
    };
    let mut retries = false;
    ui.horizontal(|ui| {
        ui.label(format!("{now_s:.1} s, {score:.0} points, {phase}"))
            .on_hover_text("Where the run is, seconds; its points of 100 so far");
        if let Some(to_s) = goes_to {
            ui.spinner().on_hover_text("What lies between is simulated");
            ui.label(format!("to {to_s:.1} s")).on_hover_text("Where it goes to, seconds");
        }
        if let Some(second) = diverged {
            let told = "The first second whose hash is not the one of the log";
            ui.colored_label(ui.visuals().error_fg_color, format!("another run from second {second} on"))
                .on_hover_text(told);
        }
        let told = "Takes the run over here: from now on its instruments follow the devices that hold them, and Press, Bleed and Burn count";
        retries = ui.button("Retry from here").on_hover_text(told).clicked();
    });
    let timeline = world.resource::<Timeline>().clone();
    if let Some(time_s) = timeline_panel(ui, &timeline, now_s) {
        seek(world, time_s);
    }
    if retries {
        retry(world, designer, now_s);
    }
}

fn retry(world: &mut World, designer: &mut Designer, time_s: f64) {
    let Some(open) = world.get_resource::<OpenRun>() else { return };
    match ScenarioRun::retry_at(open.log.clone(), &open.file, time_s) {
        Ok(run) => {
            world.insert_resource(run.kept());
            designer.status = format!("From {time_s:.1} s on it is your run");
        }
        Err(reason) => world.resource_mut::<Problems>().note(reason.to_string()),
    }
}

pub fn keys(world: &mut World, designer: &mut Designer, pressed: &impl Fn(Modifiers, Key) -> bool) {
    let Some(now_s) = world.get_resource::<ScenarioRun>().map(ScenarioRun::time_s) else { return };
    let timeline = world.resource::<Timeline>();
    let event = |is_forward| timeline.next(now_s, is_forward).map(|event| (event.time_s, event.what.clone()));
    let (before, after, end_s) = (event(false), event(true), timeline.duration_s);
    let mut go = None;
    if pressed(Modifiers::NONE, Key::Home) {
        go = Some((0.0, "The beginning".to_owned()));
    }
    if pressed(Modifiers::NONE, Key::End) {
        go = Some((end_s, "The end".to_owned()));
    }
    if pressed(Modifiers::NONE, Key::OpenBracket) {
        go = before;
    }
    if pressed(Modifiers::NONE, Key::CloseBracket) {
        go = after;
    }
    if let Some((time_s, what)) = go {
        designer.status = format!("{time_s:.1} s: {what}");
        seek(world, time_s);
    }
}
