//! Straight walking on a triangulated surface: where one gets to by going ahead for some way without turning.
//!
//! Inside a face the path is a straight line. Over an edge it goes on as it would if both faces were unfolded into one
//! plane (a geodesic of the triangulation; Polthier and Schmies 1998): the direction turns about the edge by the angle
//! between the faces, which is also the parallel transport of whatever moves along. Nothing is done in texture space,
//! so lengths are exact and neither the date line nor the poles exist; texture coordinates follow from
//! [`Atlas::uv`](crate::organ::atlas::Atlas::uv).

use crate::organ::mesh::NO_FACE;
use crate::organ::sphere::SurfacePoint;
use crate::organ::surface::Surface;
use bevy::reflect::Reflect;
use glam::DVec3;

/// Most edges that one walk crosses.
const MOST_CROSSINGS: usize = 1 << 16;

/// A face less high than this share of its longest edge has no area: its plane would be rounding noise.
const LEAST_HEIGHT: f64 = 1e-12;

/// Where a straight walk ended, and why there.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct Walk {
    /// The end.
    pub point: SurfacePoint,
    /// Unit direction of the walk at its end, in the plane of the last face; zero where there was no way to go.
    pub direction: DVec3,
    /// Unit normal of the face in whose plane `direction` lies; zero where a walk on a face without area went nowhere.
    pub face_normal: DVec3,
    /// Length of the path, metres.
    pub distance_m: f64,
    /// What ended it.
    pub stop: WalkStop,
}

/// What ended a walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
pub enum WalkStop {
    /// It went all the way.
    Arrived,
    /// It came to a border of an open surface.
    Border,
    /// It crossed 65,536 edges and was ended there.
    TooManyFaces,
}

/// Why there is no way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect, thiserror::Error)]
pub enum WalkError {
    /// The surface does not have the face.
    #[error("face {face} does not exist")]
    NoSuchFace {
        /// The face asked for.
        face: u32,
    },
    /// There are fewer positions than the chart has vertices.
    #[error("{positions} positions do not fit {vertices} vertices")]
    TooFewPositions {
        /// Positions given.
        positions: usize,
        /// Vertices of the chart.
        vertices: usize,
    },
    /// The start's weights or the displacement are not finite numbers, or no weight is above zero.
    #[error("the start or the displacement of a walk is not finite")]
    NotFinite,
    /// A corner of a face on the way is not finite.
    #[error("face {face} has a corner that is not finite")]
    BrokenFace {
        /// The face.
        face: u32,
    },
    /// The start and all that lies next to it has no area, so that no direction can be taken.
    #[error("face {face} has no area, nor has what it leads to")]
    NoArea {
        /// The face.
        face: u32,
    },
}

/// Walks straight ahead from `start` along a displacement in the organ's space (metres). Its part square to the start
/// face does not count; what is left is the length of the walk.
///
/// A start face without area is left for one beside it, at the same place, before the direction is taken. Weights of
/// the end lie within [0, 1] and sum to one. At most 65,536 edges are crossed (some milliseconds).
///
/// # Errors
/// [`WalkError`] where the surface or the question is broken.
pub fn walk(surface: &Surface, start: SurfacePoint, displacement_m: DVec3) -> Result<Walk, WalkError> {
    let (positions, vertices) = (surface.positions_m.len(), surface.atlas.chart().directions.len());
    if positions < vertices {
        return Err(WalkError::TooFewPositions { positions, vertices });
    }
    let weights = tidy(start.barycentric).ok_or(WalkError::NotFinite)?;
    let mut walker = Walker { surface, face: Face::new(surface, start.face)?, weights, entry: None };
    walker.seek_area()?;

    let mut normal = walker.face.normal;
    let along = displacement_m - normal * normal.dot(displacement_m);
    let length_m = along.length();
    if !length_m.is_finite() {
        return Err(WalkError::NotFinite);
    }
    let mut direction = along.normalize_or_zero();
    let mut left_m = if direction == DVec3::ZERO { 0.0 } else { length_m };
    let mut stop = WalkStop::TooManyFaces;
    let mut crossings = 0;
    while crossings < MOST_CROSSINGS {
        if walker.face.has_area {
            match walker.advance(direction, left_m) {
                Advance::Arrives => {
                    left_m = 0.0;
                    stop = WalkStop::Arrived;
                    break;
                }
                Advance::Reaches { side, distance_m } => {
                    left_m -= distance_m;
                    if !walker.cross(side)? {
                        stop = WalkStop::Border;
                        break;
                    }
                }
            }
        } else {
            let side = walker.side_out_of_line();
            if !walker.cross(side)? {
                stop = WalkStop::Border;
                break;
            }
        }
        crossings += 1;
        if walker.face.has_area {
            direction = walker.unfold(direction, normal);
            normal = walker.face.normal;
        }
    }
    let distance_m = if direction == DVec3::ZERO { 0.0 } else { (length_m - left_m).max(0.0) };
    let point = SurfacePoint { face: walker.face.index, barycentric: walker.weights };
    Ok(Walk { point, direction, face_normal: normal, distance_m, stop })
}

