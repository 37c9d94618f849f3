//! Lays a surface out on the sphere, coarse to fine, with the least stretch that keeps every face positive.
//!
//! After Praun and Hoppe (2003): the tetrahedron at the coarse end is laid out by hand, vertices come back one by one
//! into the kernel of their ring, and all are moved now and then to lower an energy. The energy of a face compares
//! the flat face on the organ (scaled so that the whole organ has the area of the unit sphere) with the flat face
//! through its three directions: `shear * area^theta` with `shear = (s1/s2 + s2/s1) / 2` and
//! `area = (s1 s2 + 1/(s1 s2)) / 2` of the two stretches `s1, s2` (Degener, Meseth and Klein 2003). Both are one at
//! best and infinite for a face of no area. The area of the face on the sphere is taken from the volume that its
//! corners span with the centre, so the energy is a barrier for faces that would wrap round a hemisphere too.

use super::progressive::{Progressive, next_corner};
use glam::{DVec2, DVec3};

/// Faces on the organ lower than this share of their longest edge count as this high: a sliver has no shape worth
/// keeping.
const LEAST_HEIGHT: f64 = 0.05;
/// Share of the way to the nearest flip that one move may go.
const REACH: f64 = 0.9;
/// Longest move of a vertex at once, radians.
const LONGEST_STEP: f64 = 0.5;
/// Times that a move is shortened before the vertex stays where it is.
const LINE_SEARCH_STEPS: usize = 8;
/// Half-width of the cone round the parent in which a vertex may come back.
const WIDEST_TANGENT: f64 = 2.0;

/// How much to relax, and for what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Effort {
    /// Exponent of the area term.
    pub theta: f64,
    /// Sweeps over all vertices each time their number has grown by `growth`.
    pub sweeps: usize,
    /// Growth of the number of vertices from one round of sweeps to the next.
    pub growth: f64,
    /// Sweeps at most over the full surface.
    pub final_sweeps: usize,
    /// The final sweeps end when one lowers the energy by less than this share.
    pub settled: f64,
}

/// Shape and size that a face should have on the sphere.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    /// Cotangents of the angles at the three corners.
    pub cotangents: [f64; 3],
    /// Area on the unit sphere.
    pub area: f64,
}

impl Shape {
    pub fn new(corners: [DVec3; 3], area: f64) -> Self {
        let squares = [0, 1, 2].map(|k| corners[(k + 1) % 3].distance_squared(corners[(k + 2) % 3]));
        let apex = (0..3).fold(0, |longest, k| if squares[k] > squares[longest] { k } else { longest });
        let base = squares[apex].sqrt();
        if base <= 0.0 {
            return Self { cotangents: [1.0 / 3f64.sqrt(); 3], area };
        }
        let [first, second, top] = [(apex + 1) % 3, (apex + 2) % 3, apex].map(|k| corners[k]);
        let along = (second - first) / base;
        let foot = (top - first).dot(along);
        let height = (top - first).cross(along).length().max(LEAST_HEIGHT * base);
        let mut cotangents = [0.0; 3];
        cotangents[(apex + 1) % 3] = foot / height;
        cotangents[(apex + 2) % 3] = (base - foot) / height;
        cotangents[apex] = (height * height - foot * (base - foot)) / (base * height);
        Self { cotangents, area }
    }
}

/// `S(d)^theta / d` and its first two derivatives, with `S = (d + 1/d) / 2`.
fn area_term(d: f64, theta: f64) -> (f64, f64, f64) {
    let inverse = 1.0 / d;
    let s = 0.5 * (d + inverse);
    let s1 = 0.5 * (1.0 - inverse * inverse);
    let s2 = inverse * inverse * inverse;
    let value = s.powf(theta) * inverse;
    let log1 = theta * s1 / s - inverse;
    let log2 = theta * (s2 / s - (s1 / s) * (s1 / s)) + inverse * inverse;
    (value, value * log1, value * (log1 * log1 + log2))
}

/// A face seen from the vertex that moves.
#[derive(Clone, Copy)]
struct Spoke {
    /// Cotangent-weighted sum of the two other corners.
    pull: DVec3,
    /// `constant - pull . p` is the cotangent sum of `1 - cos` over the edges.
    constant: f64,
    /// `outward . p` is the area on the sphere over the area wanted.
    outward: DVec3,
}

