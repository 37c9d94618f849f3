//! What can be wrong with a saved scene, said to the person who has to fix it.

use super::SceneVersion;
use bevy::prelude::*;

/// Why a scene cannot be saved or loaded.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum SceneError {
    /// The file could not be read from its place.
    #[error("{file}: {error}")]
    Io {
        /// The file.
        file: String,
        /// What the reader said.
        error: String,
    },
    /// The text is no scene: it is cut off, or holds something that cannot be there.
    #[error("{file}, line {line}, column {column}{}: {reason}", in_component(component))]
    Broken {
        /// The file.
        file: String,
        /// Line of the place, from 1.
        line: usize,
        /// Column of the place, from 1.
        column: usize,
        /// Type path of the component in which that is; none for what lies between components.
        component: Option<String>,
        /// What is wrong there.
        reason: String,
    },
    /// A component lacks something for which there is no default.
    #[error("{file}: {component} of entity {entity} {reason}")]
    Incomplete {
        /// The file.
        file: String,
        /// Type path of the component.
        component: String,
        /// The entity's number in the file.
        entity: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// Written by a version of the crate whose scenes this one cannot read.
    #[error(
        "{file}: the scene is of version {found}, and this version of bevy_surgery reads {}.0 to {}; use a version of the crate that wrote it, or save it anew",
        SceneVersion::NOW.major,
        SceneVersion::NOW
    )]
    OtherVersion {
        /// The file.
        file: String,
        /// The scene's version.
        found: SceneVersion,
    },
    /// A component of an older version has no successor.
    #[error("{file}, line {line}: {component} went with version {since}: {advice}")]
    Gone {
        /// The file.
        file: String,
        /// Line of the component, from 1.
        line: usize,
        /// Type path that the component had.
        component: String,
        /// The first version without it.
        since: SceneVersion,
        /// What to do.
        advice: String,
    },
    /// An asset that a program made cannot be found again.
    #[error(
        "{entity}: its {component} shows an asset that a program made and no file holds; load it from a file, or put a {instead} beside it"
    )]
    NotInAFile {
        /// The entity, by its name where it has one.
        entity: String,
        /// The component with the handle.
        component: String,
        /// Components that say what it is made of.
        instead: String,
    },
    /// A component refers to an entity that is not saved.
    #[error("{entity}: its {component} refers to an entity that is not saved; give that one a Name, or save it too")]
    NotInScene {
        /// The entity, by its name where it has one.
        entity: String,
        /// Type path of the component.
        component: String,
    },
    /// The scene could not be written down.
    #[error("{reason}")]
    NotWritten {
        /// What Bevy said.
        reason: String,
    },
}

fn in_component(component: &Option<String>) -> String {
    component.as_ref().map(|component| format!(", in {component}")).unwrap_or_default()
}
