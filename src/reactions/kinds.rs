//! The kinds of reactions that every organ has: blood, whitening, cauterization.

use super::drops::DropSettings;
use super::kind::{Ageing, ReactionKind, SpriteFate, SpriteLook};
use super::snake::Sprite;
use crate::organ::surface::NEUTRAL_GLOSS;
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Opacity below which a sprite is gone: less than one step of 255.
const FAINTEST: f32 = 1.0 / 255.0;

fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Exponential decay over a step; nothing where the time is not a positive number.
fn decay(dt_s: f32, time_s: f32) -> f32 {
    if time_s > 0.0 { (-dt_s / time_s).exp() } else { 0.0 }
}

/// A number in [-1, 1) that looks random and depends on nothing but the bits.
fn noise(bits: u64) -> f32 {
    let mut hash = bits.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    hash ^= hash >> 29;
    hash = hash.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (hash >> 40) as f32 / (1 << 23) as f32 - 1.0
}

/// Drops of blood that roll, merge and leave a wet trail. A drop that sticks stays as it is; its trail fades.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Blood {
    /// How drops move.
    pub drops: DropSettings,
    /// Colour of a drop, sRGB.
    pub drop_colour: [u8; 3],
    /// Colour of the thin film that it leaves, sRGB.
    pub film_colour: [u8; 3],
    /// How much light a drop's middle absorbs: its opacity is `1 - exp(-absorption * thickness)`.
    pub absorption: f32,
    /// Opacity of fresh film.
    pub film_opacity: f32,
    /// Time in which the opacity of film falls to 1/e, seconds.
    pub fading_time_s: f32,
    /// Time in which film dries, so that it shines no more, seconds.
    pub drying_time_s: f32,
    /// Most sprites of a trail.
    pub longest: usize,
    /// Whether film that must go while it is still visible stains the organ for good.
    pub stains: bool,
}

impl Default for Blood {
    fn default() -> Self {
        Self {
            drops: DropSettings::default(),
            drop_colour: [92, 3, 7],
            film_colour: [118, 9, 11],
            absorption: 3.2,
            film_opacity: 0.5,
            fading_time_s: 14.0,
            drying_time_s: 20.0,
            longest: 30,
            stains: true,
        }
    }
}

impl ReactionKind for Blood {
    fn name(&self) -> &str {
        "blood"
    }

    fn profile(&self, r: f32) -> f32 {
        // A drop is a cap: what light passes through is thickest in the middle.
        let thickness = (1.0 - r * r).max(0.0).sqrt();
        let opaque = 1.0 - (-self.absorption).exp();
        if opaque > 0.0 { (1.0 - (-self.absorption * thickness).exp()) / opaque } else { 0.0 }
    }

    fn look(&self, sprite: &Sprite) -> SpriteLook {
        let is_film = sprite.opacity <= self.film_opacity;
        let wetness = if is_film { decay(sprite.age_s, self.drying_time_s) } else { 1.0 };
        SpriteLook {
            colour: if is_film { self.film_colour } else { self.drop_colour },
            gloss: NEUTRAL_GLOSS + byte(wetness) / 2,
            opacity: byte(sprite.opacity),
        }
    }

    fn age(&self, sprite: &mut Sprite, ageing: &Ageing) -> SpriteFate {
        if ageing.is_head {
            return SpriteFate::Stays;
        }
        // Film that another drop has taken up goes at once, but not between two frames.
        let time_s = if sprite.is_cancelled { 0.15 } else { self.fading_time_s };
        sprite.opacity *= decay(ageing.dt_s, time_s);
        if sprite.opacity < FAINTEST { SpriteFate::Ends } else { SpriteFate::Stays }
    }

    fn order(&self) -> i32 {
        10
    }

    fn longest(&self) -> usize {
        self.longest.max(1)
    }

    fn liquid(&self) -> Option<&DropSettings> {
        Some(&self.drops)
    }

    fn trail(&self, head: &Sprite) -> Sprite {
        // Film is not of one width: its edge creeps and shrinks.
        let place = head.point.barycentric;
        let width = 0.76 + 0.2 * noise(place.x.to_bits() ^ place.y.to_bits().rotate_left(32));
        Sprite { opacity: self.film_opacity, radius_m: width * head.radius_m, age_s: 0.0, ..head.left_behind() }
    }

    fn oldest_ends(&self, sprite: &Sprite) -> SpriteFate {
        let is_seen = self.stains && !sprite.is_cancelled && sprite.opacity > 8.0 * FAINTEST;
        if is_seen { SpriteFate::Bakes } else { SpriteFate::Ends }
    }
}

/// Skin that is pressed loses its blood and turns pale; when it is let go the blood comes back within seconds, as in the
/// capillary refill test.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Whitening {
    /// Colour of bloodless skin, sRGB.
    pub colour: [u8; 3],
    /// Opacity under full pressure.
    pub opacity: f32,
    /// Time in which it comes, seconds.
    pub rise_time_s: f32,
    /// Time in which it goes, seconds.
    pub refill_time_s: f32,
}

impl Default for Whitening {
    fn default() -> Self {
        Self { colour: [236, 200, 178], opacity: 0.55, rise_time_s: 0.35, refill_time_s: 1.4 }
    }
}

impl ReactionKind for Whitening {
    fn name(&self) -> &str {
        "whitening"
    }

    fn profile(&self, r: f32) -> f32 {
        let inside = 1.0 - r * r;
        inside * inside
    }

    fn look(&self, sprite: &Sprite) -> SpriteLook {
        SpriteLook { colour: self.colour, gloss: NEUTRAL_GLOSS, opacity: byte(sprite.opacity) }
    }

