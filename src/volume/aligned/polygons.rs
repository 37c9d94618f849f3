//! The rectangles that slices cut out of patches, and their vertices.

use crate::deform::lattice::Tree;
use bevy::reflect::Reflect;
use glam::{Vec2, Vec3, Vec4};
use std::ops::Range;

/// Rectangles of a slice are at most this part of the box wide: coarser patches are drawn as several, so that what shows nothing
/// can be left out, and four triangles come nearer to the field.
pub const LEAVES: u32 = 16;

/// A patch between two key frames: its faces across an axis (paper of 2001, section 4.1). Numbers are those of the lattice's
/// vertices.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct PatchFrames {
    /// Least place, in the order `u`, `v`, along the axis.
    pub low_uva: Vec3,
    /// Length of its edges.
    pub side: f32,
    /// Vertices of the face on the low side, `u` fastest.
    pub front: [u32; 4],
    /// Vertices of the face on the high side.
    pub back: [u32; 4],
}

/// A rectangle that a plane across an axis cuts out of a patch; or, beyond the box, of what goes on from it.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct PatchRect {
    /// Least `u` and `v`.
    pub low: Vec2,
    /// Greatest `u` and `v`.
    pub high: Vec2,
    /// Number of its [`PatchFrames`].
    pub frames: u32,
}

/// A vertex of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct PolygonVertex {
    /// Where it is.
    pub place: Vec3,
    /// Where the matter rests that is shown there.
    pub rest: Vec3,
}

/// The rectangles of one patch.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PatchRects {
    pub frames: u32,
    /// Planes from here on pass through it, and up to there.
    pub from: f32,
    pub to: f32,
    /// Those of [`PatchPolygons::rects`].
    pub rects: Range<u32>,
}

/// The static geometry of a tree of patches: it changes with the tree only.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct PatchPolygons {
    frames: Vec<PatchFrames>,
    rects: Vec<PatchRect>,
    /// Patches by the layer that they are in, for each axis.
    pub(super) layers: [Vec<Vec<PatchRects>>; 3],
    margin: f32,
}

/// The components of a place, in the order `u`, `v`, along an axis.
pub(super) fn uva_of(place: Vec3, axis: usize) -> Vec3 {
    Vec3::new(place[(axis + 1) % 3], place[(axis + 2) % 3], place[axis])
}

/// The place with some components in the order `u`, `v`, along an axis.
pub(super) fn place_of(uva: Vec3, axis: usize) -> Vec3 {
    match axis {
        0 => Vec3::new(uva.z, uva.x, uva.y),
        1 => Vec3::new(uva.y, uva.z, uva.x),
        _ => uva,
    }
}

impl PatchPolygons {
    /// The polygons of a tree. Matter that is shown beyond the box is drawn up to `margin` from it.
    pub fn new(tree: &Tree, margin: f32) -> Self {
        let margin = if margin.is_finite() { margin.clamp(0.0, 4.0) } else { 0.0 };
        let mut made = Self { frames: Vec::new(), rects: Vec::new(), layers: Default::default(), margin };
        for axis in 0..3 {
            made.add_axis(tree, axis);
        }
        made
    }

    fn add_axis(&mut self, tree: &Tree, axis: usize) {
        let count = 1_usize << tree.deepest();
        // One layer before the box and one behind it.
        let mut layers = vec![Vec::new(); count + 2];
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for (number, patch) in tree.patches().iter().enumerate() {
            let corners = tree.corners(number).map(|vertex| vertex as u32);
            let face = |at: usize| std::array::from_fn(|n: usize| corners[(n & 1) << u | (n >> 1) << v | at << axis]);
            let (low, side) = (uva_of(patch.low().as_vec3(), axis), patch.side() as f32);
            let frames = self.frames.len() as u32;
            self.frames.push(PatchFrames { low_uva: low, side, front: face(0), back: face(1) });
            let first = self.rects.len() as u32;
            let parts = |low: f32| self.parts(low, side);
            let (across, up) = (parts(low.x), parts(low.y));
            for &(v0, v1) in &up {
                for &(u0, u1) in &across {
                    self.rects.push(PatchRect { low: Vec2::new(u0, v0), high: Vec2::new(u1, v1), frames });
                }
            }
            let rects = first..self.rects.len() as u32;
            let (begins, ends) = (low.z <= 0.0, low.z + side >= 1.0);
            let own = PatchRects {
                frames,
                from: if begins { -self.margin } else { low.z },
                to: if ends { 1.0 + self.margin } else { low.z + side },
                rects,
            };
            let first = (low.z * count as f32) as usize + 1;
            let last = ((low.z + side) * count as f32) as usize;
            for layer in &mut layers[first - usize::from(begins)..=last + usize::from(ends)] {
                layer.push(own.clone());
            }
        }
        self.layers[axis] = layers;
    }

