//! All reactions of one organ, as plain Rust: snakes, wounds, heat, and the map that shows them.
//!
//! A step does what appendix A of the paper of 2002 lists: touches make sprites, heads move and meet, sprites age, heat
//! spreads; then the map is restored and painted where something changed, and those rectangles are noted for the GPU.
//! The same inputs give the same bits.

mod ageing;
mod motion;
mod show;
mod touches;
mod wounds;

use super::action::ReactionAction;
use super::drops::DropCollisions;
use super::heat::HeatMap;
use super::kind::ReactionKinds;
use super::paint::{PermanentMap, ReactionMap};
use super::regions::UploadLog;
use super::settings::{ReactionFault, Reactions};
use super::snake::Snake;
use super::texels::{MapSize, TILE_PX, TileMask};
use crate::organ::OrganModel;
use crate::organ::sphere::SurfacePoint;
use crate::organ::surface::Surface;
use bevy::prelude::*;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};

pub use wounds::OpenWound;

static MODELS: AtomicU64 = AtomicU64::new(1);

/// Tells models apart. A copy goes its own way, so it gets a number of its own.
#[derive(Debug)]
struct ModelNumber(u64);

impl ModelNumber {
    fn next() -> Self {
        Self(MODELS.fetch_add(1, Ordering::Relaxed))
    }
}

impl Clone for ModelNumber {
    fn clone(&self) -> Self {
        Self::next()
    }
}

/// Most events that wait to be taken; of more, the newest.
const MOST_EVENTS: usize = 1024;

/// Largest radius of a sprite, metres; more is a mistake of units.
pub(crate) const MAX_RADIUS_M: f64 = 0.05;

/// What has happened on an organ so far. Volumes in cubic metres.
///
/// `bled_m3` is always what lies on the organ ([`ReactionModel::volume_m3`]) plus what fell, dried and was lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, serde::Serialize)]
pub struct ReactionTally {
    /// Liquid that came out.
    pub bled_m3: f64,
    /// Liquid that fell off or ran over a border.
    pub fallen_m3: f64,
    /// Drops that did.
    pub fallen_drops: u64,
    /// Liquid that dried.
    pub dried_m3: f64,
    /// Liquid lost where the surface was broken.
    pub lost_m3: f64,
    /// Drops that another one swallowed.
    pub merged_drops: u64,
    /// Sprites of tails that another drop took up.
    pub cancelled_sprites: u64,
    /// Sprites that were painted into the permanent map.
    pub baked_sprites: u64,
    /// Wounds that a burn has closed.
    pub sealed_wounds: u64,
    /// Touches beyond what a step takes.
    pub dropped_touches: u64,
}

/// Something that others may want to know of: the pool, a score.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum ReactionEvent {
    /// A drop fell off the organ.
    DropFell {
        /// Where it let go, organ space, metres.
        position_m: DVec3,
        /// Its velocity, organ space, metres per second.
        velocity_m_per_s: DVec3,
        /// Its liquid, cubic metres.
        volume_m3: f64,
    },
    /// A burn closed a wound.
    WoundSealed {
        /// Where.
        point: SurfacePoint,
    },
}

/// Size of the map's texels on an organ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, serde::Serialize)]
pub struct TexelSize {
    /// Median of the square roots of the texels' areas, millimetres: half of the organ's surface has finer ones.
    pub median_mm: f64,
    /// 95 of 100 places of the surface have finer ones, millimetres.
    pub p95_mm: f64,
}

/// What a step needs to know.
#[derive(Clone, Copy)]
pub struct StepContext<'a> {
    /// Kinds of reactions.
    pub kinds: &'a ReactionKinds,
    /// Surface as it is now.
    pub surface: &'a Surface<'a>,
    /// Whether vertices moved since the last step.
    pub surface_moved: bool,
    /// Whether drops run on the inner side, as in a hollow organ.
    pub is_inside: bool,
    /// Gravity in the organ's space, metres per second squared.
    pub gravity_m_per_s2: DVec3,
    /// Length of the step, seconds.
    pub dt_s: f64,
}

