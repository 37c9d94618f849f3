//! Logs of runs that never were: small ones by hand, and one that looks like an operation.

use bevy::math::{Quat, Vec3};
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::log::*;
use bevy_surgery::scenario::metrics::MetricChoice;
use bevy_surgery::scenario::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A log without entries: a drill, a suction, a bone with cells, a nerve and a sinus.
pub fn empty_run(steps_per_second: f64, goals: Vec<Goal>, rules: Vec<Rule>, metrics: Vec<MetricChoice>) -> RunLog {
    let scenario = Scenario {
        version: SCENARIO_VERSION,
        name: "Cortical mastoidectomy".into(),
        description: "Open the antrum. Spare the nerve.".into(),
        scene: ScenarioScene::TemporalBone,
        patient: PatientVariation::default(),
        tools: Vec::new(),
        events: Vec::new(),
        time_limit_s: Some(600.0),
        goals,
        rules,
        guidance: Guidance::default(),
        metrics,
        pass_score: 70.0,
    };
    let tool = |name: &str, kind| LoggedTool { name: name.into(), tool: Tool::new(kind) };
    let bone = LoggedBody {
        name: "Temporal bone".into(),
        structures: vec!["mastoid cells".into(), "facial nerve".into(), "sigmoid sinus".into()],
        critical: vec![false, true, true],
        volumes_mm3: vec![90_000.0, 6_000.0, 55.0, 900.0],
        box_world_m: [Vec3::ZERO, Vec3::new(0.03, 0.025, 0.02)],
    };
    RunLog {
        header: LogHeader {
            version: LOG_VERSION,
            crate_version: "0.1.0".into(),
            scenario,
            seed: 7,
            steps_per_second,
            tools: vec![
                tool("Drill, 4 mm cutting", ToolKind::Drill(DrillHead::default())),
                tool("Suction", ToolKind::SuctionIrrigator),
            ],
            bodies: vec![bone],
            trainee: Some("A. Trainee".into()),
            began: Some("2026-11-23T08:00:00Z".into()),
            branch: None,
        },
        entries: Vec::new(),
        is_complete: true,
    }
}

/// A goal to remove the cells.
pub fn remove_cells() -> Goal {
    Goal {
        id: "cells".into(),
        title: "Remove the mastoid cells".into(),
        kind: GoalKind::Remove { structure: "mastoid cells".into(), share: 0.6 },
        weight: 2.0,
        after: Vec::new(),
    }
}

/// A sample with the tip at a place, pointing down.
pub fn sample(tool: u32, tip_m: Vec3) -> ToolSample {
    ToolSample {
        tool,
        is_dropped: false,
        pose: ToolPose::at(tip_m, Quat::from_rotation_arc(Vec3::NEG_Z, Vec3::NEG_Y)),
        command: ToolCommand::default(),
        forces_n: None,
        drilling_n: None,
        contact_n: 0.0,
        critical_m: None,
    }
}

pub fn push(run: &mut RunLog, step: u64, record: LogRecord) {
    run.entries.push(LogEntry { step, record });
}

/// A removal of one structure.
pub fn removal(tool: u32, label: u8, mm3: f64, centroid_m: Vec3, seen: Option<f32>) -> LogRecord {
    LogRecord::Removal(RemovalRecord { tool: Some(tool), body: 0, by_label_mm3: vec![(label, mm3)], centroid_m, seen })
}

pub fn contact(tool: u32, label: u8, is_on: bool) -> LogRecord {
    LogRecord::Contact(ContactRecord {
        tool,
        body: 0,
        label: Some(label),
        uv: None,
        part: ToolPart::Tip,
        is_on,
        point_m: Vec3::ZERO,
        depth_m: 0.0,
        force_n: 1.0,
    })
}

fn goal(id: &str, title: &str, kind: GoalKind, weight: f32) -> Goal {
    Goal { id: id.into(), title: title.into(), kind, weight, after: Vec::new() }
}

