//! What a hand has to do, from what a scenario asks for.

use crate::scenario::{GoalKind, PatientEventKind, Scenario};
use crate::tools::ToolKind;
use bevy::math::Vec2;

/// One thing to be done.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Task {
    /// A place of an organ is touched for a while, and burnt where the instrument burns.
    Touch {
        organ: String,
        uv: Vec2,
        /// Around the place, metres.
        radius_m: f32,
        /// How long, seconds.
        for_s: f32,
        burns: bool,
        /// Not before this time, seconds.
        not_before_s: f32,
    },
    /// A cavity is drilled until nothing more is to be reached by that.
    Drill {
        /// What is to be seen or removed.
        structures: Vec<String>,
    },
}

impl Task {
    /// Whether an instrument can do it.
    pub fn is_for(&self, kind: &ToolKind) -> bool {
        match self {
            Self::Touch { burns: true, .. } => matches!(kind, ToolKind::CauteryHook(_)),
            Self::Touch { burns: false, .. } => matches!(kind, ToolKind::Probe),
            Self::Drill { .. } => matches!(kind, ToolKind::Drill(_)),
        }
    }
}

/// All tasks of a scenario, in the order of its goals.
pub(super) fn plan(scenario: &Scenario, burn_s: f32) -> Vec<Task> {
    let mut tasks = Vec::new();
    let mut drilled: Vec<String> = Vec::new();
    for goal in &scenario.goals {
        match &goal.kind {
            GoalKind::Mark { organ, lesions, for_s } => tasks.extend(lesions.iter().map(|lesion| Task::Touch {
                organ: organ.clone(),
                uv: lesion.uv,
                radius_m: 0.0,
                for_s: for_s + 0.3,
                burns: false,
                not_before_s: 0.0,
            })),
            GoalKind::Coagulate { organ, lesions, .. } => tasks.extend(lesions.iter().map(|lesion| {
                // As long as the area takes.
                let share = (lesion.radius_m / 2e-3).powi(2).max(1.0);
                Task::Touch {
                    organ: organ.clone(),
                    uv: lesion.uv,
                    radius_m: lesion.radius_m,
                    for_s: burn_s * share,
                    burns: true,
                    not_before_s: 0.0,
                }
            })),
            GoalKind::StopBleeding { .. } => tasks.extend(scenario.events.iter().map(|event| {
                let PatientEventKind::Bleed { organ, uv, .. } = &event.what;
                Task::Touch {
                    organ: organ.clone(),
                    uv: *uv,
                    radius_m: 1.5e-3,
                    for_s: burn_s,
                    burns: true,
                    not_before_s: event.at_s + 0.5,
                }
            })),
            GoalKind::Remove { structure, .. }
            | GoalKind::Expose { structure, .. }
            | GoalKind::Reach { structure, .. } => {
                drilled.push(structure.clone());
            }
            GoalKind::KeepVisible { .. } => {}
        }
    }
    if !drilled.is_empty() {
        tasks.push(Task::Drill { structures: drilled });
    }
    tasks
}
