//! Copies of what steps change, to go back to.
//!
//! Each room tells the app which of its components, resources and messages carry the state of the simulation from one step to the
//! next ([`KeepState`]). A [`Checkpoint`] clones all of that, and [`Checkpoint::restore`] puts it back: what follows is the same as it
//! was, to the bit. An app whose own steps keep state elsewhere names it in the same way:
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_surgery::checkpoint::{Checkpoint, KeepState};
//!
//! #[derive(Resource, Clone, Default)]
//! struct Stitches(u32);
//!
//! let mut app = App::new();
//! app.init_resource::<Stitches>().keep_resource::<Stitches>();
//! let before = Checkpoint::take(app.world_mut());
//! app.world_mut().resource_mut::<Stitches>().0 = 3;
//! before.restore(app.world_mut());
//! assert_eq!(app.world().resource::<Stitches>().0, 0);
//! ```

use bevy::ecs::component::Mutable;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::message::MessageCursor;
use bevy::prelude::*;
use std::any::{Any, TypeId};
use std::collections::BTreeSet;
use std::marker::PhantomData;
use std::sync::Arc;

/// Names the state that steps carry on. Naming a type twice is the same as once.
pub trait KeepState {
    /// A component, on all entities that have it. The transforms of entities with any kept component are kept, too.
    fn keep_component<C: Component<Mutability = Mutable> + Clone>(&mut self) -> &mut Self {
        self.keep_large_component::<C>(|_| 0)
    }

    /// The same for one that holds much: `heap_bytes` says how much about, beside its own size.
    fn keep_large_component<C: Component<Mutability = Mutable> + Clone>(
        &mut self,
        heap_bytes: fn(&C) -> usize,
    ) -> &mut Self;

    /// A resource.
    fn keep_resource<R: Resource<Mutability = Mutable> + Clone>(&mut self) -> &mut Self;

    /// Messages that are written in a step and read in the next one. Those that are read in the same step need not be kept.
    fn carry_messages<M: Message + Clone>(&mut self) -> &mut Self;

    /// A component whose entities are born and die in steps. Where one is there again it is another entity, with the components that are
    /// kept and its parent.
    fn keep_births<C: Component<Mutability = Mutable> + Clone>(&mut self) -> &mut Self;

    /// Keeps a component, resource or message no longer: what follows a jump back is then another world.
    fn leave_out<T: 'static>(&mut self) -> &mut Self;
}

/// Before [`SurgerySystems::Sense`](crate::schedule::SurgerySystems::Sense), in `FixedUpdate`: from here on messages are of this step.
/// A checkpoint within `FixedUpdate` is taken before it.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BeginMessages;

/// What was kept of a kind of state.
type Kept = Box<dyn Any + Send + Sync>;
/// Which entities are there now for some that were there.
type Renamed = EntityHashMap<Entity>;

/// A kind of state: how it is taken from a world and put back.
trait Kind: Send + Sync {
    fn of(&self) -> TypeId;

    /// Takes it, notes whose it is, and counts its bytes.
    fn take(&self, world: &mut World, owners: &mut BTreeSet<Entity>, bytes: &mut usize) -> Kept;

    fn put(&self, world: &mut World, kept: &Kept, renamed: &Renamed);
}

#[derive(Resource, Default, Clone)]
struct Kinds {
    state: Vec<Arc<dyn Kind>>,
    /// Finds the entities that are born in steps, in the order in which systems meet them.
    births: Vec<(TypeId, fn(&mut World) -> Vec<Entity>)>,
}

impl KeepState for App {
    fn keep_large_component<C: Component<Mutability = Mutable> + Clone>(
        &mut self,
        heap_bytes: fn(&C) -> usize,
    ) -> &mut Self {
        keep(self, OfComponent { heap_bytes })
    }

    fn keep_resource<R: Resource<Mutability = Mutable> + Clone>(&mut self) -> &mut Self {
        keep(self, OfResource(PhantomData::<fn() -> R>))
    }

    fn carry_messages<M: Message + Clone>(&mut self) -> &mut Self {
        if !self.world().contains_resource::<StepBegan<M>>() {
            self.insert_resource(StepBegan::<M>(MessageCursor::default()))
                .add_message::<M>()
                .add_systems(FixedUpdate, begin_messages::<M>.in_set(BeginMessages));
        }
        keep(self, OfMessages(PhantomData::<fn() -> M>))
    }

