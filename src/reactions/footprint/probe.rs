//! Exact local coordinates of what a texel shows: where it lies on the plane square to the normal at a disk's middle.

use crate::organ::atlas::Atlas;
use crate::organ::mesh::NO_FACE;
use crate::organ::sphere::SurfacePoint;
use crate::organ::surface::Surface;
use glam::{DMat2, DMat3, DVec2, DVec3};
use std::f64::consts::PI;

/// Weights of a direction in its face may be this far below zero: that is what rounding does to those on an edge.
const LEAST_WEIGHT: f64 = -1e-13;

/// Steps from face to face before the table is asked for a nearer start.
const MOST_STEPS: usize = 24;

/// Cosine between a face and the shading normal at the disk's middle below which the face's own normal is taken.
const LEAST_FACING: f64 = 0.1;

/// Angle up to which three terms of the series of sine and cosine are exact to a billionth, radians.
const SMALL_ANGLE: f64 = 0.06;

/// Faces that are remembered. A disk covers a few that are visited over and over; a power of two.
const REMEMBERED: usize = 16;

/// A face as directions see it: the place that a direction shows is `place * direction / (weight . direction)`.
#[derive(Clone, Copy)]
struct Face {
    index: u32,
    /// Normals of the planes through the centre and each edge; edge `k` lies across from corner `k`.
    edges: [DVec3; 3],
    weight: DVec3,
    place: DMat3,
    is_facing: bool,
}

/// Local coordinates round the middle of a disk, in shares of its radius.
pub(super) struct Probe<'a> {
    surface: &'a Surface<'a>,
    middle_m: DVec3,
    /// The two axes of the tangent plane and its normal as rows, over the radius.
    local_from_organ: DMat3,
    normal: DVec3,
    /// Each in the slot of its number's last bits.
    faces: [Face; REMEMBERED],
    /// The face that was found last.
    last: u32,
    /// Chart coordinates of the middle: its direction, sine and cosine of its longitude and colatitude, and (u, v).
    direction: DVec3,
    longitude: Line,
    colatitude: Line,
    uv: DVec2,
}

/// A column or row of the texture: the sine and cosine of its longitude or colatitude on a spherical chart, otherwise
/// its coordinate and nothing.
pub(super) type Line = (f64, f64);

impl<'a> Probe<'a> {
    /// `None` where the place or the surface there is not made of numbers, or is no place of the chart.
    pub(super) fn new(surface: &'a Surface<'a>, point: SurfacePoint, radius_m: f64) -> Option<Self> {
        let chart = surface.atlas.chart();
        let triangle = chart.triangles.get(point.face as usize)?;
        let count = surface.positions_m.len().min(surface.normals.len());
        if triangle.iter().any(|&vertex| vertex as usize >= count) || !point.barycentric.is_finite() {
            return None;
        }
        let middle_m = surface.position_m(point);
        let face_normal = surface.face_normal(point.face);
        let shading_normal = surface.normal(point);
        let is_shaded = shading_normal.is_finite() && shading_normal.dot(face_normal) > LEAST_FACING;
        let normal = if is_shaded { shading_normal } else { face_normal };
        let direction = match surface.atlas {
            Atlas::Spherical(_) => chart.direction(point),
            Atlas::Planar(_) => homogeneous(chart.corners(point.face), point.barycentric),
        };
        let uv = surface.atlas.uv_from_direction(direction);
        if !middle_m.is_finite() || !uv.is_finite() || normal.is_nan() || normal == DVec3::ZERO {
            return None;
        }
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let local_from_organ = DMat3::from_cols(tangent, bitangent, normal).transpose() * (1.0 / radius_m);
        let sine = direction.x.hypot(direction.z);
        let longitude = if sine > 1e-12 { (direction.x / sine, direction.z / sine) } else { (0.0, 1.0) };
        let colatitude = (sine, direction.y);
        let (faces, last) = ([Face::NONE; REMEMBERED], point.face);
        Some(Self { surface, middle_m, local_from_organ, normal, faces, last, direction, longitude, colatitude, uv })
    }

    /// Texture coordinates of the middle.
    pub(super) fn uv(&self) -> DVec2 {
        self.uv
    }

    /// Change of the local coordinates by `u` (first column) and `v` at the middle, within its face.
    pub(super) fn jacobian(&mut self) -> DMat2 {
        let direction = self.direction;
        let face = *self.face(self.last);
        let [along_u, along_v] = match self.surface.atlas {
            Atlas::Spherical(_) => {
                let (sin, cos) = self.longitude;
                let sine = self.colatitude.0;
                [
                    2.0 * PI * DVec3::new(direction.z, 0.0, -direction.x),
                    PI * DVec3::new(sin * direction.y, -sine, cos * direction.y),
                ]
            }
            Atlas::Planar(planar) => [DVec3::X, if planar.is_mirrored() { DVec3::NEG_Y } else { DVec3::Y }],
        };
        // The quotient's derivative; the middle itself is the origin of the local coordinates.
        let scale = 1.0 / face.weight.dot(direction);
        let change = |along: DVec3| (face.place * along * scale).truncate();
        DMat2::from_cols(change(along_u), change(along_v))
    }

