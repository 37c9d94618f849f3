//! A run on a line: what happened when, and where it is now.

use super::plot::Plot;
use crate::scenario::Severity;
use crate::scenario::log::{LogRecord, RunLog};
use bevy::prelude::*;
use bevy_egui::egui::{self, Align2, Color32, Sense};

/// What is shown of a run's log.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    /// How long the run is, seconds.
    pub duration_s: f64,
    /// What happened, in order.
    pub events: Vec<TimelineEvent>,
    /// Matter that was removed in each second, cubic millimetres.
    pub removed_mm3: Vec<f32>,
    /// Greatest force in each second, newtons.
    pub force_n: Vec<f32>,
    /// Blood that ran in each second, millilitres per second.
    pub bleeding_ml_s: Vec<f32>,
}

/// Something that happened in a run.
#[derive(Clone, Debug, PartialEq)]
pub struct TimelineEvent {
    /// When, seconds.
    pub time_s: f64,
    /// What.
    pub what: String,
    /// What kind.
    pub kind: TimelineKind,
}

/// Kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimelineKind {
    /// A goal was reached.
    Goal,
    /// A rule was broken.
    Violation(Severity),
    /// An organ reacted.
    Reaction,
    /// The end.
    End,
}

impl Timeline {
    /// Of a log.
    pub fn of(log: &RunLog) -> Self {
        let rate = log.header.steps_per_second.max(1e-3);
        let last = log.entries.iter().map(|entry| entry.step).max().unwrap_or(0);
        let seconds = (last as f64 / rate).floor() as usize + 1;
        // A file may claim any step.
        let seconds = seconds.min(24 * 3600);
        let mut timeline = Self {
            duration_s: (last + 1) as f64 / rate,
            removed_mm3: vec![0.0; seconds],
            force_n: vec![0.0; seconds],
            bleeding_ml_s: vec![0.0; seconds],
            ..default()
        };
        let goal_title = |id: &str| {
            let goal = log.header.scenario.goals.iter().find(|goal| goal.id == id);
            goal.map_or_else(|| id.to_owned(), |goal| goal.title.clone())
        };
        let rule_message = |id: &str| {
            let rule = log.header.scenario.rules.iter().find(|rule| rule.id == id);
            rule.map_or_else(|| id.to_owned(), |rule| rule.message.clone())
        };
        for entry in &log.entries {
            let time_s = entry.step as f64 / rate;
            let second = (time_s as usize).min(seconds - 1);
            let (what, kind) = match &entry.record {
                LogRecord::Goal(goal) if goal.is_reached => (goal_title(&goal.goal), TimelineKind::Goal),
                LogRecord::Violation(broken) => (rule_message(&broken.rule), TimelineKind::Violation(broken.severity)),
                LogRecord::Reaction(reaction) => (reaction.what.clone(), TimelineKind::Reaction),
                LogRecord::End(end) => (format!("{:.0} points", end.score), TimelineKind::End),
                LogRecord::Removal(removal) => {
                    timeline.removed_mm3[second] +=
                        removal.by_label_mm3.iter().map(|(_, mm3)| *mm3 as f32).sum::<f32>();
                    continue;
                }
                LogRecord::Sample(sample) => {
                    timeline.force_n[second] = timeline.force_n[second].max(sample.contact_n);
                    continue;
                }
                LogRecord::Bleeding(bleeding) => {
                    timeline.bleeding_ml_s[second] = bleeding.rate_ml_s as f32;
                    continue;
                }
                _ => continue,
            };
            timeline.events.push(TimelineEvent { time_s, what, kind });
        }
        timeline
    }

    /// The event nearest to a time, within a reach, seconds.
    fn near(&self, time_s: f64, reach_s: f64) -> Option<&TimelineEvent> {
        let far = |event: &&TimelineEvent| (event.time_s - time_s).abs();
        self.events.iter().filter(|event| far(event) <= reach_s).min_by(|one, other| far(one).total_cmp(&far(other)))
    }

    /// The first event after a time (`is_forward`), or the last one before it.
    pub fn next(&self, time_s: f64, is_forward: bool) -> Option<&TimelineEvent> {
        if is_forward {
            self.events.iter().find(|event| event.time_s > time_s + 1e-6)
        } else {
            self.events.iter().rev().find(|event| event.time_s < time_s - 1e-6)
        }
    }
}

fn colour(kind: TimelineKind) -> Color32 {
    match kind {
        TimelineKind::Goal => Color32::from_rgb(90, 200, 110),
        TimelineKind::Violation(Severity::Warning) => Color32::from_rgb(240, 190, 70),
        TimelineKind::Violation(_) => Color32::from_rgb(235, 80, 70),
        TimelineKind::Reaction => Color32::from_rgb(190, 90, 120),
        TimelineKind::End => Color32::WHITE,
    }
}

/// A run's timeline: events as marks, force, removal and bleeding as curves. Returns the time that was asked for, seconds.
pub fn timeline_panel(ui: &mut egui::Ui, timeline: &Timeline, now_s: f64) -> Option<f64> {
    let duration_s = timeline.duration_s.max(1e-3);
    let plot = Plot::new(ui, 84.0, Sense::click_and_drag());
    let curves = [
        (&timeline.removed_mm3, Color32::from_rgb(200, 190, 150)),
        (&timeline.force_n, Color32::from_rgb(110, 180, 255)),
        (&timeline.bleeding_ml_s, Color32::from_rgb(220, 60, 60)),
    ];
    for (values, colour) in curves {
        let most = values.iter().copied().fold(0.0, f32::max);
        if most > 0.0 {
            let place = |(second, value): (usize, &f32)| {
                (((second as f64 + 0.5) / duration_s).min(1.0) as f32, 0.7 * value / most)
            };
            plot.curve(values.iter().enumerate().map(place), colour.gamma_multiply(0.8));
        }
    }
    for event in &timeline.events {
        let x = (event.time_s / duration_s) as f32;
        let colour = colour(event.kind);
        match event.kind {
            TimelineKind::Reaction => plot.handle_small(x, 0.78, colour),
            _ => plot.handle_small(x, 0.9, colour),
        }
    }
    plot.mark((now_s / duration_s).clamp(0.0, 1.0) as f32, Color32::WHITE);
    plot.text(0.0, 0.0, Align2::LEFT_BOTTOM, "blue force, red bleeding, sand removal");
    plot.text(1.0, 0.0, Align2::RIGHT_BOTTOM, &format!("{now_s:.1} of {duration_s:.1} s"));
    let response = plot.response.clone();
    let time_at = |at: egui::Pos2| f64::from(plot.place(at).0) * duration_s;
    let hovered_s = response.hover_pos().map(time_at);
    let reach_s = 6.0 * duration_s / f64::from(plot.rect.width().max(1.0));
    let told = match hovered_s.and_then(|time_s| Some((time_s, timeline.near(time_s, reach_s)?))) {
        Some((_, event)) => format!("{:.1} s: {}", event.time_s, event.what),
        None => format!(
            "{:.1} s\nClick to go there (seconds). Home and End: beginning and end; Page up and down: the event before and after.",
            hovered_s.unwrap_or(now_s)
        ),
    };
    let asked = (response.clicked() || response.drag_stopped()).then(|| response.interact_pointer_pos()).flatten();
    response.on_hover_text(told);
    asked.map(time_at)
}
