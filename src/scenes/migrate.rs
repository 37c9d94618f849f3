//! Scenes of older versions: what has got another name since, and what has gone.

use super::text::{Entry, entries, fields, line_of};
use super::{SceneError, SceneVersion};
use bevy::reflect::TypePath;
use std::borrow::Cow;
use std::ops::Range;

/// Something that is different since a version.
#[derive(Clone, Copy, Debug)]
pub(super) struct Migration {
    /// The first version in which it is so.
    pub since: SceneVersion,
    pub change: Change,
}

/// What is different. Components by the type paths that they had at that time.
// Nothing has changed yet: today only tests make some.
#[cfg_attr(not(test), expect(dead_code))]
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// A component has another type path.
    Renamed { from: &'static str, to: &'static str },
    /// A field of a component has another name.
    FieldRenamed { component: &'static str, from: &'static str, to: &'static str },
    /// A component is gone, and what to do instead.
    Gone { component: &'static str, advice: &'static str },
}

/// All changes since the first version, the oldest first. A change of a saved component's path or of a field's name belongs here, with
/// the next minor version in [`SceneVersion::NOW`].
pub(super) const MIGRATIONS: &[Migration] = &[];

/// The text as today's version would have written it.
///
/// # Errors
/// [`SceneError`] for a scene of a version that cannot be read, or with a component that is gone. A text without a version is
/// taken as it is.
pub(super) fn migrated<'a>(
    file: &str,
    text: &'a str,
    now: SceneVersion,
    migrations: &[Migration],
) -> Result<Cow<'a, str>, SceneError> {
    let Some(found) = version_of(text) else { return Ok(Cow::Borrowed(text)) };
    if found.major != now.major || found > now {
        return Err(SceneError::OtherVersion { file: file.into(), found });
    }
    let mut text = Cow::Borrowed(text);
    for Migration { since, change } in migrations.iter().filter(|migration| migration.since > found) {
        let places = entries(&text);
        let of = |wanted: &str| places.iter().filter(move |entry| entry.path == wanted).collect::<Vec<&Entry>>();
        let (places, to): (Vec<Range<usize>>, &str) = match *change {
            Change::Renamed { from, to } => (of(from).iter().map(|entry| entry.path_at.clone()).collect(), to),
            Change::FieldRenamed { component, from, to } => {
                let values = of(component);
                (values.iter().flat_map(|entry| fields(&text, &entry.value_at, from)).collect(), to)
            }
            Change::Gone { component, advice } => match of(component).first() {
                None => continue,
                Some(entry) => {
                    return Err(SceneError::Gone {
                        file: file.into(),
                        line: line_of(&text, entry.path_at.start),
                        component: component.into(),
                        since: *since,
                        advice: advice.into(),
                    });
                }
            },
        };
        // From behind, so that the places before stay where they are.
        for place in places.into_iter().rev() {
            text.to_mut().replace_range(place, to);
        }
    }
    Ok(text)
}

/// Rooms and crates that are there with the feature `render` only.
#[cfg(not(feature = "render"))]
const SEEN: &[&str] =
    &["bevy_surgery::view::", "bevy_camera::", "bevy_core_pipeline::", "bevy_light::", "bevy_render::"];

/// The text without what is only seen, so that programs that draw nothing read the same scenes.
#[cfg(not(feature = "render"))]
pub(super) fn without_views(text: &str) -> String {
    let mut text = text.to_string();
    for entry in entries(&text).iter().rev().filter(|entry| SEEN.iter().any(|seen| entry.path.starts_with(seen))) {
        let behind = &text[entry.value_at.end..];
        let end = entry.value_at.end + usize::from(behind.starts_with(','));
        // Lines keep their numbers for messages.
        let lines = "\n".repeat(line_of(&text, end) - line_of(&text, entry.path_at.start));
        text.replace_range(entry.path_at.start - 1..end, &lines);
    }
    text
}

/// The version that a scene's text carries.
fn version_of(text: &str) -> Option<SceneVersion> {
    let entry = entries(text).into_iter().find(|entry| entry.path == SceneVersion::type_path())?;
    ron::from_str(&text[entry.value_at]).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn version(major: u32, minor: u32) -> SceneVersion {
        SceneVersion { major, minor }
    }

    const NOW: SceneVersion = version(0, 4);

    const CHANGES: &[Migration] = &[
        Migration { since: version(0, 2), change: Change::Renamed { from: "a::Old", to: "a::Newer" } },
        Migration {
            since: version(0, 3),
            change: Change::FieldRenamed { component: "a::Newer", from: "size", to: "size_m" },
        },
        Migration {
            since: version(0, 3),
            change: Change::Gone { component: "a::Gone", advice: "put an a::Newer in its place" },
        },
        Migration { since: version(0, 4), change: Change::Renamed { from: "a::Newer", to: "b::Newest" } },
    ];

    fn scene(minor: u32, components: &str) -> String {
        format!(
            "(resources: {{\"bevy_surgery::scenes::version::SceneVersion\": (major: 0, minor: {minor})}},\n\
             entities: {{1: (components: {{\n{components}}})}})"
        )
    }

    #[test]
    fn changes_are_made_one_after_another_and_only_those_since() {
        let old =
            scene(1, "\"a::Old\": (size: 2.0, part: (size: 3.0), name: \"size: a::Old\"),\n\"c::Size\": (size: 1),\n");
        let new = migrated("f", &old, NOW, CHANGES).expect("an older one");
        let wanted =
            "\"b::Newest\": (size_m: 2.0, part: (size: 3.0), name: \"size: a::Old\"),\n\"c::Size\": (size: 1),\n";
        assert_eq!(*new, scene(1, wanted));
        let younger = scene(3, "\"a::Old\": (size: 2.0), \"a::Newer\": (size: 2.0)");
        let new = migrated("f", &younger, NOW, CHANGES).expect("an older one");
        assert_eq!(*new, scene(3, "\"a::Old\": (size: 2.0), \"b::Newest\": (size: 2.0)"));
        let today = scene(4, "\"a::Old\": (size: 2.0)");
        assert!(matches!(migrated("f", &today, NOW, CHANGES), Ok(Cow::Borrowed(_))), "nothing to do");
    }

    #[test]
    fn what_cannot_be_read_says_why() {
        let gone = migrated("old.scn.ron", &scene(2, "\"a::Gone\": ()"), NOW, CHANGES).expect_err("it is gone");
        let told = gone.to_string();
        assert_eq!(told, "old.scn.ron, line 3: a::Gone went with version 0.3: put an a::Newer in its place");
        for (major, minor) in [(0, 5), (1, 0)] {
            let text = scene(minor, "").replace("major: 0", &format!("major: {major}"));
            let error = migrated("new.scn.ron", &text, NOW, CHANGES).expect_err("from the future");
            let found = version(major, minor);
            assert_eq!(error, SceneError::OtherVersion { file: "new.scn.ron".into(), found });
        }
    }

    #[test]
    fn a_scene_without_a_version_stays_as_it_is() {
        let text = "(resources: {}, entities: {1: (components: {\"a::Old\": ()})})";
        assert_eq!(migrated("f", text, NOW, CHANGES).expect("as it is"), text);
        assert_eq!(migrated("f", "no scene", NOW, CHANGES).expect("as it is"), "no scene");
    }
}
