//! What of a scene a scenario means: found by name once, when a run begins.

use super::exposure::Exposure;
use super::lesions::WatchedLesions;
use super::scene::Scene;
use super::volumes::WatchedVolume;
use crate::scenario::error::nearest_spelling;
use crate::scenario::judge::{TargetLesions, TargetStructure, Targets};
use crate::scenario::log::{BleedingRecord, LoggedBody, LoggedTool};
use crate::scenario::{Scenario, ScenarioError};
use bevy::prelude::*;
use std::collections::BTreeSet;

/// What is looked at in every step of a run.
#[derive(Clone)]
pub(in crate::scenario) struct Observed {
    /// Instruments, and what the log says of them.
    pub tools: Vec<Entity>,
    pub logged_tools: Vec<LoggedTool>,
    /// Organs and volumes.
    pub bodies: Vec<Entity>,
    pub logged_bodies: Vec<LoggedBody>,
    pub(super) volumes: Vec<WatchedVolume>,
    pub(super) structures: Vec<WatchedStructure>,
    pub(super) lesions: Vec<WatchedLesions>,
    /// Blood that was lost before the run, millilitres.
    pub(super) lost_before_ml: f64,
    /// What was written of blood last.
    pub(super) told_blood: Option<BleedingRecord>,
}

/// Where a structure is.
#[derive(Clone)]
pub(super) struct WatchedStructure {
    pub name: String,
    pub places: Vec<Place>,
    pub band_m: f32,
    pub exposure: Option<Exposure>,
}

/// A structure of a volume, or an organ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    Label {
        /// The volume, by its place in [`Observed::volumes`].
        volume: usize,
        label: u8,
    },
    Organ(Entity),
}

/// Finds all that a scenario names.
///
/// # Errors
/// A structure or organ that is not there, or a goal that needs what the scene lacks.
pub(in crate::scenario) fn begin(
    scenario: &Scenario,
    targets: &Targets,
    scene: &Scene,
    file: &str,
) -> Result<Observed, ScenarioError> {
    let mut organs: Vec<(String, Entity)> =
        scene.organs.iter().map(|(entity, name, ..)| (called(name, "organ"), entity)).collect();
    organs.sort();
    let mut named_volumes: Vec<(String, Entity)> =
        scene.volumes.iter().map(|(entity, name, ..)| (called(name, "volume"), entity)).collect();
    named_volumes.sort();
    let mut volumes = Vec::new();
    for (name, entity) in &named_volumes {
        let Ok((_, _, _, Some(cut), Some(picked), _, transform, ..)) = scene.volumes.get(*entity) else { continue };
        volumes.push(WatchedVolume::new(*entity, name.clone(), &picked.0, cut, transform, targets));
    }
    let find = Find { file, organs: &organs, volumes: &volumes };
    let mut structures = Vec::new();
    for target in &targets.structures {
        let places = find.structure(target)?;
        structures.push(WatchedStructure { name: target.name.clone(), places, band_m: target.band_m, exposure: None });
    }
    let eye_m = scene.eye().map(GlobalTransform::translation);
    for (target, watched) in targets.structures.iter().zip(&mut structures) {
        let Some(cover_m) = target.cover_m else { continue };
        let eye_m = eye_m.ok_or_else(|| ScenarioError::Field {
            file: file.into(),
            field: target.named_by.clone(),
            reason: "it asks what can be seen, and the scene has no ScenarioEye: put one beside the camera".into(),
        })?;
        watched.exposure = Some(Exposure::new(&watched.places, &volumes, scene, eye_m, cover_m));
    }
    let lesions = targets.lesions.iter().map(|of| find.lesions(of, scene)).collect::<Result<_, _>>()?;
    let (tools, logged_tools) = super::tools::find(scenario, scene);
    let mut bodies: Vec<Entity> = organs.iter().map(|(_, entity)| *entity).collect();
    let logged = |(name, entity): &(String, Entity)| organ_box(name, *entity, scene);
    let mut logged_bodies: Vec<LoggedBody> = organs.iter().map(logged).collect();
    bodies.extend(volumes.iter().map(|volume| volume.entity));
    logged_bodies.extend(volumes.iter().map(WatchedVolume::logged));
    let mut observed = Observed {
        tools,
        logged_tools,
        bodies,
        logged_bodies,
        volumes,
        structures,
        lesions,
        lost_before_ml: 0.0,
        told_blood: None,
    };
    observed.lost_before_ml = observed.lost_ml(scene);
    Ok(observed)
}