/// Turns a vector that lies square to one unit normal into the plane of another, by the least rotation between the two:
/// the parallel transport over the bend between them. Opposite normals, between which no rotation is the least, only
/// project it, at the same length; a zero normal leaves it alone.
pub(super) fn turned(vector: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let cosine = from.dot(to);
    if cosine < -0.999_999 {
        return (vector - to * to.dot(vector)).normalize_or_zero() * vector.length();
    }
    // The rotation's formula after Rodrigues, for vectors square to `from`.
    vector - (from + to) * (to.dot(vector) / (1.0 + cosine))
}

/// Weights within [0, 1] that sum to one; `None` for what is no place.
fn tidy(weights: DVec3) -> Option<DVec3> {
    let weights = weights.max(DVec3::ZERO);
    let sum = weights.element_sum();
    // Dividing by an infinite sum or by zero leaves nothing that is a number.
    (weights.is_finite() && sum > 0.0 && sum.is_finite()).then(|| weights / sum)
}

/// A face as it lies in space.
struct Face {
    index: u32,
    corners: [DVec3; 3],
    has_area: bool,
    /// Unit normal; zero without area.
    normal: DVec3,
    /// Change of the three weights per metre along the face; zero without area.
    gradients: [DVec3; 3],
}

impl Face {
    fn new(surface: &Surface, index: u32) -> Result<Self, WalkError> {
        if index as usize >= surface.atlas.chart().triangles.len() {
            return Err(WalkError::NoSuchFace { face: index });
        }
        let corners = surface.corners(index);
        if !corners.iter().all(|corner| corner.is_finite()) {
            return Err(WalkError::BrokenFace { face: index });
        }
        let edges = [0, 1, 2].map(|k: usize| corners[(k + 2) % 3] - corners[(k + 1) % 3]);
        let doubled_area = edges[2].cross(-edges[1]);
        let square = doubled_area.length_squared();
        let longest = edges.iter().map(|edge| edge.length_squared()).fold(0.0, f64::max);
        let has_area = square > (LEAST_HEIGHT * longest).powi(2) && square.is_normal();
        if !has_area {
            return Ok(Self { index, corners, has_area, normal: DVec3::ZERO, gradients: [DVec3::ZERO; 3] });
        }
        let gradients = edges.map(|edge| doubled_area.cross(edge) / square);
        Ok(Self { index, corners, has_area, normal: doubled_area / square.sqrt(), gradients })
    }

    fn position_m(&self, weights: DVec3) -> DVec3 {
        self.corners[0] * weights.x + self.corners[1] * weights.y + self.corners[2] * weights.z
    }
}

enum Advance {
    /// The way ends within the face.
    Arrives,
    /// It comes to the side across from this corner.
    Reaches { side: usize, distance_m: f64 },
}

/// A place on the surface that moves from face to face.
struct Walker<'a> {
    surface: &'a Surface<'a>,
    face: Face,
    weights: DVec3,
    /// Side by which the face was entered, named by the corner across.
    entry: Option<usize>,
}