impl Spoke {
    fn energy(&self, p: DVec3, theta: f64) -> f64 {
        let d = self.outward.dot(p);
        if d <= 0.0 {
            return f64::INFINITY;
        }
        let inverse = 1.0 / d;
        0.5 * (self.constant - self.pull.dot(p)) * (0.5 * (d + inverse)).powf(theta) * inverse
    }
}

/// Directions on the sphere that are being improved.
pub(super) struct Layout {
    pub directions: Vec<DVec3>,
    shapes: Vec<Shape>,
    spokes: Vec<Spoke>,
    theta: f64,
}

/// Lays out the whole surface; `None` where rounding left no room for a vertex.
pub(super) fn lay_out(surface: &mut Progressive, effort: &Effort) -> Option<Vec<DVec3>> {
    let mut layout = Layout {
        directions: vec![DVec3::ZERO; surface.positions.len()],
        shapes: vec![Shape { cotangents: [0.0; 3], area: 1.0 }; surface.triangles.len()],
        spokes: Vec::new(),
        theta: effort.theta,
    };
    let mut order = layout.lay_out_tetrahedron(surface)?;
    let mut swept = order.len();
    for _ in 0..effort.sweeps {
        layout.sweep(surface, &order);
    }
    while let Some(restored) = surface.restore() {
        layout.place(surface, restored.vertex, restored.parent)?;
        order.push(restored.vertex);
        let full = surface.removed_count() == 0;
        if !full && order.len() as f64 >= effort.growth * swept as f64 {
            for _ in 0..effort.sweeps {
                layout.sweep(surface, &order);
            }
            swept = order.len();
        }
    }
    layout.polish(surface, &mut order, effort);
    Some(layout.directions)
}

impl Layout {
    fn refresh(&mut self, surface: &Progressive, face: u32) {
        let corners = surface.triangles[face as usize].map(|vertex| surface.positions[vertex as usize]);
        self.shapes[face as usize] = Shape::new(corners, surface.areas[face as usize]);
    }

    /// The last four vertices go to the corners of a regular tetrahedron, the right way round.
    fn lay_out_tetrahedron(&mut self, surface: &Progressive) -> Option<Vec<u32>> {
        let vertices = surface.remaining();
        let &[a, b, c, d] = vertices.as_slice() else { return None };
        let faces = surface.incident[a as usize].clone();
        let turns_left = faces.iter().any(|&face| {
            let triangle = surface.triangles[face as usize];
            triangle.contains(&c) && next_corner(triangle, a) == b
        });
        let (third, fourth) = if turns_left { (d, c) } else { (c, d) };
        for (vertex, corner) in
            [(a, [1.0, 1.0, 1.0]), (b, [-1.0, 1.0, -1.0]), (third, [1.0, -1.0, -1.0]), (fourth, [-1.0, -1.0, 1.0])]
        {
            self.directions[vertex as usize] = DVec3::from_array(corner).normalize();
        }
        for vertex in [a, b] {
            for &face in &surface.incident[vertex as usize] {
                self.refresh(surface, face);
            }
        }
        Some(vertices)
    }

    /// Puts a vertex that came back into the kernel of its ring and lets it and its neighbours settle.
    fn place(&mut self, surface: &Progressive, vertex: u32, parent: u32) -> Option<()> {
        for &face in &surface.incident[vertex as usize] {
            self.refresh(surface, face);
        }
        self.directions[vertex as usize] = self.kernel_centre(surface, vertex, self.directions[parent as usize])?;
        let ring = surface.ring(vertex);
        for _ in 0..3 {
            self.improve(surface, vertex);
        }
        for &other in &ring {
            self.improve(surface, other);
        }
        self.improve(surface, vertex);
        Some(())
    }