    fn begin(&self, head: &mut Sprite) {
        head.opacity = 0.0;
        head.radius_m = 0.5 * head.full_radius_m;
    }

    fn age(&self, sprite: &mut Sprite, ageing: &Ageing) -> SpriteFate {
        let cause = if ageing.is_head { ageing.cause.clamp(0.0, 1.0) } else { 0.0 };
        let target = self.opacity * cause;
        let time_s = if target > sprite.opacity { self.rise_time_s } else { self.refill_time_s };
        sprite.opacity += (target - sprite.opacity) * (1.0 - decay(ageing.dt_s, time_s));
        if cause > 0.0 {
            // Blood is pushed outwards: from half the size to the whole.
            sprite.radius_m += (sprite.full_radius_m - sprite.radius_m) * (1.0 - decay(ageing.dt_s, self.rise_time_s));
        } else {
            sprite.radius_m *= decay(ageing.dt_s, 6.0 * self.refill_time_s);
        }
        let is_gone = cause <= 0.0 && sprite.opacity < FAINTEST;
        if is_gone { SpriteFate::Ends } else { SpriteFate::Stays }
    }

    fn order(&self) -> i32 {
        -10
    }
}

/// A spot that receives heat. Its memory is the heat map, so its snakes are as short as can be: a sprite gives its heat and
/// ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct Cauterization;

impl ReactionKind for Cauterization {
    fn name(&self) -> &str {
        "cauterization"
    }

    fn profile(&self, r: f32) -> f32 {
        1.0 - r * r
    }

    fn begin(&self, head: &mut Sprite) {
        head.opacity = 0.0;
    }

    fn look(&self, _: &Sprite) -> SpriteLook {
        SpriteLook::default()
    }

    fn age(&self, _: &mut Sprite, _: &Ageing) -> SpriteFate {
        SpriteFate::Ends
    }

    fn longest(&self) -> usize {
        1
    }
}

/// A spot of the organ itself that looks ill, for good: a nodule, an endometrioma, a mark. It is painted into what is permanent at once, so
/// that burns and blood lie over it.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Nodule {
    /// Colour, sRGB.
    pub colour: [u8; 3],
    /// Opacity of its middle, 0 to 1: below 1 the skin is seen through it.
    pub opacity: f32,
}

impl Default for Nodule {
    /// Yellowish white, as metastases on a liver are.
    fn default() -> Self {
        Self { colour: [222, 196, 150], opacity: 0.7 }
    }
}

impl ReactionKind for Nodule {
    fn name(&self) -> &str {
        "nodule"
    }

    fn profile(&self, r: f32) -> f32 {
        // Even inside, soft over the outer third.
        let rim = ((1.0 - r) * 3.0).clamp(0.0, 1.0);
        rim * rim * (3.0 - 2.0 * rim)
    }

    fn look(&self, sprite: &Sprite) -> SpriteLook {
        SpriteLook { colour: self.colour, gloss: NEUTRAL_GLOSS, opacity: byte(self.opacity * sprite.opacity) }
    }

    fn age(&self, _: &mut Sprite, _: &Ageing) -> SpriteFate {
        SpriteFate::Bakes
    }

    fn order(&self) -> i32 {
        -20
    }

    fn longest(&self) -> usize {
        1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(cause: f32) -> Ageing {
        Ageing { dt_s: 1.0 / 60.0, is_head: true, cause }
    }

    #[test]
    fn blood_is_thickest_in_the_middle_and_ends_at_the_rim() {
        let blood = Blood::default();
        assert_eq!(blood.profile(0.0), 1.0);
        assert_eq!(blood.profile(1.0), 0.0);
        assert!((1..100).all(|k| blood.profile(k as f32 / 100.0) < blood.profile((k - 1) as f32 / 100.0)));
        // Beer and Lambert at half the radius.
        let expected = (1.0 - (-3.2 * 0.75_f32.sqrt()).exp()) / (1.0 - (-3.2_f32).exp());
        assert!((blood.profile(0.5) - expected).abs() < 1e-6);
    }

    #[test]
    fn film_fades_by_a_constant_share_until_it_is_gone() {
        let blood = Blood { fading_time_s: 2.0, ..Blood::default() };
        let mut film = Sprite { opacity: 0.6, ..Sprite::default() };
        let tail = Ageing { is_head: false, ..head(0.0) };
        for _ in 0..120 {
            assert_eq!(blood.age(&mut film, &tail), SpriteFate::Stays);
        }
        assert!((film.opacity - 0.6 * (-1.0_f32).exp()).abs() < 1e-4, "{}", film.opacity);
        film.opacity = 1.001 / 255.0;
        assert_eq!(blood.age(&mut film, &tail), SpriteFate::Ends);
    }

    #[test]
    fn whitening_grows_under_pressure_and_goes_when_it_is_let_go() {
        let whitening = Whitening::default();
        let mut spot = Sprite { radius_m: 0.004, full_radius_m: 0.01, ..Sprite::default() };
        for _ in 0..120 {
            whitening.age(&mut spot, &head(1.0));
        }
        assert!((spot.opacity - whitening.opacity).abs() < 0.01 && (spot.radius_m - 0.01).abs() < 1e-4, "{spot:?}");
        let (full, wide) = (spot.opacity, spot.radius_m);
        let mut steps = 0;
        while whitening.age(&mut spot, &head(0.0)) == SpriteFate::Stays {
            steps += 1;
            assert!(steps < 60 * 30, "it must end");
        }
        // It fades exponentially with the refill time.
        let expected = 60.0 * whitening.refill_time_s * (full / FAINTEST).ln();
        assert!((steps as f32 / expected - 1.0).abs() < 0.02, "{steps} steps instead of {expected}");
        assert!(spot.radius_m < wide);
    }
}