    /// The column `offset_u` away from the middle.
    pub(super) fn column(&self, offset_u: f64) -> Line {
        match self.surface.atlas {
            Atlas::Spherical(_) => turned(self.longitude, 2.0 * PI * offset_u),
            Atlas::Planar(_) => (self.uv.x + offset_u, 0.0),
        }
    }

    /// The row `offset_v` away from the middle; beyond a pole it goes on on the other side.
    pub(super) fn row(&self, offset_v: f64) -> Line {
        match self.surface.atlas {
            Atlas::Spherical(_) => turned(self.colatitude, PI * offset_v),
            Atlas::Planar(_) => (self.uv.y + offset_v, 0.0),
        }
    }

    /// Local coordinates of what the chart shows where a column and a row meet. `None` where that is nothing, faces away
    /// from the disk, or is made of what are no numbers.
    pub(super) fn at(&mut self, column: Line, row: Line) -> Option<DVec2> {
        self.at_direction(match self.surface.atlas {
            Atlas::Spherical(_) => DVec3::new(row.0 * column.0, row.1, row.0 * column.1),
            Atlas::Planar(planar) => planar.direction_from_uv(DVec2::new(column.0, row.0)),
        })
    }

    /// Local coordinates of what a direction shows, as of a pole of a spherical chart.
    pub(super) fn at_direction(&mut self, direction: DVec3) -> Option<DVec2> {
        let face = self.find(direction)?;
        if !face.is_facing {
            return None;
        }
        let local = face.place * direction / face.weight.dot(direction);
        let (plane, height) = (local.truncate(), local.z.abs());
        let square = plane.length_squared();
        if !(square + height).is_finite() {
            return None;
        }
        if height * height <= square {
            return Some(plane);
        }
        // A place steeply above or below the disk is not near it: its height counts where it is the greater.
        let distance = square.sqrt();
        Some(if distance > 1e-9 * height { plane * (height / distance) } else { DVec2::new(height, 0.0) })
    }

    /// The face that holds a direction.
    fn find(&mut self, direction: DVec3) -> Option<&Face> {
        let mut index = self.last;
        for _ in 0..MOST_STEPS {
            let weights = self.face(index).edges.map(|edge| edge.dot(direction));
            let least = if weights[0] <= weights[1] && weights[0] <= weights[2] {
                0
            } else if weights[1] <= weights[2] {
                1
            } else {
                2
            };
            if weights[least] >= LEAST_WEIGHT {
                self.last = index;
                return Some(self.face(index));
            }
            // Neighbours are listed by edges (0,1), (1,2), (2,0).
            index = self.surface.atlas.chart().neighbours[index as usize][(least + 1) % 3];
            if index == NO_FACE {
                break;
            }
        }
        let atlas = self.surface.atlas;
        self.last = atlas.locate_uv(atlas.uv_from_direction(direction), self.surface.table)?.face;
        Some(self.face(self.last))
    }

    #[inline]
    fn face(&mut self, index: u32) -> &Face {
        let slot = index as usize % REMEMBERED;
        if self.faces[slot].index != index {
            self.faces[slot] = self.look_at(index);
        }
        &self.faces[slot]
    }

    fn look_at(&self, index: u32) -> Face {
        let [da, db, dc] = self.surface.atlas.chart().corners(index);
        let [ea, eb, ec] = [db.cross(dc), dc.cross(da), da.cross(db)];
        let [a, b, c] = self.surface.corners(index);
        let [p, q, r] = [a, b, c].map(|corner| self.local_from_organ * (corner - self.middle_m));
        let place = DMat3::from_cols(
            p * ea.x + q * eb.x + r * ec.x,
            p * ea.y + q * eb.y + r * ec.y,
            p * ea.z + q * eb.z + r * ec.z,
        );
        let is_facing = (b - a).cross(c - a).dot(self.normal) >= 0.0;
        Face { index, edges: [ea, eb, ec], weight: ea + eb + ec, place, is_facing }
    }
}

impl Face {
    const NONE: Self =
        Self { index: NO_FACE, edges: [DVec3::ZERO; 3], weight: DVec3::ZERO, place: DMat3::ZERO, is_facing: false };
}

/// Sine and cosine of an angle that is greater by `angle`, radians.
fn turned((sin, cos): Line, angle: f64) -> Line {
    let square = angle * angle;
    let (turn_sin, turn_cos) = if angle.abs() < SMALL_ANGLE {
        (
            angle * (1.0 - square * (1.0 / 6.0) * (1.0 - square * (1.0 / 20.0))),
            1.0 - square * 0.5 * (1.0 - square * (1.0 / 12.0) * (1.0 - square * (1.0 / 30.0))),
        )
    } else {
        angle.sin_cos()
    };
    (sin * turn_cos + cos * turn_sin, cos * turn_cos - sin * turn_sin)
}

/// Direction on a planar chart: its third component stays one.
fn homogeneous([a, b, c]: [DVec3; 3], weights: DVec3) -> DVec3 {
    a * weights.x + b * weights.y + c * weights.z
}
