//! Drops that meet: heads swallow one another and the tails that they run over (Neyret, Heiss and Senegas 2002,
//! sections 5.2 and 5.3).
//!
//! The paper keeps a list of sprites per face. Here all sprites are sorted into the cells of a grid in space, as wide as
//! the farthest contact, and each head looks into the cells round it: faces of any size will do, and the work grows
//! with the number of sprites and hardly with that of pairs.

use super::settings::DropSettings;
use crate::organ::surface::Surface;
use crate::reactions::kind::KindId;
use crate::reactions::snake::{Snake, Sprite};
use bevy::reflect::Reflect;
use glam::DVec3;

/// Radius beyond which a sprite reaches no farther, metres: one senseless radius must not put everything in one cell.
const GREATEST_REACH_M: f64 = 0.02;

/// Bits of a cell's key for each axis.
const AXIS_BITS: u32 = 21;

/// Greatest index of a cell along an axis; what lies farther is put there. One less than fits, so that looking into the
/// next cell stays within the axis.
const LAST_CELL: u64 = (1 << AXIS_BITS) - 2;

/// Finds and settles collisions between the drops of one liquid. Keeps its buffers, so hold on to it between steps.
#[derive(Clone, Debug, Default, Reflect)]
pub struct DropCollisions {
    /// For each snake given, whether its head is on wet ground: it touches liquid of another snake, of its trail or its
    /// head, that was there before this step. What it runs over is cancelled, what it only touches ahead is not, so a
    /// drop on another's trail is on wet ground all along if the trail's sprites lie closer than `1 - contact_share` of
    /// the sum of the radii.
    pub is_wet: Vec<bool>,
    /// Heads swallowed in this step.
    pub merges: usize,
    /// Sprites cancelled in this step.
    pub cancelled_sprites: usize,
    #[reflect(ignore)]
    blots: Vec<Blot>,
    /// Cell and index of each blot, by cell. Small, because sorting it is a good part of all the work.
    #[reflect(ignore)]
    grid: Vec<(u64, u32)>,
    #[reflect(ignore)]
    heads: Vec<u32>,
    #[reflect(ignore)]
    touches: Vec<Touch>,
}

/// A sprite where it lies in space.
#[derive(Clone, Copy, Debug)]
struct Blot {
    /// Cell of the grid: z, y and x from the highest bit down, so that neighbours along x are neighbours in the order.
    cell: u64,
    snake: u32,
    sprite: u32,
    position_m: DVec3,
    radius_m: f64,
}

/// A sprite that a head reaches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Touch {
    /// Number of the snake, so that the order is that of age.
    id: u64,
    snake: u32,
    /// Youngest first.
    sprite: u32,
    /// Whether they are near enough to become one, or only touch.
    is_contact: bool,
}

impl DropCollisions {
    /// Settles what happens between the snakes of this kind: others are left alone, and are never wet.
    ///
    /// Each head in turn, from the oldest snake to the youngest. Where another head is near enough, the one with more
    /// volume (the older, if equal) swallows the other: it takes its volume and its momentum; the other snake has no
    /// head any more and goes on fading. Then a head that reaches another snake's trail cancels it from the youngest
    /// sprite within reach to the oldest and takes their volume; the younger ones stay. Nobody collides with its own
    /// trail, with cancelled sprites, or with what lies on the other side of a thin edge.
    ///
    /// The sum of all volumes stays as it was, to rounding. Sprites that are not of finite numbers, of no size or on no
    /// face of the surface do not collide; volumes that are no positive numbers count as none.
    pub fn settle(&mut self, surface: &Surface, settings: &DropSettings, kind: KindId, snakes: &mut [Snake]) {
        let settings = settings.tamed();
        self.is_wet.clear();
        self.is_wet.resize(snakes.len(), false);
        (self.merges, self.cancelled_sprites) = (0, 0);
        self.collect(surface, kind, snakes);
        for k in 0..self.heads.len() {
            let head = self.blots[self.heads[k] as usize];
            if snakes[head.snake as usize].is_active {
                self.find_touches(surface, settings.contact_share, snakes, &head);
                self.meet_heads(&settings, snakes, head.snake as usize);
                self.meet_tails(&settings, snakes, head.snake as usize);
            }
        }
    }

