//! Texture coordinates of an organ: from (u, v) to a place on its surface and back, with the exact Jacobian.
//!
//! On a spherical chart `u` is the longitude over a full turn, counted from +Z towards +X, in [0, 1), and `v` the
//! angle from the north pole (+Y) over half a turn. Seen from outside with north up, `u` grows to the right and `v`
//! downwards, as texel rows do. The date line (`u = 0`) and the poles are special only to these two numbers: what lies
//! where is decided on the sphere, so a face may straddle either (Neyret, Heiss and Senegas 2002, figure 10, clip
//! such faces at the border of the texture instead).

use super::mesh::NO_FACE;
use super::planar::PlanarChart;
use super::sphere::{SphereMesh, SurfacePoint};
use bevy::reflect::Reflect;
use glam::{DMat3, DVec2, DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Sine of the colatitude below which a place counts as the pole itself.
const POLE_SINE: f64 = 1e-12;

/// A bijective chart together with its texture coordinates.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub enum Atlas {
    /// Longitude and colatitude of a spherical chart: `u` wraps round, every texel shows some face.
    Spherical(SphereMesh),
    /// The surface's own texture coordinates: nothing wraps, texels beside the faces show none.
    Planar(PlanarChart),
}

/// Which face the centre of each texel shows (the item buffer of Neyret, Heiss and Senegas 2002, section 4.2.4).
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct FaceTable {
    /// Texels per row.
    pub width: u32,
    /// Rows; the first has the least `v`.
    pub height: u32,
    /// Face of each texel, row by row; [`NO_FACE`] beside the faces of a planar chart.
    pub faces: Vec<u32>,
}

impl FaceTable {
    /// Texture coordinates of a texel's centre.
    pub fn centre_uv(&self, x: u32, y: u32) -> DVec2 {
        centre_uv(x, y, self.width, self.height)
    }

    /// Face that the centre of a texel shows; [`NO_FACE`] outside the table.
    pub fn face(&self, x: u32, y: u32) -> u32 {
        if x < self.width && y < self.height {
            self.faces[y as usize * self.width as usize + x as usize]
        } else {
            NO_FACE
        }
    }

    /// Texel that texture coordinates lie in; those outside the unit square go to the nearest.
    pub fn texel(&self, uv: DVec2) -> (u32, u32) {
        texel_at(uv, self.width, self.height)
    }
}

/// Texel of a texture that texture coordinates lie in; those outside the unit square go to the nearest.
pub(crate) fn texel_at(uv: DVec2, width: u32, height: u32) -> (u32, u32) {
    let column = |share: f64, count: u32| ((share * f64::from(count)).max(0.0) as u32).min(count.saturating_sub(1));
    (column(uv.x, width), column(uv.y, height))
}

fn centre_uv(x: u32, y: u32, width: u32, height: u32) -> DVec2 {
    DVec2::new((f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height))
}

/// The surface round a place, to first order: where it is, which way it faces, and how texture and space correspond.
///
/// The Jacobian is that of the map itself, which is the central projection of each flat face: it varies within a face
/// of a spherical chart and jumps between faces. A small displacement `(du, dv)` in the texture moves the place by
/// `dposition_du_m * du + dposition_dv_m * dv`.
///
/// At a pole of a spherical chart all longitudes meet: `dposition_du_m` is zero there, `dposition_dv_m` belongs to the
/// meridian of the `uv` given, and `du_dposition_per_m` is zero instead of infinite. What moves over a pole should
/// move its direction, by `ddirection_dposition_per_m`, which is finite everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SurfaceFrame {
    /// Texture coordinates.
    pub uv: DVec2,
    /// Place on the surface, metres.
    pub position_m: DVec3,
    /// Unit normal of the flat face; zero for a face of no area.
    pub face_normal: DVec3,
    /// Unit normal between those of the corners, for shading and for what slides; the face's own where they cancel.
    pub normal: DVec3,
    /// Metres per unit of `u`.
    pub dposition_du_m: DVec3,
    /// Metres per unit of `v`.
    pub dposition_dv_m: DVec3,
    /// Change of `u` per metre along the face.
    pub du_dposition_per_m: DVec3,
    /// Change of `v` per metre along the face.
    pub dv_dposition_per_m: DVec3,
    /// Direction on the chart: a unit vector on a spherical one, homogeneous with `z = 1` on a planar one.
    pub direction: DVec3,
    /// Change of the direction per metre along the face.
    pub ddirection_dposition_per_m: DMat3,
}

impl SurfaceFrame {
    /// Velocity in the texture (1/s) of what moves along the surface with a velocity in metres per second; the part
    /// square to the face does not count.
    pub fn uv_velocity(&self, velocity_m_per_s: DVec3) -> DVec2 {
        DVec2::new(self.du_dposition_per_m.dot(velocity_m_per_s), self.dv_dposition_per_m.dot(velocity_m_per_s))
    }

