//! What readers of files share: text of a file in a message, and the files beside a file.

use bevy::asset::LoadContext;
use std::collections::{BTreeMap, BTreeSet};

/// Gives out the bytes of a file beside another, by its path relative to that one's folder, or says why not.
pub(crate) type Fetch<'a> = &'a mut dyn FnMut(&str) -> Result<Vec<u8>, String>;

/// A piece of a file for a message: one line, printable, not too long.
pub(crate) fn excerpt(text: &str) -> String {
    const SHOWN: usize = 80;
    let mut characters = text.trim().chars().map(|c| if c.is_control() { '\u{fffd}' } else { c });
    let mut short: String = characters.by_ref().take(SHOWN).collect();
    if characters.next().is_some() {
        short.push_str("...");
    }
    short
}

/// Parses an asset whose text names the files that it needs: parses, looks what was asked for, fetches it, parses again.
///
/// `parse` asks for files by names relative to the asset's folder.
pub(crate) async fn parse_with_siblings<R>(context: &mut LoadContext<'_>, mut parse: impl FnMut(Fetch<'_>) -> R) -> R {
    let path = context.path().clone();
    let mut siblings: BTreeMap<String, Result<Vec<u8>, String>> = BTreeMap::new();
    loop {
        let mut asked = BTreeSet::new();
        let parsed = parse(&mut |name| match siblings.get(name) {
            Some(fetched) => fetched.clone(),
            None => {
                asked.insert(name.to_string());
                Err("is being fetched".into())
            }
        });
        if asked.is_empty() {
            return parsed;
        }
        for name in asked {
            let fetched = match path.resolve_embed_str(&name) {
                Ok(sibling) => context.read_asset_bytes(sibling).await.map_err(|error| error.to_string()),
                Err(error) => Err(error.to_string()),
            };
            siblings.insert(name, fetched);
        }
    }
}
