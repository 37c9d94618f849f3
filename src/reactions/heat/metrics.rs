//! Size and shape of a tile's texels on the surface as it is now.

use crate::organ::atlas::Atlas;
use crate::organ::mesh::NO_FACE;
use crate::organ::surface::Surface;
use crate::reactions::texels::{MapSize, TILE_PX};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Texels along the side of a tile.
pub(super) const SIDE: usize = TILE_PX as usize;

/// The same with one texel more at either end, which belongs to the neighbours.
pub(super) const PADDED: usize = SIDE + 2;

/// One value for each texel of a tile and of the ring about it.
pub(super) type Padded = [[f32; PADDED]; PADDED];

/// Texels smaller than this count as none, square metres.
const LEAST_AREA_M2: f64 = 1e-16;

/// How heat spreads between texels: the tensor `D` of the flux `-k D grad T` per unit of texel coordinates.
///
/// With the texel's sides `a` and `b` (vectors on the surface), `D = [[b.b, -a.b], [-a.b, a.a]] / |a x b|`. It is split
/// into non-negative conductances along the rows, the columns and one diagonal, so that heat never flows towards
/// warmer texels: `D = along_u [1 0]^2 + along_v [0 1]^2 + |shear| [1 +-1]^2`. Where the texels are so slanted and
/// elongated that this cannot be had, the shear is cut down and the flux along the axes stays exact.
#[derive(Clone, Debug)]
pub(super) struct Metrics {
    /// Area of each texel, square metres; zero where there is no surface.
    pub area_m2: Padded,
    /// Conductance to the texels left and right.
    pub along_u: Padded,
    /// Conductance to the texels above and below.
    pub along_v: Padded,
    /// Conductance to the texels below right and above left where positive, below left and above right where negative.
    pub shear: Padded,
}

impl Metrics {
    /// Measures a tile and the ring about it. The same texel gets the same bits in whichever tile it is measured.
    ///
    /// Nothing lies beyond the first and last row: at a border no heat gets through, nor through a pole, where the
    /// texels' sides have no length.
    pub fn measure(surface: &Surface, size: MapSize, column: u32, row: u32) -> Box<Self> {
        let zeros = [[0.0; PADDED]; PADDED];
        let mut metrics = Box::new(Self { area_m2: zeros, along_u: zeros, along_v: zeros, shear: zeros });
        let columns: [Option<Column>; PADDED] =
            std::array::from_fn(|x| Column::new(surface.atlas, size, i64::from(column * TILE_PX) + x as i64 - 1));
        let mut patch = Patch::default();
        for y in 0..PADDED {
            let Some(map_y) = (row * TILE_PX + y as u32).checked_sub(1).filter(|&y| y < size.height_px) else {
                continue;
            };
            let v = (f64::from(map_y) + 0.5) / f64::from(size.height_px);
            let colatitude = (PI * v).sin_cos();
            for (x, column) in columns.iter().enumerate() {
                let Some(column) = column else { continue };
                let place = column.place(surface.atlas, v, colatitude);
                let Some(texel) = patch.texel(surface, size, (column.x, map_y), &place) else { continue };
                metrics.area_m2[y][x] = texel.area_m2;
                metrics.along_u[y][x] = texel.along_u;
                metrics.along_v[y][x] = texel.along_v;
                metrics.shear[y][x] = texel.shear;
            }
        }
        metrics
    }

    /// Whether any texel of the tile itself shows the surface.
    pub fn has_surface(&self) -> bool {
        self.area_m2[1..=SIDE].iter().any(|row| row[1..=SIDE].iter().any(|&area| area > 0.0))
    }
}

/// Texels of a row that count as one for the temperature: near the poles of a spherical chart texels are many times
/// higher than wide, and steps small enough for their width would be wasted. A power of two; as many together are no
/// wider than high, and there are at least four about a pole, so that heat finds its way round it.
pub(super) fn texels_per_cell(atlas: &Atlas, size: MapSize, y: u32) -> u32 {
    if !atlas.is_spherical() {
        return 1;
    }
    let sine = (PI * (f64::from(y) + 0.5) / f64::from(size.height_px)).sin();
    let width_per_height = 2.0 * f64::from(size.height_px) / f64::from(size.width_px) * sine;
    let most = (1.0 / width_per_height).min(f64::from(size.width_px / 4)).max(1.0) as u32;
    // Cells of one row are of one size.
    1 << most.ilog2().min(size.width_px.trailing_zeros())
}

/// A column of texel centres.
struct Column {
    x: u32,
    u: f64,
    longitude: (f64, f64),
}

