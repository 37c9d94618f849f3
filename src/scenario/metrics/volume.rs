//! What was removed, by structure, and whether it was to be removed.

use crate::scenario::GoalKind;
use crate::scenario::log::{LogHeader, LogRecord, LoggedBody, RunLog};
use std::collections::BTreeMap;

/// What was removed of a structure.
#[derive(Clone, Debug, PartialEq)]
pub struct RemovedStructure {
    /// Its name.
    pub name: String,
    /// How much, mm³.
    pub mm3: f64,
    /// Whether the scenario asks for it.
    pub is_target: bool,
}

/// Structures whose removal a scenario asks for: those of `Remove` goals, and of `Expose` goals unless they are critical
/// (to bare the facial nerve is not to drill it).
pub fn targets<'a>(header: &'a LogHeader) -> Vec<&'a str> {
    let target = |kind: &'a GoalKind| match kind {
        GoalKind::Remove { structure, .. } => Some(structure.as_str()),
        GoalKind::Expose { structure, .. } if !is_critical(header, structure) => Some(structure.as_str()),
        _ => None,
    };
    header.scenario.goals.iter().filter_map(|goal| target(&goal.kind)).collect()
}

/// Whether some body has a critical structure of this name.
fn is_critical(header: &LogHeader, structure: &str) -> bool {
    let of = |body: &LoggedBody| body.structures.iter().zip(&body.critical).any(|(name, is)| *is && name == structure);
    header.bodies.iter().any(of)
}

/// Name of a volume's structure in messages and reports: the volume's own for label 0, which belongs to none.
pub fn structure_name(header: &LogHeader, body: u32, label: u8) -> String {
    let Some(body) = header.bodies.get(body as usize) else { return format!("body {body}, label {label}") };
    match label.checked_sub(1).map(|index| body.structures.get(usize::from(index))) {
        None => body.name.clone(),
        Some(Some(name)) => name.clone(),
        Some(None) => format!("{}, label {label}", body.name),
    }
}

/// What a run removed, mm³, by body and label. Volumes that are no numbers, or negative, do not count.
pub fn removed_by_label(run: &RunLog) -> BTreeMap<(u32, u8), f64> {
    let mut sums: BTreeMap<(u32, u8), f64> = BTreeMap::new();
    for entry in &run.entries {
        let LogRecord::Removal(removal) = &entry.record else { continue };
        for (label, mm3) in &removal.by_label_mm3 {
            if mm3.is_finite() && *mm3 > 0.0 {
                *sums.entry((removal.body, *label)).or_default() += mm3;
            }
        }
    }
    sums
}

/// The same by name, in the order of bodies and labels.
pub fn removed(run: &RunLog) -> Vec<RemovedStructure> {
    let targets = targets(&run.header);
    let structure = |((body, label), mm3): ((u32, u8), f64)| {
        let name = structure_name(&run.header, body, label);
        let is_target = targets.contains(&name.as_str());
        RemovedStructure { name, mm3, is_target }
    };
    removed_by_label(run).into_iter().map(structure).collect()
}
