//! Statements of the Experience API 1.0.3, as far as a report needs them
//! (<https://github.com/adlnet/xAPI-Spec/blob/master/xAPI-Data.md>).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Texts by language tag (RFC 5646).
pub type LanguageMap = BTreeMap<String, String>;
/// What the specification does not name, by IRI.
pub type Extensions = BTreeMap<String, serde_json::Value>;

/// Somebody did something with something.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Statement {
    /// A UUID.
    pub id: String,
    /// Who.
    pub actor: Agent,
    /// Did what.
    pub verb: Verb,
    /// With what.
    pub object: Activity,
    /// How it turned out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub result: Option<StatementResult>,
    /// In which connection.
    pub context: StatementContext,
    /// When, ISO 8601.
    pub timestamp: String,
    /// Version of the specification.
    pub version: String,
}

/// A person, known by exactly one of a mail address and an account.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Agent {
    /// `Agent`.
    #[serde(rename = "objectType")]
    pub object_type: String,
    /// What they are called.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// A mail address as an IRI: `mailto:somebody@example.org`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mbox: Option<String>,
    /// An account.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub account: Option<Account>,
}

/// An account in some system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// The system's address.
    #[serde(rename = "homePage")]
    pub home_page: String,
    /// The name or number there.
    pub name: String,
}

impl Agent {
    /// Known by a mail address, without `mailto:`.
    pub fn with_mail(name: Option<String>, address: &str) -> Self {
        Self { object_type: "Agent".into(), name, mbox: Some(format!("mailto:{address}")), account: None }
    }

    /// Known by an account: what an institution should prefer, as it need not tell who somebody is.
    pub fn with_account(name: Option<String>, home_page: &str, account: &str) -> Self {
        let account = Account { home_page: home_page.into(), name: account.into() };
        Self { object_type: "Agent".into(), name, mbox: None, account: Some(account) }
    }
}

/// What somebody did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verb {
    /// Its IRI.
    pub id: String,
    /// What people call it.
    pub display: LanguageMap,
}

/// What it was done with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Activity {
    /// `Activity`.
    #[serde(rename = "objectType")]
    pub object_type: String,
    /// Its IRI.
    pub id: String,
    /// What it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub definition: Option<ActivityDefinition>,
}

/// What an activity is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActivityDefinition {
    /// What people call it.
    pub name: LanguageMap,
    /// What it is about.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub description: LanguageMap,
    /// IRI of its type.
    #[serde(rename = "type")]
    pub kind: String,
    /// How it is answered.
    #[serde(rename = "interactionType", default, skip_serializing_if = "Option::is_none")]
    pub interaction_type: Option<String>,
    /// What would be right.
    #[serde(rename = "correctResponsesPattern", default, skip_serializing_if = "Vec::is_empty")]
    pub correct_responses_pattern: Vec<String>,
    /// The steps of a performance.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<InteractionStep>,
}

/// A step of a performance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InteractionStep {
    /// Its id, without white space.
    pub id: String,
    /// What it is.
    pub description: LanguageMap,
}

/// How something turned out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatementResult {
    /// The score.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
    /// Whether it was done well enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub success: Option<bool>,
    /// Whether it was done to the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completion: Option<bool>,
    /// What was done, in the form that the interaction type asks for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response: Option<String>,
    /// How long it took, as an ISO 8601 duration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration: Option<String>,
    /// More.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub extensions: Extensions,
}

/// A score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// -1 to 1.
    pub scaled: f64,
    /// Between `min` and `max`.
    pub raw: f64,
    /// The lowest there is.
    pub min: f64,
    /// The highest there is.
    pub max: f64,
}

/// In which connection something was done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatementContext {
    /// UUID of the attempt.
    pub registration: String,
    /// Who taught.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instructor: Option<Agent>,
    /// Activities around it.
    #[serde(rename = "contextActivities", default, skip_serializing_if = "Option::is_none")]
    pub context_activities: Option<ContextActivities>,
    /// The program.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub platform: Option<String>,
    /// Language tag of the statement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub language: Option<String>,
    /// More.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub extensions: Extensions,
}

/// Activities around one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContextActivities {
    /// What it is a part of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parent: Vec<Activity>,
    /// What it belongs to more loosely.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub grouping: Vec<Activity>,
}