/// Direction of a texel centre and its derivatives by `u` and `v`.
struct Place {
    uv: DVec2,
    direction: DVec3,
    by_u: DVec3,
    by_v: DVec3,
}

/// See [`Metrics`].
struct Texel {
    area_m2: f32,
    along_u: f32,
    along_v: f32,
    shear: f32,
}

impl Column {
    /// `None` beside a planar map; a spherical one goes on at its other end.
    fn new(atlas: &Atlas, size: MapSize, x: i64) -> Option<Self> {
        let width = i64::from(size.width_px);
        let wrapped = if atlas.is_spherical() { x.rem_euclid(width) } else { x };
        let x = u32::try_from(wrapped).ok().filter(|&x| x < size.width_px)?;
        let u = (f64::from(x) + 0.5) / f64::from(size.width_px);
        Some(Self { x, u, longitude: (TAU * u).sin_cos() })
    }

    fn place(&self, atlas: &Atlas, v: f64, colatitude: (f64, f64)) -> Place {
        let uv = DVec2::new(self.u, v);
        match atlas {
            Atlas::Spherical(_) => {
                let ((sin, cos), (sine, cosine)) = (self.longitude, colatitude);
                Place {
                    uv,
                    direction: DVec3::new(sine * sin, cosine, sine * cos),
                    by_u: TAU * sine * DVec3::new(cos, 0.0, -sin),
                    by_v: PI * DVec3::new(sin * cosine, -sine, cos * cosine),
                }
            }
            Atlas::Planar(planar) => Place {
                uv,
                direction: planar.direction_from_uv(uv),
                by_u: DVec3::X,
                by_v: if planar.is_mirrored() { DVec3::NEG_Y } else { DVec3::Y },
            },
        }
    }
}

/// The map from directions to the surface within one face, kept for the texels that lie in the same face.
///
/// A direction `d` shows the place `Q d / (s . d)`: see [`Atlas::frame`].
struct Patch {
    face: u32,
    position_from_direction: DMat3,
    scale_from_direction: DVec3,
}

impl Default for Patch {
    fn default() -> Self {
        Self { face: NO_FACE, position_from_direction: DMat3::ZERO, scale_from_direction: DVec3::ZERO }
    }
}

impl Patch {
    /// `None` where there is no surface, or none with an area.
    fn texel(&mut self, surface: &Surface, size: MapSize, (x, y): (u32, u32), place: &Place) -> Option<Texel> {
        let face = face_at(surface, size, (x, y), place)?;
        if face != self.face {
            *self = Self::new(surface, face)?;
        }
        let scale = 1.0 / self.scale_from_direction.dot(place.direction);
        let position_m = scale * (self.position_from_direction * place.direction);
        let derivative = |direction: DVec3| {
            scale * (self.position_from_direction * direction - position_m * self.scale_from_direction.dot(direction))
        };
        let side_u_m = derivative(place.by_u) / f64::from(size.width_px);
        let side_v_m = derivative(place.by_v) / f64::from(size.height_px);
        let area_m2 = side_u_m.cross(side_v_m).length();
        if !(area_m2.is_finite() && area_m2 > LEAST_AREA_M2) {
            return None;
        }
        let (along_u, along_v) = (side_v_m.length_squared() / area_m2, side_u_m.length_squared() / area_m2);
        let wanted = -side_u_m.dot(side_v_m) / area_m2;
        let shear = wanted.clamp(-along_u.min(along_v), along_u.min(along_v));
        let texel = Texel {
            area_m2: area_m2 as f32,
            along_u: (along_u - shear.abs()) as f32,
            along_v: (along_v - shear.abs()) as f32,
            shear: shear as f32,
        };
        (texel.area_m2.is_finite() && texel.along_u.is_finite() && texel.along_v.is_finite()).then_some(texel)
    }

    /// `None` for a face or vertices that do not exist.
    fn new(surface: &Surface, face: u32) -> Option<Self> {
        let chart = surface.atlas.chart();
        let triangle = chart.triangles.get(face as usize)?;
        let [a, b, c] = triangle.map(|vertex| surface.positions_m.get(vertex as usize).map(|p| p.as_dvec3()));
        let [da, db, dc] = chart.corners(face);
        let weights_from_direction = DMat3::from_cols(da, db, dc).inverse();
        Some(Self {
            face,
            position_from_direction: DMat3::from_cols(a?, b?, c?) * weights_from_direction,
            scale_from_direction: weights_from_direction.transpose() * DVec3::ONE,
        })
    }
}