    /// The parts of a patch along an axis across the slices, with those beyond the box.
    fn parts(&self, low: f32, side: f32) -> Vec<(f32, f32)> {
        let leaf = 1.0 / LEAVES as f32;
        let mut found = Vec::new();
        let mut add = |from: f32, to: f32| {
            let count = ((to - from) / leaf).round().max(1.0);
            // Ends that neighbours share are the same to the bit.
            let at = |k: f32| if k == count { to } else { from + (to - from) * (k / count) };
            found.extend((0..count as u32).map(|k| (at(k as f32), at(k as f32 + 1.0))));
        };
        if low <= 0.0 && self.margin > 0.0 {
            add(-self.margin, 0.0);
        }
        add(low, low + side);
        if low + side >= 1.0 && self.margin > 0.0 {
            add(1.0, 1.0 + self.margin);
        }
        found
    }

    /// Every patch three times, once across each axis.
    pub fn frames(&self) -> &[PatchFrames] {
        &self.frames
    }

    /// The rectangles across all axes.
    pub fn rects(&self) -> &[PatchRect] {
        &self.rects
    }

    /// How far beyond the box they reach.
    pub fn margin(&self) -> f32 {
        self.margin
    }

    /// Vertex `n` of a rectangle in a plane across an axis: 0 to 3 its corners, `u` fastest, 4 its middle.
    pub fn vertex(&self, rect: u32, axis: usize, along: f32, translations: &[Vec3], n: usize) -> PolygonVertex {
        let rect = &self.rects[rect as usize];
        let frames = &self.frames[rect.frames as usize];
        let of = |face: [u32; 4]| face.map(|vertex| translations[vertex as usize]);
        polygon_vertex(frames, of(frames.front), of(frames.back), rect, axis, along, n)
    }

    /// The rectangle of a slice at a place in its plane, if it is drawn.
    pub fn rect_at(&self, axis: usize, uva: Vec3) -> Option<u32> {
        let layers = &self.layers[axis];
        let count = layers.len() - 2;
        let layer = (uva.z * count as f32).floor().clamp(-1.0, count as f32) + 1.0;
        let mut rects = layers[layer as usize].iter().filter(|own| own.from <= uva.z && uva.z < own.to);
        let holds = |number: &u32| {
            let rect = &self.rects[*number as usize];
            rect.low.cmple(uva.truncate()).all() && uva.truncate().cmplt(rect.high).all()
        };
        rects.find_map(|own| own.rects.clone().find(holds))
    }

    /// Where the matter rests that a slice shows at a place: between the vertices of the triangle that it is in, of the four of
    /// its rectangle (figure 6, C).
    pub fn rest_in_triangles(&self, axis: usize, place: Vec3, translations: &[Vec3]) -> Option<Vec3> {
        let uva = uva_of(place, axis);
        let rect = self.rect_at(axis, uva)?;
        let PatchRect { low, high, .. } = self.rects[rect as usize];
        let share = (uva.truncate() - low) / (high - low);
        let rest = |n| self.vertex(rect, axis, uva.z, translations, n).rest;
        // The two corners of the side that is nearest.
        let (x, y) = (share.x - 0.5, share.y - 0.5);
        let (a, b, along) = if x.abs() > y.abs() {
            if x < 0.0 { (0, 2, y / -x) } else { (1, 3, y / x) }
        } else if y < 0.0 {
            (0, 1, x / -y)
        } else {
            (2, 3, if y > 0.0 { x / y } else { 0.0 })
        };
        let outwards = x.abs().max(y.abs()) * 2.0;
        Some(rest(4).lerp(rest(a).lerp(rest(b), along * 0.5 + 0.5), outwards))
    }
}

/// The same with the translations of the patch's faces, as the vertex shader has them (`shaders/volume/patches.wgsl`).
pub fn polygon_vertex(
    frames: &PatchFrames,
    front: [Vec3; 4],
    back: [Vec3; 4],
    rect: &PatchRect,
    axis: usize,
    along: f32,
    n: usize,
) -> PolygonVertex {
    let corner = Vec2::new((n & 1) as f32, (n >> 1 & 1) as f32);
    let across = if n == 4 { (rect.low + rect.high) * 0.5 } else { rect.low + (rect.high - rect.low) * corner };
    let uva = across.extend(along);
    let share = ((uva - frames.low_uva) / frames.side).clamp(Vec3::ZERO, Vec3::ONE);
    let weights = Vec4::new(
        (1.0 - share.x) * (1.0 - share.y),
        share.x * (1.0 - share.y),
        (1.0 - share.x) * share.y,
        share.x * share.y,
    );
    let on = |face: [Vec3; 4]| face[0] * weights.x + face[1] * weights.y + face[2] * weights.z + face[3] * weights.w;
    let place = place_of(uva, axis);
    PolygonVertex { place, rest: place + on(front).lerp(on(back), share.z) }
}