    fn keep_births<C: Component<Mutability = Mutable> + Clone>(&mut self) -> &mut Self {
        let births = &mut self.world_mut().get_resource_or_init::<Kinds>().births;
        if births.iter().all(|(of, _)| *of != TypeId::of::<C>()) {
            births.push((TypeId::of::<C>(), |world| {
                let mut all = world.query_filtered::<Entity, With<C>>();
                all.iter(world).collect()
            }));
        }
        self.keep_component::<C>()
    }

    fn leave_out<T: 'static>(&mut self) -> &mut Self {
        let mut kinds = self.world_mut().get_resource_or_init::<Kinds>();
        kinds.state.retain(|kind| kind.of() != TypeId::of::<T>());
        self
    }
}

fn keep(app: &mut App, kind: impl Kind + 'static) -> &mut App {
    let mut kinds = app.world_mut().get_resource_or_init::<Kinds>();
    if kinds.state.iter().all(|known| known.of() != kind.of()) {
        kinds.state.push(Arc::new(kind));
    }
    app
}

struct OfComponent<C> {
    heap_bytes: fn(&C) -> usize,
}

impl<C: Component<Mutability = Mutable> + Clone> Kind for OfComponent<C> {
    fn of(&self) -> TypeId {
        TypeId::of::<C>()
    }

    fn take(&self, world: &mut World, owners: &mut BTreeSet<Entity>, bytes: &mut usize) -> Kept {
        let mut all = world.query::<(Entity, &C)>();
        let kept: Vec<(Entity, C)> = all.iter(world).map(|(entity, of)| (entity, of.clone())).collect();
        owners.extend(kept.iter().map(|(entity, _)| *entity));
        *bytes += kept.iter().map(|(_, of)| size_of::<(Entity, C)>() + (self.heap_bytes)(of)).sum::<usize>();
        Box::new(kept)
    }

    fn put(&self, world: &mut World, kept: &Kept, renamed: &Renamed) {
        let Some(kept) = kept.downcast_ref::<Vec<(Entity, C)>>() else { return };
        let mut owners = BTreeSet::new();
        for (entity, of) in kept {
            let entity = renamed.get(entity).copied().unwrap_or(*entity);
            let Ok(mut entity) = world.get_entity_mut(entity) else { continue };
            owners.insert(entity.id());
            put(&mut entity, of);
        }
        let mut all = world.query_filtered::<Entity, With<C>>();
        let others: Vec<Entity> = all.iter(world).filter(|entity| !owners.contains(entity)).collect();
        for entity in others {
            world.entity_mut(entity).remove::<C>();
        }
    }
}

struct OfResource<R>(PhantomData<fn() -> R>);

impl<R: Resource<Mutability = Mutable> + Clone> Kind for OfResource<R> {
    fn of(&self) -> TypeId {
        TypeId::of::<R>()
    }

    fn take(&self, world: &mut World, _: &mut BTreeSet<Entity>, bytes: &mut usize) -> Kept {
        *bytes += size_of::<R>();
        Box::new(world.get_resource::<R>().cloned())
    }

    fn put(&self, world: &mut World, kept: &Kept, _: &Renamed) {
        match kept.downcast_ref::<Option<R>>() {
            Some(Some(of)) => world.insert_resource(of.clone()),
            Some(None) => drop(world.remove_resource::<R>()),
            None => {}
        }
    }
}

/// Up to where messages are of steps before this one.
#[derive(Resource)]
struct StepBegan<M: Message>(MessageCursor<M>);

fn begin_messages<M: Message>(messages: Res<Messages<M>>, mut began: ResMut<StepBegan<M>>) {
    began.0.clear(&messages);
}

struct OfMessages<M>(PhantomData<fn() -> M>);

impl<M: Message + Clone> Kind for OfMessages<M> {
    fn of(&self) -> TypeId {
        TypeId::of::<M>()
    }

    fn take(&self, world: &mut World, _: &mut BTreeSet<Entity>, bytes: &mut usize) -> Kept {
        let began = world.get_resource::<StepBegan<M>>().map(|began| began.0.clone()).unwrap_or_default();
        let messages = world.get_resource::<Messages<M>>();
        let kept: Vec<M> = messages.map_or_else(Vec::new, |all| began.clone().read(all).cloned().collect());
        *bytes += size_of_val(kept.as_slice());
        Box::new(kept)
    }

