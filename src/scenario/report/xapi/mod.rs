//! A report as statements of the Experience API: one that the procedure was passed or not, and one for each goal.
//!
//! They are only made, never sent: an app writes them to a file ([`to_json_lines`]) or posts them to its learning record store.

mod check;
mod statement;

pub use statement::{
    Account, Activity, ActivityDefinition, Agent, ContextActivities, Extensions, InteractionStep, LanguageMap, Score,
    Statement, StatementContext, StatementResult, Verb,
};

use super::{GoalReport, ReportError, RunReport};
use serde_json::{Value, json};

/// Version of the specification.
pub const XAPI_VERSION: &str = "1.0.3";
/// What the verbs' IRIs begin with.
const VERBS: &str = "http://adlnet.gov/expapi/verbs/";
/// Type of activities that are answered.
const INTERACTION: &str = "http://adlnet.gov/expapi/activities/cmi.interaction";
/// Type of parts of a larger activity.
const OBJECTIVE: &str = "http://adlnet.gov/expapi/activities/objective";

/// What a report does not know of its statements.
#[derive(Clone, Debug, PartialEq)]
pub struct XapiContext {
    /// UUID of the attempt.
    pub registration: String,
    /// IRI of the scenario: goals and extensions get theirs from it.
    pub activity_iri: String,
    /// When the run ended, ISO 8601 with a zone.
    pub timestamp: String,
    /// Language tag of the scenario's texts.
    pub language: String,
    /// Who taught.
    pub instructor: Option<Agent>,
    /// Name of the program.
    pub platform: Option<String>,
}

impl RunReport {
    /// The statements of a run: first that of the procedure, then those of its goals. The same report, actor and context make
    /// the same ids, so that what is sent twice is stored once.
    ///
    /// # Errors
    /// Where actor or context break the specification's rules.
    pub fn xapi_statements(&self, actor: &Agent, context: &XapiContext) -> Result<Vec<Statement>, ReportError> {
        check::check(actor, context)?;
        let maker = Maker { report: self, actor, context, steps: steps(&self.goals) };
        let mut statements = vec![maker.procedure()?];
        for (goal, step) in self.goals.iter().zip(&maker.steps) {
            statements.push(maker.goal(goal, step)?);
        }
        Ok(statements)
    }
}

/// Statements as JSON, one a line.
///
/// # Errors
/// Where they cannot be written as JSON.
pub fn to_json_lines(statements: &[Statement]) -> Result<String, ReportError> {
    let mut lines = String::new();
    for statement in statements {
        lines += &serde_json::to_string(statement)?;
        lines.push('\n');
    }
    Ok(lines)
}

struct Maker<'a> {
    report: &'a RunReport,
    actor: &'a Agent,
    context: &'a XapiContext,
    /// Ids of the goals as steps.
    steps: Vec<String>,
}

