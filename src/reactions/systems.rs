//! Reactions in the ECS: models beside organs, touches in, events out.

use super::action::OrganTouch;
use super::kind::ReactionKinds;
use super::model::{ReactionEvent, ReactionModel, StepContext, Touch};
use super::settings::{ReactionFault, Reactions};
use crate::checkpoint::KeepState;
use crate::gravity::SurgeryGravity;
use crate::organ::{Hollow, Organ, OrganModel, OrganShape, ShapeOrgans};
use crate::schedule::SurgerySystems;
use bevy::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use tracing::warn;

/// Most entities that are no reacting organs and whose touches are told of.
const MOST_UNKNOWN: usize = 64;

/// Something that happened on an organ in this step; written in [`SurgerySystems::React`].
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct OrganReacted {
    /// The organ.
    pub organ: Entity,
    /// What happened.
    pub event: ReactionEvent,
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<SurgeryGravity>()
        .register_type::<SurgeryGravity>()
        .add_message::<OrganTouch>()
        .add_message::<OrganReacted>()
        .add_observer(end_model)
        .keep_large_component(ReactionModel::bytes)
        .add_systems(PreUpdate, begin_models.after(ShapeOrgans).run_if(resource_exists::<Assets<OrganModel>>))
        .add_systems(FixedUpdate, react.in_set(SurgerySystems::React).run_if(resource_exists::<Assets<OrganModel>>));
}

fn tell(organ: Entity, name: Option<&Name>, fault: ReactionFault) {
    let name = name.map_or_else(|| format!("organ {organ}"), |name| format!("organ \"{name}\" ({organ})"));
    warn!("{name}: {}", fault.message());
}

type Reacting = (
    Entity,
    &'static Organ,
    &'static OrganShape,
    Ref<'static, Reactions>,
    Option<&'static mut ReactionModel>,
    Option<&'static Name>,
);

/// Gives organs that have their shape a model, and another one where the organ or the map's size was exchanged.
fn begin_models(mut commands: Commands, models: Res<Assets<OrganModel>>, mut organs: Query<Reacting>) {
    for (entity, organ, shape, settings, reactions, name) in &mut organs {
        let Some(model) = models.get(&organ.0).filter(|model| shape.is_of(model)) else { continue };
        match reactions {
            Some(mut reactions) if reactions.is_of(model, &settings) => {
                if settings.is_changed() {
                    reactions.set_settings(&settings);
                }
            }
            old => {
                if old.is_some_and(|old| !old.is_blank()) {
                    tell(entity, name, ReactionFault::ModelExchanged);
                }
                commands.entity(entity).insert(ReactionModel::new(model, &settings));
            }
        }
    }
}

/// An organ that is to react no more loses its blood and burns.
fn end_model(removed: On<Remove, Reactions>, mut commands: Commands) {
    if let Ok(mut organ) = commands.get_entity(removed.entity) {
        organ.try_remove::<ReactionModel>();
    }
}

type Living = (
    Entity,
    &'static Organ,
    Ref<'static, OrganShape>,
    &'static GlobalTransform,
    &'static mut ReactionModel,
    Has<Hollow>,
    Option<&'static Name>,
);

fn react(
    mut touches: MessageReader<OrganTouch>,
    mut reacted: MessageWriter<OrganReacted>,
    mut organs: Query<Living>,
    models: Res<Assets<OrganModel>>,
    kinds: Res<ReactionKinds>,
    gravity: Res<SurgeryGravity>,
    time: Res<Time>,
    mut told_of: Local<BTreeSet<Entity>>,
) {
    let mut by_organ: BTreeMap<Entity, Vec<Touch>> = BTreeMap::new();
    for touch in touches.read() {
        let OrganTouch { organ, point, instrument, action } = touch.clone();
        if organs.contains(organ) {
            by_organ.entry(organ).or_default().push(Touch { point, instrument, action });
        } else if told_of.len() < MOST_UNKNOWN && told_of.insert(organ) {
            warn!(
                "a touch names {organ}, which is no organ with `Reactions` that is loaded (despawned?); it is left out"
            );
        }
    }
    for (entity, organ, shape, transform, mut reactions, is_hollow, name) in &mut organs {
        // An organ whose model is being exchanged waits for its new shape.
        let Some(model) = models.get(&organ.0).filter(|model| shape.is_of(model) && reactions.is_of_organ(model))
        else {
            continue;
        };
        let surface = model.surface(&shape);
        let organ_from_world = transform.affine().inverse();
        let down = organ_from_world.transform_vector3(gravity.world_m_per_s2).as_dvec3();
        let context = StepContext {
            kinds: &kinds,
            surface: &surface,
            surface_moved: shape.is_changed(),
            is_inside: is_hollow,
            gravity_m_per_s2: if down.is_finite() { down } else { bevy::math::DVec3::ZERO },
            dt_s: time.delta_secs_f64(),
        };
        let touches = by_organ.remove(&entity).unwrap_or_default();
        let reactions = &mut *reactions;
        reactions.step(&context, &touches);
        reacted.write_batch(reactions.take_events().into_iter().map(|event| OrganReacted { organ: entity, event }));
        for fault in reactions.take_untold() {
            tell(entity, name, fault);
        }
    }
}