    /// Sorts all sprites that can collide into the grid and lists the heads by age.
    fn collect(&mut self, surface: &Surface, kind: KindId, snakes: &[Snake]) {
        let (blots, grid, heads) = (&mut self.blots, &mut self.grid, &mut self.heads);
        blots.clear();
        grid.clear();
        heads.clear();
        let (faces, vertices) = (surface.atlas.chart().triangles.len(), surface.atlas.chart().directions.len());
        if surface.positions_m.len().min(surface.normals.len()) < vertices {
            return;
        }
        let (mut low, mut greatest_m) = (DVec3::INFINITY, 0.0f64);
        for (snake, owner) in snakes.iter().enumerate().filter(|(_, snake)| snake.kind == kind) {
            for (sprite, spot) in owner.sprites.iter().enumerate().filter(|(_, spot)| !spot.is_cancelled) {
                if spot.radius_m.is_nan() || spot.radius_m <= 0.0 || spot.point.face as usize >= faces {
                    continue;
                }
                let radius_m = f64::from(spot.radius_m).min(GREATEST_REACH_M);
                let position_m = surface.position_m(spot.point);
                if position_m.is_finite() {
                    (low, greatest_m) = (low.min(position_m), greatest_m.max(radius_m));
                    blots.push(Blot { cell: 0, snake: snake as u32, sprite: sprite as u32, position_m, radius_m });
                }
            }
        }
        // Disks that touch lie at most two of the greatest radii apart, which is within the next cell.
        let cells_per_m = 0.5 / greatest_m;
        for blot in &mut *blots {
            // The conversion to integers saturates.
            let [x, y, z] = ((blot.position_m - low) * cells_per_m).to_array().map(|cell| (cell as u64).min(LAST_CELL));
            blot.cell = key(x, y, z);
        }
        grid.extend(blots.iter().zip(0..).map(|(blot, index)| (blot.cell, index)));
        grid.sort_unstable();
        let is_head = |blot: &Blot| blot.sprite == 0 && snakes[blot.snake as usize].is_active;
        heads.extend((0..blots.len() as u32).filter(|&blot| is_head(&blots[blot as usize])));
        heads.sort_unstable_by_key(|&blot| {
            let snake = blots[blot as usize].snake;
            (snakes[snake as usize].id, snake)
        });
    }

    /// Lists what a head reaches, by age.
    fn find_touches(&mut self, surface: &Surface, contact_share: f64, snakes: &[Snake], head: &Blot) {
        let normal = surface.normal(snakes[head.snake as usize].sprites[0].point);
        let (x, y, z) = (axis(head.cell, 0), axis(head.cell, 1), axis(head.cell, 2));
        self.touches.clear();
        for z in z.saturating_sub(1)..=z + 1 {
            for y in y.saturating_sub(1)..=y + 1 {
                let cells = key(x.saturating_sub(1), y, z)..=key(x + 1, y, z);
                let start = self.grid.partition_point(|(cell, _)| cell < cells.start());
                for (_, index) in self.grid[start..].iter().take_while(|(cell, _)| cells.contains(cell)) {
                    let blot = &self.blots[*index as usize];
                    let distance_m = blot.position_m.distance(head.position_m);
                    let reach_m = blot.radius_m + head.radius_m;
                    if blot.snake == head.snake || distance_m >= reach_m {
                        continue;
                    }
                    let other = &snakes[blot.snake as usize];
                    if surface.normal(other.sprites[blot.sprite as usize].point).dot(normal) > 0.0 {
                        let is_contact = distance_m < contact_share * reach_m;
                        self.touches.push(Touch { id: other.id, snake: blot.snake, sprite: blot.sprite, is_contact });
                    }
                }
            }
        }
        self.touches.sort_unstable();
    }