impl Maker<'_> {
    fn procedure(&self) -> Result<Statement, ReportError> {
        let outcome = &self.report.outcome;
        let verb = match outcome.is_passed {
            Some(true) => "passed",
            Some(false) => "failed",
            // Somebody began, and no end is known.
            None => "attempted",
        };
        let score = outcome.score.filter(|score| score.is_finite()).map(|score| {
            let raw = f64::from(score).clamp(0.0, 100.0);
            Score { scaled: raw / 100.0, raw, min: 0.0, max: 100.0 }
        });
        let result = StatementResult {
            score,
            success: outcome.is_passed,
            completion: Some(!self.report.goals.is_empty() && self.report.goals.iter().all(|goal| goal.is_reached)),
            response: (!self.steps.is_empty()).then(|| self.response()),
            duration: outcome.time_s.and_then(duration),
            extensions: self.extensions(),
        };
        self.statement(verb, self.scenario(), result, None, 0)
    }

    fn goal(&self, goal: &GoalReport, step: &str) -> Result<Statement, ReportError> {
        let result = StatementResult {
            success: Some(goal.is_reached),
            completion: Some(goal.is_reached),
            duration: goal.reached_s.and_then(duration),
            // The specification wants no progress in the score.
            extensions: [(self.iri("progress"), json!(goal.progress))].into(),
            ..StatementResult::default()
        };
        let definition = ActivityDefinition {
            name: self.text(&goal.title),
            description: LanguageMap::new(),
            kind: OBJECTIVE.into(),
            interaction_type: None,
            correct_responses_pattern: Vec::new(),
            steps: Vec::new(),
        };
        let id = self.iri(&format!("goal/{step}"));
        let object = Activity { object_type: "Activity".into(), id, definition: Some(definition) };
        let parent = Activity { definition: None, ..self.scenario() };
        let index = 1 + self.steps.iter().position(|id| id == step).unwrap_or(0);
        self.statement(if goal.is_reached { "completed" } else { "attempted" }, object, result, Some(parent), index)
    }

    fn statement(
        &self,
        verb: &str,
        object: Activity,
        result: StatementResult,
        parent: Option<Activity>,
        index: usize,
    ) -> Result<Statement, ReportError> {
        let context = self.context;
        let mut statement = Statement {
            id: String::new(),
            actor: self.actor.clone(),
            verb: Verb { id: format!("{VERBS}{verb}"), display: [("en".to_string(), verb.to_string())].into() },
            object,
            result: Some(result),
            context: StatementContext {
                registration: context.registration.to_lowercase(),
                instructor: context.instructor.clone(),
                context_activities: parent
                    .map(|parent| ContextActivities { parent: vec![parent], grouping: Vec::new() }),
                platform: context.platform.clone(),
                language: Some(context.language.clone()),
                extensions: [(self.iri("seed"), json!(self.report.seed))].into(),
            },
            timestamp: context.timestamp.clone(),
            version: XAPI_VERSION.into(),
        };
        statement.id = uuid(index, &serde_json::to_vec(&statement)?);
        Ok(statement)
    }

    /// The whole procedure: a performance whose steps are the goals.
    fn scenario(&self) -> Activity {
        let steps = self.steps.iter().zip(&self.report.goals);
        let done: Vec<String> = self.steps.iter().map(|step| format!("{step}[.]1")).collect();
        let is_interaction = !self.steps.is_empty();
        let definition = ActivityDefinition {
            name: self.text(&self.report.scenario),
            description: self.text(&self.report.description),
            kind: INTERACTION.into(),
            interaction_type: Some(if is_interaction { "performance" } else { "other" }.into()),
            correct_responses_pattern: if is_interaction { vec![done.join("[,]")] } else { Vec::new() },
            steps: steps
                .map(|(id, goal)| InteractionStep { id: id.clone(), description: self.text(&goal.title) })
                .collect(),
        };
        let id = self.context.activity_iri.clone();
        Activity { object_type: "Activity".into(), id, definition: Some(definition) }
    }

    /// What was done of each step: 1 for a goal that is reached, else how far it came.
    fn response(&self) -> String {
        let step = |(step, goal): (&String, &GoalReport)| {
            // A goal nearly reached is not reached.
            let progress =
                if goal.is_reached { 1.0 } else { (f64::from(goal.progress) * 1e3).floor().clamp(0.0, 999.0) / 1e3 };
            format!("{step}[.]{progress}")
        };
        self.steps.iter().zip(&self.report.goals).map(step).collect::<Vec<_>>().join("[,]")
    }

    /// Metrics by key, and how often each rule was broken.
    fn extensions(&self) -> Extensions {
        let metric = |metric: &crate::scenario::metrics::Metric| {
            let value = metric.value.filter(|value| value.is_finite())?;
            Some((metric.kind.key(), json!({ "value": value, "unit": metric.unit, "score": metric.score })))
        };
        let metrics: serde_json::Map<String, Value> = self.report.metrics.iter().filter_map(metric).collect();
        let mut rules = std::collections::BTreeMap::<&str, u64>::new();
        for violation in &self.report.violations {
            *rules.entry(&violation.rule).or_default() += 1;
        }
        [(self.iri("metrics"), Value::Object(metrics)), (self.iri("violations"), json!(rules))].into()
    }

    fn text(&self, text: &str) -> LanguageMap {
        if text.is_empty() { LanguageMap::new() } else { [(self.context.language.clone(), text.to_string())].into() }
    }

    /// An IRI under the scenario's own.
    fn iri(&self, what: &str) -> String {
        let base = &self.context.activity_iri;
        let hyphen = if base.ends_with(['/', '#', ':']) { "" } else { "/" };
        format!("{base}{hyphen}{what}")
    }
}

/// Ids of goals as ids of steps: letters, digits, `-` and `_`, each of them once.
fn steps(goals: &[GoalReport]) -> Vec<String> {
    let mut steps: Vec<String> = Vec::new();
    for (index, goal) in goals.iter().enumerate() {
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '_' };
        let id: String = goal.id.chars().map(plain).collect();
        let mut id = if id.is_empty() { format!("goal_{}", index + 1) } else { id };
        while steps.contains(&id) {
            id.push('_');
        }
        steps.push(id);
    }
    steps
}

/// An ISO 8601 duration, to a hundredth of a second as the specification compares them.
fn duration(time_s: f64) -> Option<String> {
    (time_s.is_finite() && time_s >= 0.0).then(|| format!("PT{}S", (time_s * 100.0).round() / 100.0))
}

/// A UUID of version 4 whose pseudo-random bits are a hash of what it names.
fn uuid(index: usize, content: &[u8]) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&(index as u64).to_le_bytes());
    hasher.update(content);
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    bytes[6] = bytes[6] & 0x0f | 0x40;
    bytes[8] = bytes[8] & 0x3f | 0x80;
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]].join("-")
}