/// A touch of one organ: see [`OrganTouch`](super::OrganTouch).
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct Touch {
    /// Where.
    pub point: SurfacePoint,
    /// Which instrument.
    pub instrument: u32,
    /// What it does.
    pub action: ReactionAction,
}

/// All reactions of one organ.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone)]
pub struct ReactionModel {
    organ: OrganModel,
    number: ModelNumber,
    settings: Reactions,
    size: MapSize,
    snakes: Vec<Snake>,
    next_id: u64,
    steps: u64,
    /// Whether vertices moved since the heat map was told.
    has_moved: bool,
    wounds: Vec<OpenWound>,
    /// The last touch of each electrode.
    strokes: touches::Strokes,
    /// The snake that each probe keeps up.
    presses: BTreeMap<u32, u64>,
    heat: HeatMap,
    /// Stains without burns: a burn lies over what was there before it.
    stains: PermanentMap,
    permanent: PermanentMap,
    shown: ReactionMap,
    is_blank: bool,
    log: UploadLog,
    collisions: DropCollisions,
    tally: ReactionTally,
    events: Vec<ReactionEvent>,
    faults: BTreeSet<ReactionFault>,
    untold: Vec<ReactionFault>,
    mask: TileMask,
    /// Tiles of the shown map in which something can be seen.
    seen: TileMask,
    scratch: show::Scratch,
}

impl ReactionModel {
    /// An organ on which nothing has happened.
    pub fn new(organ: &OrganModel, settings: &Reactions) -> Self {
        let size = MapSize::from_width(settings.map_width_px);
        Self {
            organ: organ.clone(),
            number: ModelNumber::next(),
            settings: settings.clone(),
            size,
            snakes: Vec::new(),
            next_id: 0,
            steps: 0,
            has_moved: false,
            wounds: Vec::new(),
            strokes: default(),
            presses: default(),
            heat: HeatMap::new(size, settings.heat),
            stains: PermanentMap::new(size),
            permanent: PermanentMap::new(size),
            shown: ReactionMap::new(size),
            is_blank: true,
            log: UploadLog::new(size),
            collisions: default(),
            tally: default(),
            events: Vec::new(),
            faults: BTreeSet::new(),
            untold: Vec::new(),
            mask: TileMask::new(size),
            seen: TileMask::new(size),
            scratch: default(),
        }
    }

    /// Runs one step.
    pub fn step(&mut self, context: &StepContext, touches: &[Touch]) {
        if !(context.dt_s.is_finite() && context.dt_s > 0.0) {
            return;
        }
        self.steps += 1;
        self.has_moved |= context.surface_moved;
        if self.has_moved && self.steps.is_multiple_of(touches::METRICS_EVERY_STEPS) {
            self.heat.surface_moved();
            self.has_moved = false;
        }
        self.take_touches(context, touches);
        self.bleed(context);
        self.move_heads(context);
        self.heat_up(context);
        self.age(context);
        self.keep_within_budget(context);
        self.show(context);
    }

    /// Whether this is the model of an organ, with a map of the size that the settings ask for.
    pub fn is_of(&self, organ: &OrganModel, settings: &Reactions) -> bool {
        self.is_of_organ(organ) && self.size == MapSize::from_width(settings.map_width_px)
    }

    /// Whether this is the model of an organ.
    pub fn is_of_organ(&self, organ: &OrganModel) -> bool {
        self.organ.is_same(organ)
    }

    /// Takes over settings that need no new model.
    pub fn set_settings(&mut self, settings: &Reactions) {
        if self.settings != *settings {
            self.heat.set_settings(settings.heat);
            if self.settings.burns != settings.burns {
                self.heat.forget_looks();
            }
            self.settings = settings.clone();
        }
    }

    /// Bytes of its maps, about.
    pub(crate) fn bytes(&self) -> usize {
        // Five bytes a texel, and of what stays as many, where something does: colour and gloss, stains, doses of heat.
        let stays = 3 * self.permanent.tiles_in_use().max(self.stains.tiles_in_use()) * (TILE_PX * TILE_PX) as usize;
        5 * (self.size.area() + stays) + self.sprite_count() * size_of::<super::snake::Sprite>()
    }

    /// Size of the reaction map.
    pub fn size(&self) -> MapSize {
        self.size
    }

