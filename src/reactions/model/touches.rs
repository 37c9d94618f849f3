//! What instruments do becomes snakes.

use super::motion::{SMALLEST_DROP_M, become_film};
use super::{MAX_RADIUS_M, ReactionModel, StepContext, Touch, wounds::OpenWound};
use crate::organ::sphere::SurfacePoint;
use crate::reactions::action::{ReactionAction, Wound};
use crate::reactions::burn::Cautery;
use crate::reactions::drops::walk;
use crate::reactions::kind::{KindId, ReactionKind, ReactionKinds};
use crate::reactions::settings::ReactionFault;
use crate::reactions::snake::{Snake, Sprite};
use std::collections::{BTreeMap, VecDeque};

/// While an organ moves, the heat map learns its new measures so often: a texel's size hardly changes in half a second.
pub(super) const METRICS_EVERY_STEPS: u64 = 30;

/// Longest way between two touches of an electrode that counts as one stroke, metres.
const LONGEST_STROKE_M: f64 = 0.03;

/// Most spots along the way between two touches.
const MOST_SPOTS: usize = 32;

/// Most wounds that bleed at a time.
const MOST_WOUNDS: usize = 256;

/// The last touch of each electrode.
pub(super) type Strokes = BTreeMap<u32, Stroke>;

#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    point: SurfacePoint,
    step: u64,
}

impl ReactionModel {
    pub(super) fn take_touches(&mut self, context: &StepContext, touches: &[Touch]) {
        for snake in &mut self.snakes {
            snake.cause = 0.0;
        }
        let budget = self.settings.max_touches_per_step.max(1) as usize;
        let dropped = touches.len().saturating_sub(budget);
        if dropped > 0 {
            self.tally.dropped_touches += dropped as u64;
            self.blame(ReactionFault::TooMany);
        }
        let touches = &touches[dropped..];
        // Several touches of one electrode in a step share the step's time; bad ones have no part in it.
        let mut burning: BTreeMap<u32, u32> = BTreeMap::new();
        for touch in touches.iter().filter(|touch| matches!(touch.action, ReactionAction::Cauterize(_))) {
            if context.surface.checked(touch.point).is_some() {
                *burning.entry(touch.instrument).or_default() += 1;
            }
        }
        for touch in touches {
            let Some(point) = context.surface.checked(touch.point) else {
                self.blame(ReactionFault::BadPlace);
                continue;
            };
            match &touch.action {
                ReactionAction::Bleed { volume_m3 } => {
                    self.start_liquid(context, KindId::BLOOD, point, *volume_m3);
                }
                ReactionAction::Wound(wound) => self.open_wound(point, *wound),
                ReactionAction::Press { pressure, radius_m } => {
                    self.press(context, touch.instrument, point, *pressure, *radius_m);
                }
                ReactionAction::Cauterize(cautery) => {
                    let share = 1.0 / f64::from(burning.get(&touch.instrument).copied().unwrap_or(1));
                    self.cauterize(context, touch.instrument, point, cautery, share);
                }
                ReactionAction::Start { kind, radius_m, volume_m3 } => match context.kinds.get(*kind) {
                    None => self.blame(ReactionFault::UnknownKind),
                    Some(known) if known.liquid().is_some() => self.start_liquid(context, *kind, point, *volume_m3),
                    Some(_) => {
                        self.start_spot(context.kinds, *kind, point, *radius_m);
                    }
                },
            }
        }
        let now = self.steps;
        self.strokes.retain(|_, stroke| stroke.step == now);
        let snakes = &self.snakes;
        self.presses.retain(|_, id| snakes.binary_search_by_key(id, |snake| snake.id).is_ok());
    }

    /// A snake of a kind that is not liquid; its id.
    fn start_spot(&mut self, kinds: &ReactionKinds, kind: KindId, point: SurfacePoint, radius_m: f32) -> Option<u64> {
        let known = kinds.get(kind)?;
        let radius_m = self.sound_size(radius_m.into(), MAX_RADIUS_M)? as f32;
        Some(self.add_snake(kind, new_head(known, point, radius_m, 0.0)))
    }

    pub(super) fn start_liquid(&mut self, context: &StepContext, kind: KindId, point: SurfacePoint, volume_m3: f64) {
        let Some(known) = context.kinds.get(kind) else { return };
        let Some(drops) = known.liquid() else { return };
        let drops = drops.tamed();
        let Some(volume_m3) = self.sound_size(volume_m3, drops.volume_m3(MAX_RADIUS_M)) else { return };
        let radius_m = drops.radius_m(volume_m3) as f32;
        self.tally.bled_m3 += volume_m3;
        self.add_snake(kind, new_head(known, point, radius_m, volume_m3));
        if f64::from(radius_m) < SMALLEST_DROP_M
            && let Some(snake) = self.snakes.last_mut()
        {
            become_film(context, snake);
        }
    }

