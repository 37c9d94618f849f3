//! How far a round instrument is in a triangle of a surface, and where it has to be pushed.

use glam::Vec3;

/// A triangle that an instrument is in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Penetration {
    /// Where on the triangle, by weights of its corners.
    pub weights: [f32; 3],
    /// Unit vector along which the surface has to go.
    pub away: Vec3,
    /// How far, metres.
    pub depth_m: f32,
}

/// How deep a tip may be in a surface, in radii, to bring it back.
const MOST_DEPTH: f32 = 20.0;

/// How far a rod (or ball, where its ends are one) is in a triangle that runs counter-clockwise seen from outside.
pub(crate) fn penetration([a, b, c]: [Vec3; 3], (tip, back, radius_m): (Vec3, Vec3, f32)) -> Option<Penetration> {
    let middle = (a + b + c) / 3.0;
    let reach = (a - middle).length_squared().max((b - middle).length_squared()).max((c - middle).length_squared());
    let far = radius_m + reach.sqrt();
    let away = nearest_of_segment(middle, tip, back).distance_squared(middle);
    if away.is_nan() || away > far * far {
        return None;
    }
    let normal = (b - a).cross(c - a).normalize_or_zero();
    if normal == Vec3::ZERO {
        return None;
    }
    let along = tip - back;
    let length = along.length();
    // The axis runs through: the surface has to come back to the tip.
    if length > 0.0
        && let Some((weights, at)) = crossing([a, b, c], normal, tip, back)
        && along.dot(normal) < 0.0
    {
        let depth_m = at * length + radius_m;
        // A shaft that runs through another part of the organ does not sweep it along.
        if depth_m > MOST_DEPTH * radius_m {
            return None;
        }
        return Some(Penetration { weights, away: along / length, depth_m });
    }
    let (weights, on_triangle, on_axis) = nearest([a, b, c], tip, back);
    let gap = on_triangle - on_axis;
    let distance = gap.length();
    if distance >= radius_m {
        return None;
    }
    // A ball whose middle is below the surface is let out the way it came.
    let is_below = length == 0.0 && (on_axis - a).dot(normal) < 0.0;
    match (distance > 1e-9, is_below) {
        (true, false) => Some(Penetration { weights, away: gap / distance, depth_m: radius_m - distance }),
        (true, true) => Some(Penetration { weights, away: -gap / distance, depth_m: radius_m + distance }),
        _ => Some(Penetration { weights, away: -normal, depth_m: radius_m }),
    }
}

/// Where a segment runs through a triangle: weights, and the share of the way from the tip back.
fn crossing([a, b, c]: [Vec3; 3], normal: Vec3, tip: Vec3, back: Vec3) -> Option<([f32; 3], f32)> {
    let (from, to) = ((tip - a).dot(normal), (back - a).dot(normal));
    if !(from < 0.0 && to > 0.0) {
        return None;
    }
    let at = from / (from - to);
    let weights = weights_of([a, b, c], normal, tip.lerp(back, at));
    weights.iter().all(|weight| *weight >= 0.0).then_some((weights, at))
}

fn weights_of([a, b, c]: [Vec3; 3], normal: Vec3, point: Vec3) -> [f32; 3] {
    let area = (b - a).cross(c - a).dot(normal);
    let second = (point - a).cross(c - a).dot(normal) / area;
    let third = (b - a).cross(point - a).dot(normal) / area;
    [1.0 - second - third, second, third]
}

/// Nearest places of a triangle and a segment that does not run through it: weights, the place on the triangle, that on the
/// segment.
fn nearest(triangle: [Vec3; 3], tip: Vec3, back: Vec3) -> ([f32; 3], Vec3, Vec3) {
    let mut best: Option<(f32, [f32; 3], Vec3, Vec3)> = None;
    let mut offer = |weights: [f32; 3], on_axis: Vec3| {
        let at = triangle[0] * weights[0] + triangle[1] * weights[1] + triangle[2] * weights[2];
        let square = at.distance_squared(on_axis);
        if best.is_none_or(|(least, ..)| square < least) {
            best = Some((square, weights, at, on_axis));
        }
    };
    for end in [tip, back] {
        offer(nearest_of_triangle(triangle, end), end);
    }
    for edge in 0..3 {
        let next = (edge + 1) % 3;
        let (on_edge, on_axis) = nearest_of_segments(triangle[edge], triangle[next], tip, back);
        let mut weights = [0.0; 3];
        weights[edge] = 1.0 - on_edge;
        weights[next] = on_edge;
        offer(weights, tip.lerp(back, on_axis));
    }
    best.map_or(([1.0, 0.0, 0.0], triangle[0], tip), |(_, weights, at, on_axis)| (weights, at, on_axis))
}