    /// Area on the surface of one texel of a texture of this size, square metres.
    pub fn texel_area_m2(&self, width: u32, height: u32) -> f64 {
        self.dposition_du_m.cross(self.dposition_dv_m).length() / (f64::from(width) * f64::from(height))
    }
}

impl Atlas {
    /// Faces with their directions.
    pub fn chart(&self) -> &SphereMesh {
        match self {
            Self::Spherical(chart) => chart,
            Self::Planar(planar) => planar.chart(),
        }
    }

    /// Whether `u` wraps round and every texel shows a face.
    pub fn is_spherical(&self) -> bool {
        matches!(self, Self::Spherical(_))
    }

    /// Texture coordinates of a direction, which need not be of unit length. At the poles `u` is zero.
    pub fn uv_from_direction(&self, direction: DVec3) -> DVec2 {
        match self {
            Self::Spherical(_) => {
                let turn = direction.x.atan2(direction.z) / (2.0 * PI);
                let u = if turn < 0.0 { turn + 1.0 } else { turn };
                let sine = direction.x.hypot(direction.z);
                // A turn just short of zero rounds to one, which is zero again. Adding zero makes -0 a plain 0.
                DVec2::new(if u < 1.0 { u + 0.0 } else { 0.0 }, sine.atan2(direction.y) / PI)
            }
            Self::Planar(planar) => planar.uv_from_direction(direction),
        }
    }

    /// Direction of texture coordinates. On a spherical chart `u` may be any number and wraps; `v` beyond 0 or 1 goes
    /// on over the pole.
    pub fn direction_from_uv(&self, uv: DVec2) -> DVec3 {
        match self {
            Self::Spherical(_) => spherical(longitude(uv.x), colatitude(uv.y)),
            Self::Planar(planar) => planar.direction_from_uv(uv),
        }
    }

    /// Texture coordinates of a place on the surface.
    pub fn uv(&self, point: SurfacePoint) -> DVec2 {
        self.uv_from_direction(self.chart().direction(point))
    }

    /// Finds the face of every texel's centre, rows in parallel; the same for any number of threads.
    pub fn table(&self, width: u32, height: u32) -> FaceTable {
        let mut faces = vec![NO_FACE; width as usize * height as usize];
        let row_uv = |y: usize| centre_uv(0, y as u32, width, height);
        match self {
            Self::Spherical(chart) => {
                let columns: Vec<(f64, f64)> =
                    (0..width).map(|x| longitude(centre_uv(x, 0, width, height).x)).collect();
                // The first texel of each row, by walking down the texture, so that every row has a near start.
                let mut start = 0;
                let starts: Vec<u32> = (0..height as usize)
                    .map(|y| {
                        start = chart.face_of(start, self.direction_from_uv(row_uv(y)));
                        start
                    })
                    .collect();
                faces.par_chunks_mut(width.max(1) as usize).enumerate().for_each(|(y, row)| {
                    let colatitude = colatitude(row_uv(y).y);
                    let mut face = starts[y];
                    for (texel, &longitude) in row.iter_mut().zip(&columns) {
                        face = chart.face_of(face, spherical(longitude, colatitude));
                        *texel = face;
                    }
                });
            }
            Self::Planar(planar) => {
                faces.par_chunks_mut(width.max(1) as usize).enumerate().for_each(|(y, row)| {
                    for (x, texel) in row.iter_mut().enumerate() {
                        let uv = centre_uv(x as u32, y as u32, width, height);
                        *texel = planar.face_at(uv).unwrap_or(NO_FACE);
                    }
                });
            }
        }
        FaceTable { width, height, faces }
    }

    /// The place on the surface that texture coordinates show, exactly: the table only says where to start looking.
    /// `None` beside the faces of a planar chart and for coordinates that are no numbers.
    pub fn locate_uv(&self, uv: DVec2, table: &FaceTable) -> Option<SurfacePoint> {
        if !uv.is_finite() {
            return None;
        }
        let direction = self.direction_from_uv(uv);
        match self {
            Self::Spherical(chart) => {
                let (x, y) = table.texel(self.uv_from_direction(direction));
                let start = table.face(x, y);
                Some(chart.locate(if start == NO_FACE { 0 } else { start }, direction))
            }
            Self::Planar(planar) => {
                let face = planar.face_at(uv)?;
                Some(SurfacePoint { face, barycentric: planar.chart().barycentric(face, direction) })
            }
        }
    }

