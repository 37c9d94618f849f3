//! Kinds of reactions: how a sprite looks, ages and moves (paper of 2002, section 5.2). Yours register beside ours.

use super::drops::{DropFate, DropHead, DropSettings};
use super::paint::Profile;
use super::snake::Sprite;
use crate::organ::surface::Surface;
use bevy::prelude::*;
use glam::DVec3;
use std::sync::Arc;

/// A registered [`ReactionKind`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect)]
pub struct KindId(u32);

impl KindId {
    /// [`Blood`](super::kinds::Blood).
    pub const BLOOD: Self = Self(0);
    /// [`Whitening`](super::kinds::Whitening).
    pub const WHITENING: Self = Self(1);
    /// [`Cauterization`](super::kinds::Cauterization).
    pub const CAUTERIZATION: Self = Self(2);
    /// [`Nodule`](super::kinds::Nodule).
    pub const NODULE: Self = Self(3);
}

/// How a sprite looks at a moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub struct SpriteLook {
    /// Colour, sRGB.
    pub colour: [u8; 3],
    /// 255 is wet, 128 as the skin, 0 dull.
    pub gloss: u8,
    /// Opacity of the middle; 255 covers all.
    pub opacity: u8,
}

/// What a sprite knows when it ages.
#[derive(Clone, Copy, Debug)]
pub struct Ageing {
    /// Length of the step, seconds.
    pub dt_s: f32,
    /// Whether it is the head of its snake and the snake is active.
    pub is_head: bool,
    /// Share of the full cause that acted in this step, 0 to 1: the pressure of a probe. Only heads are kept up.
    pub cause: f32,
}

/// What becomes of a sprite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
pub enum SpriteFate {
    /// It goes on.
    Stays,
    /// It has become too faint or too old.
    Ends,
    /// It ends and stays visible for good: it is painted into the permanent map.
    Bakes,
}

/// What a head knows when it moves.
pub struct Motion<'a> {
    /// The surface now.
    pub surface: &'a Surface<'a>,
    /// Gravity in the organ's space, metres per second squared.
    pub gravity_m_per_s2: DVec3,
    /// Whether it lies on the trail of another drop.
    pub is_wet: bool,
    /// Length of the step, seconds.
    pub dt_s: f64,
}

/// A kind of reaction. Register yours with [`AddReactionKind::add_reaction_kind`]; those of the crate are made of the
/// same trait, and [`ReactionKinds::replace`] exchanges them.
///
/// Everything must depend on the arguments only: scenes are replayed bit by bit.
pub trait ReactionKind: Send + Sync + 'static {
    /// Name for reports.
    fn name(&self) -> &str;

    /// Opacity at a share `r` of the radius, 0 in the middle to 1 at the rim. Asked once, when it is registered.
    fn profile(&self, r: f32) -> f32;

    /// How a sprite looks now.
    fn look(&self, sprite: &Sprite) -> SpriteLook;

    /// Ages a sprite by one step: its opacity, its radius. `age_s` is counted by the caller.
    fn age(&self, sprite: &mut Sprite, ageing: &Ageing) -> SpriteFate;

    /// Called once for a new head: it has its full radius and an opacity of 1.
    fn begin(&self, _head: &mut Sprite) {}

    /// Kinds are painted from low to high: whitening is at -10, blood at 10.
    fn order(&self) -> i32 {
        0
    }

    /// Most sprites of a snake. When a head leaves one more, the oldest ends.
    fn longest(&self) -> usize {
        30
    }

    /// How far a head moves before it leaves a sprite behind, as a share of its radius.
    fn spacing(&self) -> f32 {
        0.4
    }

    /// For liquids: heads roll, merge, take up tails and leave film behind.
    fn liquid(&self) -> Option<&DropSettings> {
        None
    }

    /// Moves a head by one step. Liquids roll by their [`DropSettings`]; everything else stays where it is.
    fn move_head(&self, head: &mut DropHead, motion: &Motion) -> DropFate {
        self.liquid().map_or(DropFate::Sticks, |liquid| {
            liquid.step(motion.surface, motion.gravity_m_per_s2, motion.is_wet, head, motion.dt_s)
        })
    }

    /// The sprite that a head leaves behind as it moves on: take [`Sprite::left_behind`] and change its fields. Its radius
    /// should not be larger than the head's.
    fn trail(&self, head: &Sprite) -> Sprite {
        head.left_behind()
    }

    /// What becomes of the oldest sprite of a trail that has grown too long.
    fn oldest_ends(&self, _: &Sprite) -> SpriteFate {
        SpriteFate::Ends
    }
}

/// A registered kind with what was asked of it once.
#[derive(Clone)]
pub(crate) struct RegisteredKind {
    pub kind: Arc<dyn ReactionKind>,
    pub profile: Arc<Profile>,
    /// How often the kind of this id was replaced.
    pub version: u32,
}

impl RegisteredKind {
    fn new(kind: impl ReactionKind) -> Self {
        let profile = Arc::new(Profile::new(|r| kind.profile(r)));
        Self { kind: Arc::new(kind), profile, version: 0 }
    }
}

/// All kinds of reactions that organs have.
#[derive(Resource, Clone)]
pub struct ReactionKinds(Vec<RegisteredKind>);

impl Default for ReactionKinds {
    fn default() -> Self {
        use super::kinds::{Blood, Cauterization, Nodule, Whitening};
        Self(vec![
            RegisteredKind::new(Blood::default()),
            RegisteredKind::new(Whitening::default()),
            RegisteredKind::new(Cauterization),
            RegisteredKind::new(Nodule::default()),
        ])
    }
}

impl ReactionKinds {
    /// Adds a kind.
    pub fn register(&mut self, kind: impl ReactionKind) -> KindId {
        self.0.push(RegisteredKind::new(kind));
        KindId(self.0.len() as u32 - 1)
    }

    /// Puts another kind in the place of one: `Blood` with other settings in that of [`KindId::BLOOD`]. Without effect for
    /// an id that is not registered.
    pub fn replace(&mut self, id: KindId, kind: impl ReactionKind) {
        if let Some(place) = self.0.get_mut(id.0 as usize) {
            *place = RegisteredKind { version: place.version + 1, ..RegisteredKind::new(kind) };
        }
    }

    /// A kind by its id.
    pub fn get(&self, id: KindId) -> Option<&dyn ReactionKind> {
        self.registered(id).map(|registered| &*registered.kind)
    }

    /// Every kind with its id.
    pub fn iter(&self) -> impl Iterator<Item = (KindId, &dyn ReactionKind)> {
        self.0.iter().enumerate().map(|(place, registered)| (KindId(place as u32), &*registered.kind))
    }

    pub(crate) fn registered(&self, id: KindId) -> Option<&RegisteredKind> {
        self.0.get(id.0 as usize)
    }
}

/// Registers kinds of reactions with an app.
pub trait AddReactionKind {
    /// Adds a kind; keep the id to start snakes of it.
    fn add_reaction_kind(&mut self, kind: impl ReactionKind) -> KindId;
}

impl AddReactionKind for App {
    fn add_reaction_kind(&mut self, kind: impl ReactionKind) -> KindId {
        self.init_resource::<ReactionKinds>();
        self.world_mut().resource_mut::<ReactionKinds>().register(kind)
    }
}
