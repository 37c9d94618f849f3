//! Structures that a scene sets otherwise than the file that they come from.

use super::Structure;
use crate::volume::{CtVolume, PrepareCuts, Volume};
use bevy::prelude::*;
use std::collections::BTreeSet;
use tracing::warn;

/// Says how some structures of an entity's volume are: each entry takes the place of the structure with its name. Colour, hardness,
/// bleeding and whether it is critical are set so; which voxel belongs to what stays as it is.
///
/// All entities that show the same asset share its structures, and the last change counts. When the component is taken away the
/// structures are as they came. A name that the volume does not have, and a hardness or rate that is out of range, is warned of and
/// changes nothing.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct StructureChanges {
    /// Structures as they are to be, found by their names.
    pub changes: Vec<Structure>,
}

/// The structures of an entity's volume as they came.
#[derive(Component)]
struct AsTheyCame {
    volume: AssetId<Volume>,
    list: Vec<Structure>,
}

pub(in crate::volume) fn build(app: &mut App) {
    app.register_type::<StructureChanges>().add_systems(PreUpdate, change.before(PrepareCuts));
}

type Changed = (Entity, &'static CtVolume, Option<Ref<'static, StructureChanges>>, Option<&'static AsTheyCame>);

fn change(
    bodies: Query<Changed, Or<(With<StructureChanges>, With<AsTheyCame>)>>,
    volumes: Option<ResMut<Assets<Volume>>>,
    mut commands: Commands,
) {
    let Some(mut volumes) = volumes else { return };
    for (entity, body, changes, came) in &bodies {
        let id = body.0.id();
        let came = came.filter(|came| came.volume == id);
        let Some(structures) = volumes.get(id).and_then(Volume::structures) else { continue };
        let is_new = came.is_none();
        if changes.as_ref().is_some_and(|changes| !changes.is_changed()) && !is_new {
            continue;
        }
        let original = came.map_or_else(|| structures.list().to_vec(), |came| came.list.clone());
        let wanted = changes.as_ref().map_or_else(|| original.clone(), |changes| changed(&original, &changes.changes));
        if wanted != structures.list()
            && let Some(mut volume) = volumes.get_mut(id)
        {
            volume.set_structure_list(wanted);
        }
        match changes {
            Some(_) if is_new => commands.entity(entity).try_insert(AsTheyCame { volume: id, list: original }),
            None => commands.entity(entity).try_remove::<AsTheyCame>(),
            Some(_) => continue,
        };
    }
}

/// The list with its changes.
fn changed(original: &[Structure], changes: &[Structure]) -> Vec<Structure> {
    let mut list = original.to_vec();
    let mut unknown = BTreeSet::new();
    for change in changes {
        match list.iter_mut().find(|structure| structure.name == change.name) {
            None => {
                unknown.insert(change.name.as_str());
            }
            Some(structure) => match change.check() {
                Ok(()) => structure.clone_from(change),
                Err(reason) => warn!("StructureChanges: {reason}; {} stays as it is", change.name),
            },
        }
    }
    for name in unknown {
        let near = original
            .iter()
            .map(|structure| structure.name.as_str())
            .max_by(|one, other| strsim::jaro_winkler(one, name).total_cmp(&strsim::jaro_winkler(other, name)));
        let near = near.map_or_else(String::new, |near| format!("; the nearest is \"{near}\""));
        warn!("StructureChanges: the volume has no structure \"{name}\"{near}");
    }
    list
}
