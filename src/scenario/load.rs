//! Scenarios from files, and what they may say.

use super::error::{ScenarioError, nearest_spelling};
use super::{
    Goal, GoalKind, Lesion, PatientEvent, PatientEventKind, Rule, RuleKind, SCENARIO_VERSION, Scenario, ScenarioScene,
    ScenarioTool,
};
use crate::tools::ToolKind;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;

/// Largest file that is read, bytes.
const MOST_BYTES: usize = 4 << 20;
/// Most other burrs of a drill.
const MOST_BURRS: usize = 32;
/// What files of saved worlds end in.
const WORLD_ENDING: &str = ".surgery.scn.ron";
/// Most goals, rules and lesions.
const MOST: usize = 10_000;

impl Scenario {
    /// Reads a scenario from a file.
    ///
    /// # Errors
    /// It cannot be read, or says what cannot be.
    pub fn read(file: &Path) -> Result<Self, ScenarioError> {
        let name = file.display().to_string();
        let io = |error: std::io::Error| ScenarioError::Io { file: name.clone(), reason: error.to_string() };
        Self::from_bytes(&std::fs::read(file).map_err(io)?, &name)
    }

    /// Reads a scenario from its text, and checks it; `file` is what errors call it.
    ///
    /// # Errors
    /// It says what cannot be.
    pub fn from_bytes(bytes: &[u8], file: &str) -> Result<Self, ScenarioError> {
        let io = |reason: String| ScenarioError::Io { file: file.into(), reason };
        if bytes.len() > MOST_BYTES {
            return Err(io(format!("{} bytes are too many for a scenario", bytes.len())));
        }
        let text = std::str::from_utf8(bytes).map_err(|error| io(format!("it is no UTF-8 text: {error}")))?;
        let options = ron::Options::default()
            .with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME)
            .with_recursion_limit(64);
        let syntax = |error: ron::error::SpannedError| ScenarioError::Syntax {
            file: file.into(),
            line: error.span.start.line,
            column: error.span.start.col,
            reason: error.code.to_string(),
        };
        // The version before all else: what a later one says may not be understood.
        #[derive(serde::Deserialize)]
        #[serde(rename = "Scenario")]
        struct Versioned {
            version: u32,
        }
        let Versioned { version } = options.from_str(text).map_err(syntax)?;
        if version > SCENARIO_VERSION {
            return Err(ScenarioError::Newer { file: file.into(), version, known: SCENARIO_VERSION });
        }
        let scenario: Self = options.from_str(text).map_err(syntax)?;
        scenario.check(file)?;
        Ok(scenario)
    }

    /// Its text, as [`from_bytes`](Self::from_bytes) reads it.
    pub fn to_text(&self) -> String {
        let pretty =
            ron::ser::PrettyConfig::new().struct_names(false).extensions(ron::extensions::Extensions::IMPLICIT_SOME);
        // Nothing of a scenario cannot be written.
        ron::ser::to_string_pretty(self, pretty).unwrap_or_default() + "\n"
    }

    /// Whether what it says can be; structures are looked for when it is begun in a scene.
    ///
    /// # Errors
    /// The first field that says what cannot be.
    pub fn check(&self, file: &str) -> Result<(), ScenarioError> {
        let check = Check { file };
        check.of(!self.name.trim().is_empty(), "name", || "it is empty".into())?;
        check.of(!self.goals.is_empty(), "goals", || "there are none: nothing could be reached".into())?;
        for (what, count) in [("goals", self.goals.len()), ("rules", self.rules.len()), ("tools", self.tools.len())] {
            check.of(count <= MOST, what, || format!("{count} are too many"))?;
        }
        if let ScenarioScene::World(path) = &self.scene {
            check.of(path.ends_with(WORLD_ENDING), "scene", || {
                format!("the world {path:?} is no saved one: their files end in {WORLD_ENDING}")
            })?;
        }
        check.between(self.patient.amount, 0.0, 1.0, "patient: amount")?;
        check.between(self.pass_score, 0.0, 100.0, "pass_score")?;
        if let Some(limit_s) = self.time_limit_s {
            check.between(limit_s, 1.0, 1e6, "time_limit_s")?;
        }
        check.of(self.events.len() <= MOST, "events", || format!("{} are too many", self.events.len()))?;
        for (place, event) in self.events.iter().enumerate() {
            check.event(event, &format!("event {}", place + 1))?;
        }
        let mut names = BTreeSet::new();
        for tool in &self.tools {
            check.of(names.insert(&tool.name), "tools", || format!("there are two with the name \"{}\"", tool.name))?;
            check.tool(tool)?;
        }
        let ids: Vec<&str> = self.goals.iter().map(|goal| goal.id.as_str()).collect();
        for (place, goal) in self.goals.iter().enumerate() {
            check.goal(goal, &ids, place)?;
        }
        let total: f32 = self.goals.iter().map(|goal| goal.weight).sum();
        check.of(total > 0.0, "goals", || "none of them has a weight: every run would have no score".into())?;
        let mut seen = BTreeSet::new();
        for rule in &self.rules {
            let field = |name: &str| format!("rule \"{}\": {name}", rule.id);
            check.of(!rule.id.trim().is_empty(), "rules", || "one has an empty id".into())?;
            check.of(seen.insert(&rule.id), &field("id"), || "another rule has it, too".into())?;
            check.rule(rule)?;
        }
        Ok(())
    }
}