fn rule(id: &str, message: &str, kind: RuleKind, penalty: f32, severity: Severity) -> Rule {
    Rule { id: id.into(), message: message.into(), kind, penalty, most: None, severity }
}

/// What an operation of four minutes might look like; `skill` from 0 to 1.
pub fn mastoid_run(skill: f32, seed: u64, metrics: Vec<MetricChoice>) -> RunLog {
    let expose = GoalKind::Expose { structure: "facial nerve".into(), share: 0.4, cover_m: 1e-3 };
    let goals = vec![
        remove_cells(),
        goal("antrum", "Reach the antrum", GoalKind::Reach { structure: "antrum".into(), within_m: 2e-3 }, 1.0),
        goal("nerve", "Show the facial nerve through thin bone", expose, 2.0),
        goal("dry", "Keep the field dry", GoalKind::StopBleeding { below_ml_s: 0.05, for_s: 10.0 }, 1.0),
    ];
    let nerve = || "facial nerve".to_string();
    let force = RuleKind::Force { structure: nerve(), within_m: 4e-3, above_n: 2.0 };
    let rules = vec![
        rule("force", "Too much force near the facial nerve", force, 3.0, Severity::Error),
        rule(
            "touch",
            "The burr touched the sigmoid sinus",
            RuleKind::Touch { structure: "sigmoid sinus".into() },
            5.0,
            Severity::Error,
        ),
        rule("blind", "Drilled out of sight", RuleKind::DrilledUnseen { above_mm3: 2.0 }, 1.0, Severity::Warning),
        rule(
            "cut",
            "The facial nerve was cut",
            RuleKind::Cut { structure: nerve(), above_mm3: 1.0 },
            30.0,
            Severity::Failure,
        ),
    ];
    let mut run = empty_run(60.0, goals, rules, metrics);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut chance = move || rng.random::<f32>();
    let rough = 1.0 - skill;
    let seconds = (170.0 + 130.0 * rough) as u64;
    let (mut progress, mut lost_ml, mut rate_ml_s, mut penalties) = (0.0_f32, 0.0_f64, 0.0_f64, 0.0_f32);
    let mut touched_until = None;
    let mut violate = |run: &mut RunLog, step, rule: &str, severity, value, penalty, point_m| {
        penalties += penalty;
        let record =
            ViolationRecord { rule: rule.into(), severity, tool: Some(0), point_m: Some(point_m), value, penalty };
        push(run, step, LogRecord::Violation(record));
    };
    for step in 0..seconds * 60 {
        let t = step as f32 / 60.0;
        let share = t / seconds as f32;
        let is_pause = t % 26.0 > 21.0;
        let field =
            Vec3::new(0.009 * (t * 0.11).sin(), 0.012 - 0.022 * share, 0.007 * (t * 0.073).cos()) * (1.3 - 0.6 * share);
        let turn = t * 0.05;
        let stroke = 0.0045 * (t * 4.3).sin() + 0.001 * rough * (t * 17.0).sin();
        let tremor = Vec3::new(chance() - 0.5, chance() - 0.5, chance() - 0.5) * 6e-5;
        let away = if is_pause {
            Vec3::new(0.01, 0.03, 0.015) * (((t % 26.0) - 21.0) / 5.0 * std::f32::consts::PI).sin()
        } else {
            Vec3::ZERO
        };
        let tip_m = field + Vec3::new(turn.cos(), 0.1, turn.sin()) * stroke + tremor + away;
        let distance_m = tip_m.distance(Vec3::new(0.003, -0.0065, 0.001)) - 0.002;
        let force_n = if is_pause {
            0.0
        } else {
            (1.1 + 0.5 * rough + (0.5 + 0.9 * rough) * (t * 8.6).sin() + 0.5 * chance()).max(0.0)
        };
        let mut drill = sample(0, tip_m);
        drill.command.pedal = if is_pause { 0.0 } else { 1.0 };
        (drill.drilling_n, drill.forces_n) = (Some(force_n), Some(vec![(0, Vec3::Y * force_n * 0.9)]));
        drill.critical_m = (distance_m < 6e-3).then_some(distance_m.max(0.0));
        push(&mut run, step, LogRecord::Sample(drill));
        let mut suction = sample(
            1,
            field
                + Vec3::new(-0.006 - 0.004 * rough, 0.001, 0.004)
                + 0.001 * Vec3::new((t * 0.9).sin(), 0.2, (t * 1.3).cos()),
        );
        suction.pose.is_tracked = t > 4.0;
        suction.contact_n = if t % 7.0 < 1.2 { 0.25 + 0.1 * chance() } else { 0.0 };
        push(&mut run, step, LogRecord::Sample(suction));
        if !is_pause && step % 5 == 0 && force_n > 0.4 {
            let seen = if chance() < 0.12 + 0.35 * rough * share { 0.1 } else { 1.0 };
            let mm3 = 0.9 * f64::from(force_n * (0.6 + 0.4 * chance()));
            let label = if chance() < 0.1 + 0.15 * rough {
                0
            } else if distance_m < 5e-4 {
                2
            } else {
                1
            };
            push(&mut run, step, removal(0, label, mm3, tip_m - Vec3::Y * 0.0015, Some(seen)));
            progress = (progress + mm3 as f32 / 2600.0).min(1.0);
            if seen < 0.5 && mm3 > 2.2 {
                violate(&mut run, step, "blind", Severity::Warning, mm3 as f32, 1.0, tip_m);
            }
        }
        if force_n > 2.0 + 0.6 * skill && distance_m < 4e-3 && chance() < 0.02 {
            violate(&mut run, step, "force", Severity::Error, force_n, 3.0, tip_m);
        }
        if step % (60 * 47) == 60 * 30 {
            push(&mut run, step, contact(0, 3, true));
            touched_until = Some(step + (30.0 + 90.0 * rough) as u64);
            rate_ml_s = f64::from(0.4 + rough);
            if rough > 0.1 {
                violate(&mut run, step, "touch", Severity::Error, 0.0, 5.0, tip_m);
            }
        }
        if touched_until == Some(step) {
            push(&mut run, step, contact(0, 3, false));
        }
        if !is_pause && step % 26 == 0 {
            push(&mut run, step, contact(0, 1, step % 52 == 0));
        }
        if step % 420 == 0 {
            push(&mut run, step, contact(1, 1, true));
        }
        if step % 420 == 72 {
            push(&mut run, step, contact(1, 1, false));
        }
        lost_ml += rate_ml_s / 60.0;
        rate_ml_s *= 0.9985;
        if step % 30 == 0 {
            let hidden = Some((rate_ml_s * 0.4).min(1.0) as f32);
            push(&mut run, step, LogRecord::Bleeding(BleedingRecord { lost_ml, rate_ml_s, sources: 1, hidden }));
        }
        if step % 600 == 0 || step == seconds * 60 - 1 {
            let is_reached = progress >= 0.6;
            push(
                &mut run,
                step,
                LogRecord::Goal(GoalRecord { goal: "cells".into(), progress: (progress / 0.6).min(1.0), is_reached }),
            );
        }
        let reached = |at: f32| (step == (at * seconds as f32) as u64 * 60).then_some(1.0);
        for (goal, at) in [("antrum", 0.55), ("nerve", 0.6 + 0.5 * rough), ("dry", 0.93)] {
            if let Some(progress) = reached(at) {
                push(&mut run, step, LogRecord::Goal(GoalRecord { goal: goal.into(), progress, is_reached: true }));
            }
        }
    }
    let score = (100.0 - 22.0 * rough - penalties).clamp(0.0, 100.0);
    let end = EndRecord {
        reason: if skill > 0.5 { EndReason::Done } else { EndReason::Stopped },
        score,
        is_passed: score >= 70.0,
    };
    push(&mut run, seconds * 60, LogRecord::End(end));
    run
}