    /// Tells this model from others, for who keeps copies of its map. It is no part of what is simulated.
    pub fn number(&self) -> u64 {
        self.number.0
    }

    /// The snakes, old ones first.
    pub fn snakes(&self) -> &[Snake] {
        &self.snakes
    }

    /// Wounds that still bleed.
    pub fn wounds(&self) -> &[OpenWound] {
        &self.wounds
    }

    /// The heat map.
    pub fn heat(&self) -> &HeatMap {
        &self.heat
    }

    /// The map as it is shown: what is permanent, and over it what is active.
    pub fn map(&self) -> &ReactionMap {
        &self.shown
    }

    /// What stays: burns and stains.
    pub fn permanent(&self) -> &PermanentMap {
        &self.permanent
    }

    /// Which rectangles of the map changed when.
    pub fn uploads(&self) -> &UploadLog {
        &self.log
    }

    /// Tiles of the map in which something can be seen.
    pub fn seen_tiles(&self) -> &TileMask {
        &self.seen
    }

    /// Whether nothing was ever painted.
    pub fn is_blank(&self) -> bool {
        self.is_blank
    }

    /// What has happened so far.
    pub fn tally(&self) -> &ReactionTally {
        &self.tally
    }

    /// How many sprites there are.
    pub fn sprite_count(&self) -> usize {
        self.snakes.iter().map(|snake| snake.sprites.len()).sum()
    }

    /// How many drops of liquid are on the way.
    pub fn drop_count(&self, kinds: &ReactionKinds) -> usize {
        let is_drop =
            |snake: &&Snake| snake.is_active && kinds.get(snake.kind).is_some_and(|kind| kind.liquid().is_some());
        self.snakes.iter().filter(is_drop).count()
    }

    /// Liquid that lies on the organ, cubic metres.
    pub fn volume_m3(&self) -> f64 {
        self.snakes.iter().map(Snake::volume_m3).sum()
    }

    /// What went wrong so far.
    pub fn faults(&self) -> impl Iterator<Item = ReactionFault> + '_ {
        self.faults.iter().copied()
    }

    /// What has happened since this was last asked: the latest thousand events or so. In an app the plugin asks in every
    /// step and writes [`OrganReacted`](super::OrganReacted).
    pub fn take_events(&mut self) -> Vec<ReactionEvent> {
        std::mem::take(&mut self.events)
    }

    pub(crate) fn note(&mut self, event: ReactionEvent) {
        if self.events.len() == MOST_EVENTS {
            self.events.remove(0);
        }
        self.events.push(event);
    }

    /// Faults that nobody was told yet.
    pub(crate) fn take_untold(&mut self) -> Vec<ReactionFault> {
        std::mem::take(&mut self.untold)
    }

    /// Notes a fault, once.
    pub(crate) fn blame(&mut self, fault: ReactionFault) {
        if self.faults.insert(fault) {
            self.untold.push(fault);
        }
    }

    /// Texels of the map in millimetres on the organ, at its present shape.
    pub fn texel_size(&self, surface: &Surface) -> TexelSize {
        // A texel's area on the middle of each face, weighted with the face's own.
        let faces = surface.atlas.chart().triangles.len() as u32;
        let mut sizes: Vec<(f64, f64)> = (0..faces)
            .map(|face| {
                let [a, b, c] = surface.corners(face);
                let area_m2 = 0.5 * (b - a).cross(c - a).length();
                let frame = surface.frame(SurfacePoint { face, barycentric: DVec3::splat(1.0 / 3.0) });
                (frame.texel_area_m2(self.size.width_px, self.size.height_px).sqrt() * 1e3, area_m2)
            })
            .filter(|(side, area)| side.is_finite() && area.is_finite())
            .collect();
        sizes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = sizes.iter().map(|(_, area)| area).sum();
        let at = |share: f64| {
            let mut sum = 0.0;
            let place = sizes.iter().find(|(_, area)| {
                sum += area;
                sum >= share * total
            });
            place.map_or(0.0, |(side, _)| *side)
        };
        TexelSize { median_mm: at(0.5), p95_mm: at(0.95) }
    }
}
