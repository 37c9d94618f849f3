//! What can be wrong with a scenario.

use bevy::reflect::Reflect;

/// Why a scenario cannot be used: for who must mend the file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Reflect)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{file}: {reason}")]
    Io {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// It is no scenario.
    #[error("{file}: line {line}, column {column}: {reason}")]
    Syntax {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// The column, from 1.
        column: usize,
        /// What is wrong there.
        reason: String,
    },
    /// A later version of the crate wrote it.
    #[error(
        "{file}: field `version`: written as version {version}, and this program reads up to {known}: use a newer one"
    )]
    Newer {
        /// The file.
        file: String,
        /// Its version.
        version: u32,
        /// The newest that can be read.
        known: u32,
    },
    /// A field says what cannot be.
    #[error("{file}: {field}: {reason}")]
    Field {
        /// The file.
        file: String,
        /// The field, as in `goal "antrum": share`.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A goal or rule is of a structure that is not there.
    #[error("{file}: {field}: there is no structure \"{name}\" in the scene{}", did_you_mean(.nearest, .known))]
    UnknownStructure {
        /// The file.
        file: String,
        /// The goal or rule.
        field: String,
        /// The name.
        name: String,
        /// The one that is spelt most like it.
        nearest: Option<String>,
        /// Those that are there.
        known: Vec<String>,
    },
}

fn did_you_mean(nearest: &Option<String>, known: &[String]) -> String {
    match nearest {
        Some(nearest) => format!(": did you mean \"{nearest}\"?"),
        None if known.is_empty() => ", which has none".into(),
        None => format!("; there are {}", known.join(", ")),
    }
}

/// The name that is spelt most like another one, if any is like it.
pub(super) fn nearest_spelling<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |name: &str| name.to_lowercase().replace(['_', '-'], " ");
    let wanted = plain(name);
    let score = |known: &str| strsim::jaro_winkler(&wanted, &plain(known));
    // Of equally near ones the first.
    let best = known.into_iter().map(|known| (score(known), known)).reduce(|a, b| if b.0 > a.0 { b } else { a })?;
    (best.0 >= 0.75).then_some(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_spelling_is_found() {
        let known = ["facial nerve", "sigmoid sinus", "dura", "antrum"];
        assert_eq!(nearest_spelling("facial_nerve", known), Some("facial nerve"));
        assert_eq!(nearest_spelling("Sigmiod Sinus", known), Some("sigmoid sinus"));
        assert_eq!(nearest_spelling("antrm", known), Some("antrum"));
        assert_eq!(nearest_spelling("spleen", known), None);
        assert_eq!(nearest_spelling("dura", []), None);
    }
}
