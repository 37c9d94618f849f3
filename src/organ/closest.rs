//! Nearest places of triangles and segments.

use glam::DVec3;

/// The place of a triangle that is nearest to a point, by the regions of Ericson's book.
// The proxy of the haptic loop asks this some thirty times a tick: as a call it takes a fifth of the tick more.
#[inline(always)]
pub(crate) fn on_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return b + (c - b) * share;
    }
    let sum = va + vb + vc;
    if sum <= 0.0 {
        return a;
    }
    a + ab * (vb / sum) + ac * (vc / sum)
}

/// The place of a segment that is nearest to a point.
pub(crate) fn on_segment(point: DVec3, [from, to]: [DVec3; 2]) -> DVec3 {
    let along = to - from;
    let length2 = along.length_squared();
    if length2 <= 0.0 { from } else { from + along * ((point - from).dot(along) / length2).clamp(0.0, 1.0) }
}

/// The nearest places of two segments.
pub(crate) fn of_segments([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> (DVec3, DVec3) {
    let (u, v, w) = (q - p, s - r, p - r);
    let (a, b, c, d, e) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let determinant = a * c - b * b;
    let mut along = if determinant > 1e-12 * a * c { ((b * e - c * d) / determinant).clamp(0.0, 1.0) } else { 0.0 };
    let mut other = if c > 0.0 { (b * along + e) / c } else { 0.0 };
    if !(0.0..=1.0).contains(&other) {
        other = other.clamp(0.0, 1.0);
        along = if a > 0.0 { ((b * other - d) / a).clamp(0.0, 1.0) } else { 0.0 };
    }
    (p + u * along, r + v * other)
}

/// The nearest places of a segment and a triangle; the same place twice where they cross.
pub(crate) fn of_segment_and_triangle(segment: [DVec3; 2], triangle: [DVec3; 3]) -> (DVec3, DVec3) {
    if segment[0] == segment[1] {
        return (segment[0], on_triangle(segment[0], triangle));
    }
    let [a, b, c] = triangle;
    let normal = (b - a).cross(c - a);
    let heights = segment.map(|end| normal.dot(end - a));
    if heights[0] * heights[1] < 0.0 {
        let crossing = segment[0] + (segment[1] - segment[0]) * (heights[0] / (heights[0] - heights[1]));
        let inside = |from: DVec3, to: DVec3| (to - from).cross(crossing - from).dot(normal) >= 0.0;
        if inside(a, b) && inside(b, c) && inside(c, a) {
            return (crossing, crossing);
        }
    }
    let mut best = (segment[0], on_triangle(segment[0], triangle));
    let mut nearest = best.0.distance_squared(best.1);
    let mut take = |pair: (DVec3, DVec3)| {
        let distance = pair.0.distance_squared(pair.1);
        if distance < nearest {
            (nearest, best) = (distance, pair);
        }
    };
    take((segment[1], on_triangle(segment[1], triangle)));
    for edge in [[a, b], [b, c], [c, a]] {
        take(of_segments(segment, edge));
    }
    best
}