    fn add_snake(&mut self, kind: KindId, head: Sprite) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        self.snakes.push(Snake { kind, id, is_active: true, sprites: VecDeque::from([head]), ..Snake::default() });
        id
    }

    /// A size within (0, most]; larger ones are made smaller, what is no positive number is left out.
    fn sound_size(&mut self, size: f64, most: f64) -> Option<f64> {
        if !(size > 0.0 && size <= most) {
            self.blame(ReactionFault::BadSize);
        }
        (size > 0.0).then(|| size.min(most))
    }

    fn open_wound(&mut self, point: SurfacePoint, wound: Wound) {
        let (Some(rate_m3_per_s), Some(drop_volume_m3)) =
            (self.sound_size(wound.rate_m3_per_s, 1e-4), self.sound_size(wound.drop_volume_m3, 1e-6))
        else {
            return;
        };
        if self.wounds.len() == MOST_WOUNDS {
            self.blame(ReactionFault::TooMany);
            self.wounds.remove(0);
        }
        self.wounds.push(OpenWound {
            point,
            wound: Wound { rate_m3_per_s, drop_volume_m3, ..wound },
            age_s: 0.0,
            waiting_m3: drop_volume_m3,
        });
    }

    fn press(&mut self, context: &StepContext, instrument: u32, point: SurfacePoint, pressure: f32, radius_m: f32) {
        // A probe that only just touches.
        if pressure == 0.0 {
            return;
        }
        let Some(radius_m) = self.sound_size(radius_m.into(), MAX_RADIUS_M) else { return };
        let Some(pressure) = self.sound_size(pressure.into(), 1.0) else { return };
        let (radius_m, cause) = (radius_m as f32, pressure as f32);
        let Some(whitening) = context.kinds.get(KindId::WHITENING) else { return };
        let kept = self.presses.get(&instrument);
        let kept = kept.and_then(|id| self.snakes.binary_search_by_key(id, |snake| snake.id).ok());
        let kept = kept.filter(|&place| self.snakes[place].kind == KindId::WHITENING);
        let snake = match kept {
            Some(place) => {
                let snake = &mut self.snakes[place];
                let Some(head) = snake.sprites.front_mut() else { return };
                let way_m = context.surface.position_m(head.point).distance(context.surface.position_m(point));
                if !snake.is_active || way_m > f64::from(whitening.spacing() * radius_m) {
                    // What is pressed no longer fades, what is pressed now begins.
                    snake.sprites.push_front(new_head(whitening, point, radius_m, 0.0));
                    snake.is_active = true;
                } else {
                    head.full_radius_m = radius_m;
                }
                snake.cause = cause;
                snake.id
            }
            None => {
                let Some(id) = self.start_spot(context.kinds, KindId::WHITENING, point, radius_m) else { return };
                if let Some(snake) = self.snakes.last_mut() {
                    snake.cause = cause;
                }
                id
            }
        };
        self.presses.insert(instrument, snake);
    }

    /// Lays the heat of a step, or of a share of it, from where the electrode was in the last step to where it is.
    fn cauterize(
        &mut self,
        context: &StepContext,
        instrument: u32,
        point: SurfacePoint,
        cautery: &Cautery,
        share: f64,
    ) {
        // Switched on, and turned down.
        if cautery.power_w == 0.0 {
            return;
        }
        if self.sound_size(cautery.power_w, f64::MAX).is_none() {
            return;
        }
        let heat_j = cautery.heat_j(context.dt_s) * share;
        let radius_m = cautery.heat_radius_m().min(MAX_RADIUS_M);
        let before = self.strokes.get(&instrument).filter(|stroke| stroke.step + 1 >= self.steps);
        let mut spots = vec![point];
        if let Some(before) = before {
            let way = context.surface.position_m(point) - context.surface.position_m(before.point);
            let count = (way.length() / (0.5 * radius_m)) as usize;
            if way.length() < LONGEST_STROKE_M {
                let count = count.min(MOST_SPOTS);
                let between = (1..=count).map(|k| way * (k as f64 / (count + 1) as f64));
                spots.extend(
                    between.filter_map(|part| walk(context.surface, before.point, part).ok()).map(|way| way.point),
                );
            }
        }
        let heat_j = heat_j / spots.len() as f64;
        for spot in spots {
            if self.start_spot(context.kinds, KindId::CAUTERIZATION, spot, radius_m as f32).is_some()
                && let Some(head) = self.snakes.last_mut().and_then(|snake| snake.sprites.front_mut())
            {
                head.heat_j = heat_j;
            }
        }
        self.strokes.insert(instrument, Stroke { point, step: self.steps });
    }
}

/// The head of a snake that begins.
fn new_head(kind: &dyn ReactionKind, point: SurfacePoint, radius_m: f32, volume_m3: f64) -> Sprite {
    let mut head = Sprite { point, radius_m, full_radius_m: radius_m, opacity: 1.0, volume_m3, ..Sprite::default() };
    kind.begin(&mut head);
    head
}