    fn put(&self, world: &mut World, kept: &Kept, _: &Renamed) {
        let (Some(kept), Some(mut messages)) = (kept.downcast_ref::<Vec<M>>(), world.get_resource_mut::<Messages<M>>())
        else {
            return;
        };
        // What was said meanwhile was never said.
        messages.clear();
        messages.write_batch(kept.iter().cloned());
    }
}

/// The state of a world between two steps, as far as someone has named it ([`KeepState`]).
pub struct Checkpoint {
    /// By the kinds that there were.
    kept: Vec<(Arc<dyn Kind>, Kept)>,
    places: Vec<(Entity, Option<Transform>, Option<GlobalTransform>)>,
    /// Those that are born in steps, and what they hang from.
    born: Vec<(Entity, Option<Entity>)>,
    clock: Option<Time<Fixed>>,
    bytes: usize,
}

impl std::fmt::Debug for Checkpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let (kinds, places) = (self.kept.len(), self.places.len());
        write!(f, "Checkpoint {{ kinds: {kinds}, entities: {places}, bytes: {} }}", self.bytes)
    }
}

impl Checkpoint {
    /// Clones the state of a world, between two steps or before [`BeginMessages`].
    pub fn take(world: &mut World) -> Self {
        let kinds = world.get_resource_or_init::<Kinds>().clone();
        let (mut owners, mut bytes) = (BTreeSet::new(), 0);
        let kept = kinds.state.into_iter().map(|kind| {
            let kept = kind.take(world, &mut owners, &mut bytes);
            (kind, kept)
        });
        let kept = kept.collect();
        let born = births(world).into_iter().map(|entity| (entity, parent(world, entity))).collect();
        let place = |entity: Entity| (entity, world.get(entity).copied(), world.get(entity).copied());
        let places: Vec<_> = owners.into_iter().map(place).collect();
        bytes += size_of_val(places.as_slice());
        Self { kept, places, born, clock: world.get_resource().copied(), bytes }
    }

    /// Bytes that it holds, about.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Puts all of it back. Everything that is put back counts as changed.
    pub fn restore(&self, world: &mut World) {
        let renamed = self.restore_births(world);
        for (kind, kept) in &self.kept {
            kind.put(world, kept, &renamed);
        }
        for (entity, local, global) in &self.places {
            let entity = renamed.get(entity).copied().unwrap_or(*entity);
            let Ok(mut entity) = world.get_entity_mut(entity) else { continue };
            if let Some(local) = local {
                put(&mut entity, local);
            }
            if let Some(global) = global {
                put(&mut entity, global);
            }
        }
        if let Some((mut clock, mut before)) = world.get_resource_mut::<Time<Fixed>>().zip(self.clock) {
            // How far the next step is away is the frame's, not the simulation's.
            let overstep = clock.overstep();
            before.discard_overstep(before.overstep());
            before.accumulate_overstep(overstep);
            *clock = before;
        }
    }

    /// Who was born since then goes, who has died is born again.
    fn restore_births(&self, world: &mut World) -> Renamed {
        let there: BTreeSet<Entity> = self.born.iter().map(|(entity, _)| *entity).collect();
        let now = births(world);
        for entity in now.iter().filter(|entity| !there.contains(entity)) {
            world.despawn(*entity);
        }
        let mut renamed = Renamed::default();
        for (entity, parent) in self.born.iter().filter(|(entity, _)| !now.contains(entity)) {
            let mut again = world.spawn_empty();
            renamed.insert(*entity, again.id());
            if let Some(parent) = parent {
                again.insert(ChildOf(renamed.get(parent).copied().unwrap_or(*parent)));
            }
        }
        renamed
    }
}

/// Puts a component back: in its place, so that no entity changes its turn among others.
fn put<C: Component<Mutability = Mutable> + Clone>(entity: &mut EntityWorldMut, of: &C) {
    match entity.get_mut::<C>() {
        Some(mut now) => now.clone_from(of),
        None => {
            entity.insert(of.clone());
        }
    }
}

fn births(world: &mut World) -> Vec<Entity> {
    let kinds = world.get_resource_or_init::<Kinds>().births.clone();
    let mut all: Vec<Entity> = Vec::new();
    for (_, find) in kinds {
        let found = find(world);
        all.extend(found.into_iter().filter(|entity| !all.contains(entity)).collect::<Vec<_>>());
    }
    all
}

fn parent(world: &World, entity: Entity) -> Option<Entity> {
    world.get::<ChildOf>(entity).map(ChildOf::parent)
}