impl Walker<'_> {
    /// Goes along a unit direction within the face, as far as `left_m` or a side.
    fn advance(&mut self, direction: DVec3, left_m: f64) -> Advance {
        let rates = DVec3::from_array(self.face.gradients.map(|gradient| gradient.dot(direction)));
        // Never back over the side just crossed: where the way runs along it, rounding could send it to and fro.
        let exit = (0..3)
            .filter(|&k| Some(k) != self.entry && rates[k] < 0.0)
            .map(|k| (self.weights[k] / -rates[k], k))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let (distance_m, side) = match exit {
            Some((distance_m, side)) if distance_m < left_m => (distance_m, Some(side)),
            _ => (left_m, None),
        };
        let mut weights = self.weights + rates * distance_m;
        if let Some(side) = side {
            weights[side] = 0.0;
        }
        self.weights = tidy(weights).unwrap_or(self.weights);
        side.map_or(Advance::Arrives, |side| Advance::Reaches { side, distance_m })
    }

    /// Goes over the side across from a corner, without moving; `false` at a border.
    fn cross(&mut self, side: usize) -> Result<bool, WalkError> {
        let chart = self.surface.atlas.chart();
        let (first, second) = ((side + 1) % 3, (side + 2) % 3);
        let next = chart.neighbours[self.face.index as usize][first];
        if next == NO_FACE {
            return Ok(false);
        }
        let triangle = chart.triangles[self.face.index as usize];
        let face = Face::new(self.surface, next)?;
        let place = |vertex| chart.triangles[next as usize].iter().position(|&other| other == vertex);
        // Faces that are neighbours share both corners; a chart where they do not ends here.
        let (Some(to_first), Some(to_second)) = (place(triangle[first]), place(triangle[second])) else {
            return Ok(false);
        };
        let mut weights = DVec3::ZERO;
        weights[to_first] = self.weights[first];
        weights[to_second] = self.weights[second];
        let Some(weights) = tidy(weights) else { return Ok(false) };
        self.face = face;
        self.weights = weights;
        self.entry = (0..3).find(|&k| k != to_first && k != to_second);
        Ok(true)
    }

    /// The side by which to leave a face that is only a line: the one on which the place already lies, other than that
    /// of the entry; the longest of several. The place is moved onto it, which moves it by no more than rounding.
    fn side_out_of_line(&mut self) -> usize {
        let place = self.face.position_m(self.weights);
        let (mut best, mut best_share, mut best_score) = (0, 0.0, (f64::INFINITY, f64::INFINITY));
        for side in (0..3).filter(|&side| Some(side) != self.entry) {
            let (a, b) = (self.face.corners[(side + 1) % 3], self.face.corners[(side + 2) % 3]);
            let square = (b - a).length_squared();
            let share = if square > 0.0 { ((place - a).dot(b - a) / square).clamp(0.0, 1.0) } else { 0.0 };
            let score = (place.distance(a.lerp(b, share)), -square);
            if score < best_score {
                (best, best_share, best_score) = (side, share, score);
            }
        }
        self.weights = DVec3::ZERO;
        self.weights[(best + 1) % 3] = 1.0 - best_share;
        self.weights[(best + 2) % 3] = best_share;
        best
    }

    /// Goes on from a face without area to the first beside it that has some.
    fn seek_area(&mut self) -> Result<(), WalkError> {
        let start = self.face.index;
        for _ in 0..MOST_CROSSINGS {
            if self.face.has_area {
                // Nobody walked here yet: every side may be the first to be crossed.
                self.entry = None;
                return Ok(());
            }
            let side = self.side_out_of_line();
            if !self.cross(side)? {
                break;
            }
        }
        Err(WalkError::NoArea { face: start })
    }

    /// The direction after the bend from the last face with an area, which had this normal.
    fn unfold(&self, direction: DVec3, normal: DVec3) -> DVec3 {
        let to = self.face.normal;
        let turned = if normal.dot(to) > -0.5 {
            turned(direction, normal, to)
        } else {
            // A sharp fold: its rotation is known best by the edge itself, which the way is folded about.
            let entry = self.entry.unwrap_or(0);
            let edge = self.face.corners[(entry + 2) % 3] - self.face.corners[(entry + 1) % 3];
            let edge = edge.normalize_or(normal.cross(direction));
            let across = edge.cross(normal);
            edge * edge.dot(direction) + edge.cross(to) * across.dot(direction)
        };
        // Rounding must add up neither to a change of length nor to a way out of the plane.
        (turned - to * to.dot(turned)).normalize_or(direction)
    }
}