impl Observed {
    /// Bytes that it holds, about.
    pub(in crate::scenario) fn bytes(&self) -> usize {
        self.volumes.iter().map(WatchedVolume::bytes).sum::<usize>()
            + self.lesions.iter().map(WatchedLesions::bytes).sum::<usize>()
    }

    /// Where structures are to be reached, and the way out of there towards the eye: the middle of what of them can be exposed, and
    /// of the volume that they are in.
    pub(in crate::scenario) fn field(&self, structures: &[String], eye_m: Option<Vec3>) -> Option<(Vec3, Vec3)> {
        let is_meant = |watched: &&WatchedStructure| structures.contains(&watched.name);
        let volume = self.structures.iter().filter(is_meant).flat_map(|watched| &watched.places).find_map(|place| {
            let Place::Label { volume, .. } = place else { return None };
            self.volumes.get(*volume)
        })?;
        let places = self.structures.iter().filter(is_meant).filter_map(|watched| watched.exposure.as_ref()?.middle_m);
        let all: Vec<Vec3> = places.chain([volume.box_world_m[0]]).collect();
        let middle_m = all.iter().sum::<Vec3>() / all.len() as f32;
        let axis = eye_m.map_or(Vec3::Z, |eye_m| (eye_m - middle_m).normalize_or(Vec3::Z));
        Some((middle_m, axis))
    }
}

fn called(name: Option<&Name>, what: &str) -> String {
    name.map_or_else(|| what.into(), |name| name.as_str().into())
}

fn organ_box(name: &str, entity: Entity, scene: &Scene) -> LoggedBody {
    let plain = LoggedBody { name: name.into(), ..LoggedBody::default() };
    let Ok((_, _, _, Some(shape), _, _, transform)) = scene.organs.get(entity) else { return plain };
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for place_m in shape.positions_m().iter().map(|place_m| transform.transform_point(*place_m)) {
        (low, high) = (low.min(place_m), high.max(place_m));
    }
    if !(low.is_finite() && high.is_finite()) {
        return plain;
    }
    LoggedBody { box_world_m: [(low + high) * 0.5, (high - low) * 0.5], ..plain }
}

struct Find<'a> {
    file: &'a str,
    organs: &'a [(String, Entity)],
    volumes: &'a [WatchedVolume],
}

impl Find<'_> {
    fn structure(&self, target: &TargetStructure) -> Result<Vec<Place>, ScenarioError> {
        let organs = self.organs.iter().filter(|(name, _)| *name == target.name).map(|(_, at)| Place::Organ(*at));
        let labels = self.volumes.iter().enumerate().filter_map(|(volume, watched)| {
            let label = watched.structures.label_of(&target.name)?;
            Some(Place::Label { volume, label })
        });
        let places: Vec<Place> = organs.chain(labels).collect();
        if places.is_empty() { Err(self.unknown(&target.name, &target.named_by)) } else { Ok(places) }
    }

    fn lesions(&self, target: &TargetLesions, scene: &Scene) -> Result<WatchedLesions, ScenarioError> {
        let named = self.organs.iter().find(|(name, _)| *name == target.organ);
        let Some(&(_, organ)) = named else { return Err(self.unknown(&target.organ, &target.named_by)) };
        WatchedLesions::new(organ, &target.lesions, scene).ok_or_else(|| ScenarioError::Field {
            file: self.file.into(),
            field: target.named_by.clone(),
            reason: format!("the organ \"{}\" has no Reactions, or one of the lesions is not on it", target.organ),
        })
    }

    fn unknown(&self, name: &str, field: &str) -> ScenarioError {
        let of_volumes = self.volumes.iter().flat_map(|volume| volume.structures.list());
        let known: BTreeSet<&str> = (self.organs.iter().map(|(name, _)| name.as_str()))
            .chain(of_volumes.map(|structure| structure.name.as_str()))
            .collect();
        ScenarioError::UnknownStructure {
            file: self.file.into(),
            field: field.into(),
            name: name.into(),
            nearest: nearest_spelling(name, known.iter().copied()).map(Into::into),
            known: known.into_iter().map(Into::into).collect(),
        }
    }
}