/// The face that a texel's centre shows.
fn face_at(surface: &Surface, size: MapSize, (x, y): (u32, u32), place: &Place) -> Option<u32> {
    let table = surface.table;
    if (table.width, table.height) == (size.width_px, size.height_px) {
        return Some(table.face(x, y)).filter(|&face| face != NO_FACE);
    }
    match surface.atlas {
        Atlas::Spherical(chart) => {
            let (x, y) = table.texel(place.uv);
            let start = table.face(x, y);
            Some(chart.face_of(if start == NO_FACE { 0 } else { start }, place.direction))
        }
        Atlas::Planar(planar) => planar.face_at(place.uv),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::organ::chart::{self, ChartOptions};
    use crate::organ::procedural_ellipsoid;
    use crate::organ::sphere::SurfacePoint;
    use glam::Vec3;

    #[test]
    fn texels_are_as_large_as_the_charts_frame_says() {
        let mesh = procedural_ellipsoid(Vec3::new(0.1, 0.06, 0.08), 6);
        let normals = mesh.vertex_normals();
        let (chart, _) = chart::build(&mesh, &ChartOptions::default()).expect("an ellipsoid has a chart");
        let atlas = Atlas::Spherical(chart);
        let size = MapSize::from_width(256);
        // The exact table, and one that only says where to start.
        for table in [atlas.table(256, 128), atlas.table(64, 32)] {
            let surface = Surface { atlas: &atlas, table: &table, positions_m: &mesh.positions_m, normals: &normals };
            for (column, row) in [(0, 0), (7, 3), (3, 1), (0, 2)] {
                let metrics = Metrics::measure(&surface, size, column, row);
                for (x, y) in [(0, 1), (1, 1), (17, 9), (33, 32), (32, 20)] {
                    let map_x = (column * TILE_PX + x as u32 + size.width_px - 1) % size.width_px;
                    let map_y = row * TILE_PX + y as u32 - 1;
                    let uv = DVec2::new((f64::from(map_x) + 0.5) / 256.0, (f64::from(map_y) + 0.5) / 128.0);
                    let point: SurfacePoint = atlas.locate_uv(uv, &table).expect("a sphere has a face everywhere");
                    let frame = surface.frame(point);
                    let wanted_m2 = frame.texel_area_m2(256, 128);
                    assert!((f64::from(metrics.area_m2[y][x]) / wanted_m2 - 1.0).abs() < 1e-6);
                    let (a, b) = (frame.dposition_du_m / 256.0, frame.dposition_dv_m / 128.0);
                    let shear = f64::from(metrics.shear[y][x].abs());
                    let along_u = f64::from(metrics.along_u[y][x]) + shear;
                    let along_v = f64::from(metrics.along_v[y][x]) + shear;
                    assert!((along_u / (b.dot(b) / wanted_m2) - 1.0).abs() < 1e-5);
                    assert!((along_v / (a.dot(a) / wanted_m2) - 1.0).abs() < 1e-5);
                    let wanted_shear = (-a.dot(b) / wanted_m2).clamp(-along_u.min(along_v), along_u.min(along_v));
                    assert!((f64::from(metrics.shear[y][x]) - wanted_shear).abs() < 1e-5 * along_u.max(1.0));
                }
            }
            let first_row = Metrics::measure(&surface, size, 2, 0);
            assert!(first_row.area_m2[0].iter().all(|&area| area == 0.0), "nothing lies beyond the pole");
        }
    }

    #[test]
    fn cells_are_no_wider_than_high_and_at_least_four_about_a_pole() {
        let mesh = procedural_ellipsoid(Vec3::splat(0.1), 2);
        let (chart, _) = chart::build(&mesh, &ChartOptions::default()).expect("a sphere has a chart");
        let atlas = Atlas::Spherical(chart);
        for width in [64, 1024, 8192] {
            let size = MapSize::from_width(width);
            assert!((width / 16..=width / 4).contains(&texels_per_cell(&atlas, size, 0)), "{width}");
            for y in 0..size.height_px {
                let count = texels_per_cell(&atlas, size, y);
                let sine = (PI * (f64::from(y) + 0.5) / f64::from(size.height_px)).sin();
                assert!(count == 1 || f64::from(count) * sine <= 1.0);
                assert_eq!(count, texels_per_cell(&atlas, size, size.height_px - 1 - y));
            }
            // Cells that span tiles are in the outermost rows of tiles only.
            assert!(size.height_px <= TILE_PX || texels_per_cell(&atlas, size, TILE_PX) <= TILE_PX);
        }
    }
}
