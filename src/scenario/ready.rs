//! The scenarios that ship with the crate.

use super::{Scenario, ScenarioError};

/// A scenario that ships with the crate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadyScenario {
    /// What it is asked for by.
    pub id: &'static str,
    /// Its text.
    pub text: &'static str,
}

/// All of them.
pub const READY_SCENARIOS: [ReadyScenario; 3] = [
    ReadyScenario {
        id: "bleeding-control",
        text: include_str!("../../assets/scenarios/bleeding_control.scenario.ron"),
    },
    ReadyScenario { id: "mastoidectomy", text: include_str!("../../assets/scenarios/mastoidectomy.scenario.ron") },
    ReadyScenario { id: "lesions", text: include_str!("../../assets/scenarios/lesions.scenario.ron") },
];

impl ReadyScenario {
    /// One by its id.
    pub fn find(id: &str) -> Option<Self> {
        READY_SCENARIOS.into_iter().find(|ready| ready.id == id)
    }

    /// What it says.
    ///
    /// # Errors
    /// None that a test has not ruled out.
    pub fn scenario(&self) -> Result<Scenario, ScenarioError> {
        Scenario::from_bytes(self.text.as_bytes(), self.id)
    }
}