    /// A direction well inside all the half-spaces that keep the faces round a vertex positive.
    ///
    /// The cone of all such directions has the parent on its border; it is cut out of a wide square cone round the
    /// parent, face by face. Its middle is taken, as the mean of the corners of its cross-section.
    fn kernel_centre(&self, surface: &Progressive, vertex: u32, parent: DVec3) -> Option<DVec3> {
        let (right, up) = parent.any_orthonormal_pair();
        let mut cone: Vec<DVec3> = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .iter()
            .map(|&(x, y)| (parent + WIDEST_TANGENT * (right * x + up * y)).normalize())
            .collect();
        for &face in &surface.incident[vertex as usize] {
            let plane = self.opposite_edge(surface.triangles[face as usize], vertex).1;
            let mut clipped = Vec::with_capacity(cone.len() + 1);
            for (k, &ray) in cone.iter().enumerate() {
                let next = cone[(k + 1) % cone.len()];
                let (here, there) = (plane.dot(ray), plane.dot(next));
                if here >= 0.0 {
                    clipped.push(ray);
                }
                if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
                    clipped.push((ray * there.abs() + next * here.abs()).normalize());
                }
            }
            cone = clipped;
        }
        let middle = cone.iter().sum::<DVec3>().normalize_or_zero();
        let is_inside = surface.incident[vertex as usize]
            .iter()
            .all(|&face| self.opposite_edge(surface.triangles[face as usize], vertex).1.dot(middle) > 0.0);
        (middle != DVec3::ZERO && is_inside).then_some(middle)
    }

    /// Which corner of a face a vertex is, and the normal of the plane through the other two and the centre.
    fn opposite_edge(&self, triangle: [u32; 3], vertex: u32) -> (usize, DVec3) {
        let corner = triangle.iter().position(|&other| other == vertex).unwrap_or(0);
        let b = self.directions[triangle[(corner + 1) % 3] as usize];
        let c = self.directions[triangle[(corner + 2) % 3] as usize];
        (corner, b.cross(c))
    }

    fn gather(&mut self, surface: &Progressive, vertex: u32) {
        self.spokes.clear();
        for &face in &surface.incident[vertex as usize] {
            let triangle = surface.triangles[face as usize];
            let Shape { cotangents, area } = self.shapes[face as usize];
            let (corner, plane) = self.opposite_edge(triangle, vertex);
            let (next, last) = ((corner + 1) % 3, (corner + 2) % 3);
            let (b, c) = (self.directions[triangle[next] as usize], self.directions[triangle[last] as usize]);
            self.spokes.push(Spoke {
                pull: cotangents[next] * c + cotangents[last] * b,
                constant: cotangents[corner] * (1.0 - b.dot(c)) + cotangents[next] + cotangents[last],
                outward: plane / (2.0 * area),
            });
        }
    }

    /// One guarded Newton step of one vertex over the sphere; the energy round it before and after.
    fn improve(&mut self, surface: &Progressive, vertex: u32) -> (f64, f64) {
        self.gather(surface, vertex);
        let p = self.directions[vertex as usize];
        let theta = self.theta;
        let (right, up) = p.any_orthonormal_pair();
        let mut before = 0.0;
        let mut gradient = DVec2::ZERO;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        let mut radial = 0.0;
        for spoke in &self.spokes {
            let d = spoke.outward.dot(p);
            let k = spoke.constant - spoke.pull.dot(p);
            let (value, first, second) = area_term(d, theta);
            before += 0.5 * k * value;
            let pull = -0.5 * DVec2::new(spoke.pull.dot(right), spoke.pull.dot(up));
            let outward = DVec2::new(spoke.outward.dot(right), spoke.outward.dot(up));
            let slope = 0.5 * k * first;
            let bend = 0.5 * k * second;
            gradient += value * pull + slope * outward;
            radial += slope * d - 0.5 * value * spoke.pull.dot(p);
            xx += 2.0 * first * pull.x * outward.x + bend * outward.x * outward.x;
            xy += first * (pull.x * outward.y + pull.y * outward.x) + bend * outward.x * outward.y;
            yy += 2.0 * first * pull.y * outward.y + bend * outward.y * outward.y;
        }
        // Curvature of the sphere: walking along it leaves the tangent plane.
        xx -= radial;
        yy -= radial;
        let step = newton_step(gradient, xx, xy, yy);
        let mut tangent = right * step.x + up * step.y;
        let length = tangent.length();
        if !(length > 0.0 && length.is_finite() && before.is_finite()) {
            return (before, before);
        }
        tangent *= (LONGEST_STEP / length).min(1.0);
        let mut share: f64 = 1.0;
        for spoke in &self.spokes {
            let (here, slope) = (spoke.outward.dot(p), spoke.outward.dot(tangent));
            if slope < 0.0 {
                share = share.min(-REACH * here / slope);
            }
        }
        for _ in 0..LINE_SEARCH_STEPS {
            let moved = (p + share * tangent).normalize();
            let after: f64 = self.spokes.iter().map(|spoke| spoke.energy(moved, theta)).sum();
            if after < before {
                self.directions[vertex as usize] = moved;
                return (before, after);
            }
            share *= 0.35;
        }
        (before, before)
    }

    /// Moves every vertex once; how much energy that took away.
    fn sweep(&mut self, surface: &Progressive, order: &[u32]) -> f64 {
        order
            .iter()
            .map(|&vertex| {
                let (before, after) = self.improve(surface, vertex);
                before - after
            })
            .sum()
    }

    fn energy(&self, surface: &Progressive) -> f64 {
        surface
            .triangles
            .iter()
            .zip(&self.shapes)
            .map(|(triangle, shape)| {
                let [a, b, c] = triangle.map(|vertex| self.directions[vertex as usize]);
                let [x, y, z] = shape.cotangents;
                let sum = x * (1.0 - b.dot(c)) + y * (1.0 - c.dot(a)) + z * (1.0 - a.dot(b));
                let d = a.dot(b.cross(c)) / (2.0 * shape.area);
                0.5 * sum * area_term(d, self.theta).0
            })
            .sum()
    }

    fn polish(&mut self, surface: &Progressive, order: &mut [u32], effort: &Effort) {
        for _ in 0..effort.final_sweeps {
            let saved = self.sweep(surface, order);
            // To and fro, so that what is learnt at one end reaches the other.
            order.reverse();
            if saved < effort.settled * self.energy(surface) {
                break;
            }
        }
    }
}

