//! Opened vessels: they bleed drop by drop until they clot or are burnt shut.

use super::{MAX_RADIUS_M, ReactionEvent, ReactionModel, StepContext};
use crate::organ::sphere::SurfacePoint;
use crate::reactions::action::Wound;
use crate::reactions::kind::KindId;
use bevy::reflect::Reflect;

/// Share of its first rate below which a wound has clotted.
const CLOTTED: f64 = 0.01;

/// Place in the burn ramp, 0 to 255, from which a burn closes a wound: well coagulated, before it chars.
const SEALING_INDEX: u8 = 110;

/// A wound that bleeds.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct OpenWound {
    /// Where it is.
    pub point: SurfacePoint,
    /// How it bleeds.
    pub wound: Wound,
    /// Time since it was opened, seconds.
    pub age_s: f64,
    /// Blood in it that has not come out as a drop, cubic metres.
    pub waiting_m3: f64,
}

impl OpenWound {
    /// Bleeding now, cubic metres per second.
    pub fn rate_m3_per_s(&self) -> f64 {
        let time_s = f64::from(self.wound.clotting_time_s);
        // A time that is no positive number: it does not clot.
        let share = if time_s > 0.0 { (-self.age_s / time_s).exp() } else { 1.0 };
        self.wound.rate_m3_per_s * share
    }
}

impl ReactionModel {
    pub(super) fn bleed(&mut self, context: &StepContext) {
        let mut wounds = std::mem::take(&mut self.wounds);
        wounds.retain_mut(|wound| {
            let uv = context.surface.atlas.uv(wound.point);
            let (x, y) = self.texel(uv);
            if self.settings.burns.index(self.heat.dose(x, y)) >= SEALING_INDEX {
                self.tally.sealed_wounds += 1;
                self.note(ReactionEvent::WoundSealed { point: wound.point });
                return false;
            }
            wound.waiting_m3 += wound.rate_m3_per_s() * context.dt_s;
            wound.age_s += context.dt_s;
            if wound.waiting_m3 > 0.0 && self.feed(context, wound) {
                wound.waiting_m3 = 0.0;
            } else if wound.waiting_m3 >= wound.wound.drop_volume_m3 {
                self.start_liquid(context, KindId::BLOOD, wound.point, wound.waiting_m3);
                wound.waiting_m3 = 0.0;
            }
            wound.rate_m3_per_s() > CLOTTED * wound.wound.rate_m3_per_s
        });
        self.wounds = wounds;
    }

    /// Adds what a wound has to the drop that lies on it, if there is one.
    fn feed(&mut self, context: &StepContext, wound: &OpenWound) -> bool {
        let Some(drops) = context.kinds.get(KindId::BLOOD).and_then(|kind| kind.liquid()) else { return false };
        let drops = drops.tamed();
        let at = context.surface.position_m(wound.point);
        for snake in self.snakes.iter_mut().filter(|snake| snake.kind == KindId::BLOOD && snake.is_active) {
            let Some(head) = snake.sprites.front_mut() else { continue };
            if context.surface.position_m(head.point).distance(at) < f64::from(head.radius_m) {
                head.volume_m3 += wound.waiting_m3;
                head.radius_m = drops.radius_m(head.volume_m3).min(MAX_RADIUS_M) as f32;
                self.tally.bled_m3 += wound.waiting_m3;
                return true;
            }
        }
        false
    }

    /// Texel of texture coordinates.
    pub(super) fn texel(&self, uv: glam::DVec2) -> (u32, u32) {
        let place = |share: f64, count: u32| ((share * f64::from(count)).max(0.0) as u32).min(count - 1);
        (place(uv.x, self.size.width_px), place(uv.y, self.size.height_px))
    }
}