fn nearest_of_segment(point: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    let along = to - from;
    let square = along.length_squared();
    let share = if square > 0.0 { ((point - from).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    from + along * share
}

/// Weights of the place of a triangle that is nearest to a point: inside, or on an edge.
fn nearest_of_triangle([a, b, c]: [Vec3; 3], point: Vec3) -> [f32; 3] {
    let normal = (b - a).cross(c - a);
    let inside = weights_of([a, b, c], normal.normalize_or_zero(), point);
    if inside.iter().all(|weight| *weight >= 0.0) {
        return inside;
    }
    let corners = [a, b, c];
    let mut best = ([1.0, 0.0, 0.0], f32::INFINITY);
    for edge in 0..3 {
        let next = (edge + 1) % 3;
        let (from, to) = (corners[edge], corners[next]);
        let square = (to - from).length_squared();
        let share = if square > 0.0 { ((point - from).dot(to - from) / square).clamp(0.0, 1.0) } else { 0.0 };
        let away = from.lerp(to, share).distance_squared(point);
        if away < best.1 {
            let mut weights = [0.0; 3];
            weights[edge] = 1.0 - share;
            weights[next] = share;
            best = (weights, away);
        }
    }
    best.0
}

/// Shares along two segments where they come closest.
fn nearest_of_segments(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> (f32, f32) {
    let (first, second, between) = (b - a, d - c, a - c);
    let (aa, bb, ab) = (first.length_squared(), second.length_squared(), first.dot(second));
    let (fa, fb) = (first.dot(between), second.dot(between));
    if aa <= 0.0 || bb <= 0.0 {
        let on_first = if aa > 0.0 { (-fa / aa).clamp(0.0, 1.0) } else { 0.0 };
        let on_second = if bb > 0.0 { (fb / bb).clamp(0.0, 1.0) } else { 0.0 };
        return (on_first, on_second);
    }
    let divisor = aa * bb - ab * ab;
    let on_first = if divisor > 1e-12 * aa * bb { ((ab * fb - fa * bb) / divisor).clamp(0.0, 1.0) } else { 0.0 };
    let on_second = (ab * on_first + fb) / bb;
    if on_second < 0.0 {
        ((-fa / aa).clamp(0.0, 1.0), 0.0)
    } else if on_second > 1.0 {
        (((ab - fa) / aa).clamp(0.0, 1.0), 1.0)
    } else {
        (on_first, on_second)
    }
}

/// Most rounds of [`push_out`].
const ROUNDS: usize = 12;

/// Moves the vertices of a surface until no instrument is in it.
pub(crate) fn push_out(positions_m: &mut [Vec3], triangles: &[[u32; 3]], near: &[u32], axis: (Vec3, Vec3, f32)) {
    for _ in 0..ROUNDS {
        let mut is_free = true;
        for &face in near {
            let corners = triangles[face as usize].map(|vertex| vertex as usize);
            let Some(found) = penetration(corners.map(|vertex| positions_m[vertex]), axis) else { continue };
            if found.depth_m < 1e-6 {
                continue;
            }
            is_free = false;
            let squares: f32 = found.weights.iter().map(|weight| weight * weight).sum();
            for (vertex, weight) in corners.into_iter().zip(found.weights) {
                positions_m[vertex] += found.away * (found.depth_m * weight / squares);
            }
        }
        if is_free {
            break;
        }
    }
}

/// Triangles that an instrument may reach on its way from one place to another.
pub(crate) fn triangles_near(
    positions_m: &[Vec3],
    triangles: &[[u32; 3]],
    [from, to]: [(Vec3, Vec3, f32); 2],
    margin_m: f32,
) -> Vec<u32> {
    let reach = Vec3::splat(from.2.max(to.2) + margin_m);
    let low = from.0.min(from.1).min(to.0).min(to.1) - reach;
    let high = from.0.max(from.1).max(to.0).max(to.1) + reach;
    let is_near = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|vertex| positions_m[vertex as usize]);
        a.min(b).min(c).cmple(high).all() && a.max(b).max(c).cmpge(low).all()
    };
    (0..triangles.len() as u32).filter(|face| is_near(&triangles[*face as usize])).collect()
}