    /// Surface round a place, for vertices where they are now: positions in metres and unit normals, one per vertex.
    ///
    /// # Panics
    /// For a face that the chart does not have, or fewer positions or normals than it has vertices.
    pub fn frame(&self, point: SurfacePoint, positions_m: &[Vec3], normals: &[Vec3]) -> SurfaceFrame {
        let chart = self.chart();
        let triangle = chart.triangles[point.face as usize];
        let weights = point.barycentric;
        let directions = DMat3::from_cols_array_2d(&chart.corners(point.face).map(|corner| corner.to_array()));
        let corners = triangle.map(|vertex| positions_m[vertex as usize].as_dvec3());
        let positions = DMat3::from_cols(corners[0], corners[1], corners[2]);
        let doubled_area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let face_normal = doubled_area.normalize_or_zero();
        let normal = triangle.map(|vertex| normals[vertex as usize].as_dvec3());
        let normal = (normal[0] * weights.x + normal[1] * weights.y + normal[2] * weights.z).normalize_or(face_normal);

        // Direction before it is brought to length one; its length is what the weights' scale becomes.
        let chord = directions * weights;
        let (direction, scale) = match self {
            Self::Spherical(_) => (chord.normalize(), chord.length()),
            Self::Planar(_) => (chord, 1.0),
        };
        let uv = self.uv_from_direction(direction);

        // Weights change by the gradients of the flat face; the direction follows, along the sphere.
        let gradients = weight_gradients(corners, doubled_area);
        let mut ddirection = directions * gradients * (1.0 / scale);
        if self.is_spherical() {
            let along = |column: DVec3| column - direction * direction.dot(column);
            ddirection = DMat3::from_cols(along(ddirection.x_axis), along(ddirection.y_axis), along(ddirection.z_axis));
        }

        // The other way: the face's plane cuts the ray of a direction where the weights sum to one.
        let inverse = directions.inverse();
        let dposition = |ddirection: DVec3| {
            let change = scale * (inverse * ddirection);
            positions * (change - weights * change.element_sum())
        };
        let axes = self.axes(uv, direction);
        let gradient = |axis: DVec3| {
            let square = axis.length_squared();
            if square > POLE_SINE * POLE_SINE { ddirection.transpose() * axis / square } else { DVec3::ZERO }
        };
        SurfaceFrame {
            uv,
            position_m: positions * weights,
            face_normal,
            normal,
            dposition_du_m: dposition(axes[0]),
            dposition_dv_m: dposition(axes[1]),
            du_dposition_per_m: gradient(axes[0]),
            dv_dposition_per_m: gradient(axes[1]),
            direction,
            ddirection_dposition_per_m: ddirection,
        }
    }

    /// Derivatives of the direction by `u` and `v`; they are square to each other.
    fn axes(&self, uv: DVec2, direction: DVec3) -> [DVec3; 2] {
        match self {
            Self::Spherical(_) => {
                let sine = direction.x.hypot(direction.z);
                // Close to a pole the direction's own components give the meridian better than its longitude.
                let (sin, cos) =
                    if sine > POLE_SINE { (direction.x / sine, direction.z / sine) } else { longitude(uv.x) };
                let sine = if sine > POLE_SINE { sine } else { 0.0 };
                let east = DVec3::new(cos, 0.0, -sin);
                let south = DVec3::new(sin * direction.y, -sine, cos * direction.y);
                [2.0 * PI * sine * east, PI * south]
            }
            Self::Planar(planar) => [DVec3::X, if planar.is_mirrored() { DVec3::NEG_Y } else { DVec3::Y }],
        }
    }
}

/// Sine and cosine of the longitude.
fn longitude(u: f64) -> (f64, f64) {
    (2.0 * PI * (u - u.floor())).sin_cos()
}

/// Sine and cosine of the colatitude, equally exact at both poles.
fn colatitude(v: f64) -> (f64, f64) {
    if v <= 0.5 {
        (PI * v).sin_cos()
    } else {
        let (sin, cos) = (PI * (1.0 - v)).sin_cos();
        (sin, -cos)
    }
}

fn spherical(longitude: (f64, f64), colatitude: (f64, f64)) -> DVec3 {
    DVec3::new(colatitude.0 * longitude.0, colatitude.1, colatitude.0 * longitude.1)
}

/// Change of the three weights (rows) per metre along a flat face; zero for a face of no area.
fn weight_gradients(corners: [DVec3; 3], doubled_area: DVec3) -> DMat3 {
    let square = doubled_area.length_squared();
    if square.is_nan() || square <= 0.0 {
        return DMat3::ZERO;
    }
    let row = |k: usize| doubled_area.cross(corners[(k + 2) % 3] - corners[(k + 1) % 3]) / square;
    DMat3::from_cols(row(0), row(1), row(2)).transpose()
}