struct Check<'a> {
    file: &'a str,
}

impl Check<'_> {
    fn of(&self, is_good: bool, field: &str, reason: impl FnOnce() -> String) -> Result<(), ScenarioError> {
        if is_good {
            return Ok(());
        }
        Err(ScenarioError::Field { file: self.file.into(), field: field.into(), reason: reason() })
    }

    fn between(&self, value: f32, least: f32, most: f32, field: &str) -> Result<(), ScenarioError> {
        self.of((least..=most).contains(&value), field, || format!("{value} is not from {least} to {most}"))
    }

    fn tool(&self, tool: &ScenarioTool) -> Result<(), ScenarioError> {
        let field = |name: &str| format!("tool \"{}\": {name}", tool.name);
        let burrs = &tool.tool.burrs;
        let ToolKind::Drill(head) = tool.tool.kind else {
            return self.of(burrs.is_empty(), &field("burrs"), || "it is no drill".into());
        };
        self.of(burrs.len() <= MOST_BURRS, &field("burrs"), || format!("{} are too many", burrs.len()))?;
        for (name, burr) in std::iter::once(("burr", &head.burr)).chain(burrs.iter().map(|burr| ("burrs", burr))) {
            burr.check().or_else(|fault| self.of(false, &field(name), || fault.to_string()))?;
        }
        Ok(())
    }

    fn event(&self, event: &PatientEvent, field: &str) -> Result<(), ScenarioError> {
        self.between(event.at_s, 0.0, 1e6, &format!("{field}: at_s"))?;
        let PatientEventKind::Bleed { uv, wound, .. } = &event.what;
        let is_on_map = uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all();
        self.of(is_on_map, &format!("{field}: uv"), || format!("{uv} is not on the map, 0 to 1"))?;
        let rate = wound.rate_m3_per_s;
        self.of((0.0..=1e-4).contains(&rate), &format!("{field}: rate_m3_per_s"), || {
            format!("{rate} is not from 0 to 0.0001, which is 100 ml a second")
        })
    }

    fn goal(&self, goal: &Goal, ids: &[&str], place: usize) -> Result<(), ScenarioError> {
        self.of(!goal.id.trim().is_empty(), "goals", || "one has an empty id".into())?;
        let field = |name: &str| format!("goal \"{}\": {name}", goal.id);
        self.of(!ids[..place].contains(&goal.id.as_str()), &field("id"), || "another goal has it, too".into())?;
        self.between(goal.weight, 0.0, 1e6, &field("weight"))?;
        for after in &goal.after {
            // Only earlier ones: so no two goals wait for one another.
            self.of(ids[..place].contains(&after.as_str()), &field("after"), || {
                let nearest = nearest_spelling(after, ids[..place].iter().copied());
                let hint = nearest.map_or_else(String::new, |nearest| format!(": did you mean \"{nearest}\"?"));
                format!("no goal before it has the id \"{after}\"{hint}")
            })?;
        }
        match &goal.kind {
            GoalKind::Reach { within_m, .. } => self.between(*within_m, 0.0, 1.0, &field("within_m")),
            GoalKind::Expose { share, cover_m, .. } => {
                self.share(*share, &field("share"))?;
                self.between(*cover_m, 0.0, 0.1, &field("cover_m"))
            }
            GoalKind::Remove { share, .. } => self.share(*share, &field("share")),
            GoalKind::Mark { lesions, for_s, .. } => {
                self.lesions(lesions, &field("lesions"))?;
                self.between(*for_s, 0.0, 3600.0, &field("for_s"))
            }
            GoalKind::Coagulate { lesions, share, .. } => {
                self.lesions(lesions, &field("lesions"))?;
                self.share(*share, &field("share"))
            }
            GoalKind::StopBleeding { below_ml_s, for_s } => {
                self.between(*below_ml_s, 0.0, 1e3, &field("below_ml_s"))?;
                self.between(*for_s, 0.0, 3600.0, &field("for_s"))
            }
            GoalKind::KeepVisible { share, of_time } => {
                self.share(*share, &field("share"))?;
                self.share(*of_time, &field("of_time"))
            }
        }
    }

    /// A share that is asked for: of nothing, nothing could be asked.
    fn share(&self, share: f32, field: &str) -> Result<(), ScenarioError> {
        self.of(share > 0.0 && share <= 1.0, field, || format!("{share} is not above 0 and up to 1"))
    }

    fn lesions(&self, lesions: &[Lesion], field: &str) -> Result<(), ScenarioError> {
        self.of(!lesions.is_empty() && lesions.len() <= MOST, field, || {
            format!("there are {}, which is not from 1 to {MOST}", lesions.len())
        })?;
        for lesion in lesions {
            let is_on_map = lesion.uv.cmpge(Vec2::ZERO).all() && lesion.uv.cmple(Vec2::ONE).all();
            self.of(is_on_map, field, || format!("uv: {} is not on the map, 0 to 1", lesion.uv))?;
            self.of((1e-4..=0.1).contains(&lesion.radius_m), field, || {
                format!("radius_m: {} is not from 0.0001 to 0.1", lesion.radius_m)
            })?;
        }
        Ok(())
    }

    fn rule(&self, rule: &Rule) -> Result<(), ScenarioError> {
        let field = |name: &str| format!("rule \"{}\": {name}", rule.id);
        self.between(rule.penalty, 0.0, 100.0, &field("penalty"))?;
        if let Some(most) = rule.most {
            self.between(most, 0.0, 100.0, &field("most"))?;
        }
        let near = |within_m: &f32| self.between(*within_m, 0.0, 0.1, &field("within_m"));
        match &rule.kind {
            RuleKind::Touch { .. } | RuleKind::Collision => Ok(()),
            RuleKind::OutOfTime => Ok(()),
            RuleKind::Cut { above_mm3, .. } | RuleKind::DrilledUnseen { above_mm3 } => {
                self.between(*above_mm3, 0.0, 1e6, &field("above_mm3"))
            }
            RuleKind::Force { within_m, above_n, .. } => {
                near(within_m)?;
                self.between(*above_n, 0.0, 1e3, &field("above_n"))
            }
            RuleKind::Speed { within_m, above_m_per_s, .. } => {
                near(within_m)?;
                self.between(*above_m_per_s, 0.0, 100.0, &field("above_m_per_s"))
            }
            RuleKind::Near { within_m, .. } => near(within_m),
            RuleKind::BurrTooLarge { within_m, above_m, .. } => {
                near(within_m)?;
                self.between(*above_m, 0.0, 0.1, &field("above_m"))
            }
            RuleKind::BurntOutside { lesions, above_mm2, .. } => {
                if !lesions.is_empty() {
                    self.lesions(lesions, &field("lesions"))?;
                }
                self.between(*above_mm2, 0.0, 1e6, &field("above_mm2"))
            }
            RuleKind::BloodLoss { above_ml } => self.between(*above_ml, 0.0, 1e5, &field("above_ml")),
        }
    }
}

/// Loads [`Scenario`]s from files that end in `.scenario.ron`.
#[derive(Clone, Copy, Debug, Default, TypePath)]
pub struct ScenarioLoader;

impl AssetLoader for ScenarioLoader {
    type Asset = Scenario;
    type Settings = ();
    type Error = ScenarioError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<Scenario, ScenarioError> {
        let file = context.path().to_string();
        let mut bytes = Vec::new();
        let io = |error: std::io::Error| ScenarioError::Io { file: file.clone(), reason: error.to_string() };
        reader.read_to_end(&mut bytes).await.map_err(io)?;
        Scenario::from_bytes(&bytes, &file)
    }

    fn extensions(&self) -> &[&str] {
        &["scenario.ron"]
    }
}