    /// Lets a head swallow the heads in contact with it, until one of them swallows it.
    fn meet_heads(&mut self, settings: &DropSettings, snakes: &mut [Snake], head: usize) {
        for touch in self.touches.iter().filter(|touch| touch.sprite == 0 && touch.is_contact) {
            let other = touch.snake as usize;
            if !(snakes[head].is_active && snakes[other].is_active) {
                continue;
            }
            let (winner, loser) =
                if is_stronger(&snakes[other], &snakes[head]) { (other, head) } else { (head, other) };
            let swallowed = &mut snakes[loser];
            let velocity_m_per_s = std::mem::take(&mut swallowed.velocity_m_per_s);
            // With what it has shed where it is and has not left behind yet.
            let volume_m3 = empty(&mut swallowed.sprites[0]) + std::mem::take(&mut swallowed.shed_m3);
            swallowed.is_active = false;
            swallow(settings, &mut snakes[winner], volume_m3, velocity_m_per_s);
            self.merges += 1;
        }
    }

    /// Lets a head that still lives run over the trails that it reaches.
    fn meet_tails(&mut self, settings: &DropSettings, snakes: &mut [Snake], head: usize) {
        if !snakes[head].is_active {
            return;
        }
        self.is_wet[head] = !self.touches.is_empty();
        for touch in &self.touches {
            let other = touch.snake as usize;
            let is_tail = touch.sprite > 0 || !snakes[other].is_active;
            // Once its youngest sprite in contact is cancelled, so are all that follow.
            if !(is_tail && touch.is_contact) || snakes[other].sprites[touch.sprite as usize].is_cancelled {
                continue;
            }
            let mut volume_m3 = 0.0;
            let older = snakes[other].sprites.range_mut(touch.sprite as usize..);
            for sprite in older.filter(|sprite| !sprite.is_cancelled) {
                volume_m3 += empty(sprite);
                self.cancelled_sprites += 1;
            }
            // Film lies still.
            swallow(settings, &mut snakes[head], volume_m3, DVec3::ZERO);
        }
    }
}

/// Whether a head holds more than another, or as much and is older.
fn is_stronger(one: &Snake, other: &Snake) -> bool {
    let volume_m3 = |snake: &Snake| snake.head().map_or(0.0, |head| positive(head.volume_m3));
    volume_m3(one).total_cmp(&volume_m3(other)).then(other.id.cmp(&one.id)).is_gt()
}

/// Cancels a sprite and returns the liquid that was in it.
fn empty(sprite: &mut Sprite) -> f64 {
    sprite.is_cancelled = true;
    let volume_m3 = positive(sprite.volume_m3);
    if volume_m3 > 0.0 {
        sprite.volume_m3 = 0.0;
    }
    volume_m3
}

/// Adds liquid that had a velocity to a head.
fn swallow(settings: &DropSettings, snake: &mut Snake, volume_m3: f64, velocity_m_per_s: DVec3) {
    let Some(head) = snake.sprites.front_mut() else { return };
    if volume_m3 <= 0.0 {
        return;
    }
    let own_m3 = positive(head.volume_m3);
    head.volume_m3 = own_m3 + volume_m3;
    head.radius_m = settings.radius_m(head.volume_m3) as f32;
    let sound = |velocity: DVec3| if velocity.is_finite() { velocity } else { DVec3::ZERO };
    snake.velocity_m_per_s = sound(snake.velocity_m_per_s).lerp(sound(velocity_m_per_s), volume_m3 / head.volume_m3);
}

/// A volume, or zero for what is none.
fn positive(volume_m3: f64) -> f64 {
    if volume_m3 > 0.0 && volume_m3.is_finite() { volume_m3 } else { 0.0 }
}

fn key(x: u64, y: u64, z: u64) -> u64 {
    (z << (2 * AXIS_BITS)) | (y << AXIS_BITS) | x
}

fn axis(cell: u64, axis: u32) -> u64 {
    cell >> (axis * AXIS_BITS) & ((1 << AXIS_BITS) - 1)
}