/// Downhill step of a quadratic model in the plane; where the model bends the wrong way, its eigenvalues are flipped.
fn newton_step(gradient: DVec2, xx: f64, xy: f64, yy: f64) -> DVec2 {
    let mean = 0.5 * (xx + yy);
    let spread = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
    let (high, low) = (mean + spread, mean - spread);
    if low > 1e-3 * high {
        let determinant = xx * yy - xy * xy;
        return -DVec2::new(yy * gradient.x - xy * gradient.y, xx * gradient.y - xy * gradient.x) / determinant;
    }
    // Eigenvector of the larger eigenvalue.
    let axis = if spread > 0.0 {
        let candidate = if xx > yy { DVec2::new(high - yy, xy) } else { DVec2::new(xy, high - xx) };
        candidate.normalize_or(DVec2::X)
    } else {
        DVec2::X
    };
    let floor = 1e-3 * high.abs().max(low.abs()).max(1e-9);
    let (along, across) = (axis, axis.perp());
    -(along * (gradient.dot(along) / high.abs().max(floor)) + across * (gradient.dot(across) / low.abs().max(floor)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_the_area_term() {
        for theta in [1.0, 1.5, 4.0] {
            for d in [0.01, 0.3, 1.0, 7.0] {
                let step = 1e-5 * d;
                let [low, here, high] = [d - step, d, d + step].map(|d| area_term(d, theta));
                let close = |a: f64, b: f64| (a - b).abs() < 1e-6 * (a.abs() + b.abs() + 1.0 / d);
                assert!(close((high.0 - low.0) / (2.0 * step), here.1), "theta {theta}, d {d}");
                assert!(close((high.1 - low.1) / (2.0 * step), here.2), "theta {theta}, d {d}");
            }
        }
        assert_eq!(area_term(1.0, 3.0).0, 1.0);
    }

    #[test]
    fn cotangents_of_known_triangles() {
        let right = Shape::new([DVec3::ZERO, DVec3::X, DVec3::Y * 2.0], 1.0).cotangents;
        for (cotangent, expected) in right.iter().zip([0.0, 0.5, 2.0]) {
            assert!((cotangent - expected).abs() < 1e-12, "{right:?}");
        }
        // Too thin to keep its shape, but still a triangle: the products of its cotangents sum to one.
        let [a, b, c] = Shape::new([DVec3::ZERO, DVec3::X, DVec3::new(0.3, 1e-9, 0.0)], 1.0).cotangents;
        assert!((a * b + b * c + c * a - 1.0).abs() < 1e-9 && [a, b, c].iter().all(|x| x.abs() < 21.0));
    }

    #[test]
    fn newton_steps_go_downhill() {
        // A bowl: straight to its bottom. A saddle and a hill: down all the same.
        assert!((newton_step(DVec2::new(2.0, -6.0), 2.0, 0.0, 3.0) - DVec2::new(-1.0, 2.0)).length() < 1e-12);
        for (xx, xy, yy) in [(2.0, 1.0, -1.0), (-2.0, 0.5, -1.0), (-1.0, 3.0, 2.0), (0.0, 0.0, 0.0), (0.0, 2.0, 0.0)] {
            for gradient in [DVec2::X, DVec2::NEG_Y, DVec2::new(0.3, 2.0)] {
                assert!(newton_step(gradient, xx, xy, yy).dot(gradient) < 0.0, "{xx} {xy} {yy} {gradient}");
            }
        }
    }
}
