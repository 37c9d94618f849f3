//! A rod that moves through a step: where it first touches a body, and how deep it ends in it.
//!
//! Conservative advancement: nothing can be touched before the rod has gone as far as it is away from the nearest thing; so it is
//! moved by that, and looked at again. However fast it is, it is never on the other side of a wall without having touched it.

use super::ContactMatter;
use bevy::math::DVec3;

/// The nearest place of a body to a segment, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Near {
    /// How far the segment's place is over the surface, metres; below 0 inside.
    pub(super) height_m: f64,
    /// The place on the surface, metres.
    pub(super) point_m: DVec3,
    /// The place on the segment, metres.
    pub(super) on_segment_m: DVec3,
    /// Unit normal out of the body.
    pub(super) normal: DVec3,
    /// What is there.
    pub(super) matter: ContactMatter,
}

/// A body that can say where it is nearest.
pub(super) trait Solid {
    /// The nearest place of its surface to a segment, at most so far away; inside it the depth counts as distance.
    fn nearest(&self, ends_m: [DVec3; 2], max_distance_m: f64) -> Option<Near>;
}

/// A touch during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SweptTouch {
    /// Where.
    pub(super) near: Near,
    /// How far the rod is behind the surface when the step ends, metres; not below 0.
    pub(super) depth_m: f64,
    /// After what share of the step it touched first.
    pub(super) share: f64,
}

/// Looks along a way at most so often; at a grazing wall each look gets less far.
const MOST_LOOKS: u32 = 64;
/// Nearer than this counts as touching, metres.
const TOUCH_M: f64 = 1e-6;

/// What is known of a rod and a body after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Swept {
    /// The touch, if there is one.
    pub(super) touch: Option<SweptTouch>,
    /// How far the rod is from the surface in the end, metres, where that is within the search.
    pub(super) gap_m: Option<f64>,
}

/// Moves a rod of a radius from where its ends were to where they are, along straight lines. `search_m` is how far around the rod is
/// looked: how deep in a body a rod may be that touched it before, and up to where gaps are told of.
pub(super) fn sweep(
    solid: &impl Solid,
    from_m: Option<[DVec3; 2]>,
    to_m: [DVec3; 2],
    radius_m: f64,
    search_m: f64,
) -> Swept {
    let way = |from_m: [DVec3; 2]| from_m[0].distance(to_m[0]).max(from_m[1].distance(to_m[1]));
    let travel_m = from_m.map_or(0.0, way);
    // What was touched on the way is no further from the end than the way is long.
    let Some(near) = solid.nearest(to_m, radius_m + search_m.max(travel_m)) else { return Swept::default() };
    let gap_m = near.height_m - radius_m;
    let in_the_end = (gap_m < 0.0).then_some(SweptTouch { near, depth_m: -gap_m, share: 0.0 });
    let touch = match from_m {
        // A slow rod is in contact before its middle has passed anything.
        Some(from_m) if gap_m <= travel_m && travel_m > 0.5 * radius_m => {
            advance(solid, from_m, to_m, travel_m, radius_m, search_m, in_the_end)
        }
        _ => in_the_end,
    };
    Swept { touch, gap_m: Some(gap_m.max(0.0)) }
}

/// The same for a rod that moves fast, and whose touch in the end is known.
fn advance(
    solid: &impl Solid,
    from_m: [DVec3; 2],
    to_m: [DVec3; 2],
    travel_m: f64,
    radius_m: f64,
    search_m: f64,
    in_the_end: Option<SweptTouch>,
) -> Option<SweptTouch> {
    let mut share = 0.0;
    let mut first: Option<Near> = None;
    for _ in 0..MOST_LOOKS {
        let ends_m = [from_m[0].lerp(to_m[0], share), from_m[1].lerp(to_m[1], share)];
        let search_m = if share == 0.0 { search_m } else { 0.0 };
        let Some(near) = solid.nearest(ends_m, radius_m + travel_m * (1.0 - share) + search_m) else {
            return in_the_end;
        };
        let gap_m = near.height_m - radius_m;
        if gap_m <= TOUCH_M {
            first = Some(near);
            break;
        }
        share += gap_m / travel_m.max(1e-12);
        if share > 1.0 {
            return in_the_end;
        }
        // As near as that it touches, whether or not the looks are used up.
        first = Some(near);
    }
    let first = first?;
    // Where the place on it that touched first is in the end, against the surface that it met.
    let length_m = from_m[0].distance(from_m[1]);
    let begun_m = [from_m[0].lerp(to_m[0], share), from_m[1].lerp(to_m[1], share)];
    let along = if length_m > 0.0 { begun_m[0].distance(first.on_segment_m) / length_m } else { 0.0 };
    let end_m = to_m[0].lerp(to_m[1], along.clamp(0.0, 1.0));
    let depth_m = radius_m - first.normal.dot(end_m - first.point_m);
    // What is nearest in the end says more, where it is still the same wall: behind that there may be others.
    let is_same = |end: &SweptTouch| {
        end.near.normal.dot(first.normal) > 0.5 && (end.depth_m - depth_m).abs() <= radius_m + 0.5 * travel_m
    };
    match in_the_end.filter(|end| is_same(end) || depth_m <= 0.0) {
        Some(end) => Some(SweptTouch { share, ..end }),
        None => (depth_m > 0.0).then_some(SweptTouch { near: first, depth_m, share }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::organ::SurfacePoint;
    use bevy::math::Vec2;
    use proptest::prelude::*;

    const MATTER: ContactMatter =
        ContactMatter::Organ { point: SurfacePoint { face: 0, barycentric: DVec3::X }, uv: Vec2::ZERO };

    /// A wall of a thickness across x, solid from 0 on.
    struct Wall {
        thickness_m: f64,
    }

    impl Solid for Wall {
        fn nearest(&self, ends_m: [DVec3; 2], max_distance_m: f64) -> Option<Near> {
            let middle = 0.5 * self.thickness_m;
            // Of both ends the one that is nearest to the wall, or deepest in it.
            let height = |at: DVec3| (at.x - middle).abs() - middle;
            let on_segment_m = if height(ends_m[1]) < height(ends_m[0]) { ends_m[1] } else { ends_m[0] };
            let height_m = height(on_segment_m);
            let normal = if on_segment_m.x > middle { DVec3::X } else { DVec3::NEG_X };
            let point_m = on_segment_m - normal * height_m;
            (height_m.abs() <= max_distance_m).then_some(Near {
                height_m,
                point_m,
                on_segment_m,
                normal,
                matter: MATTER,
            })
        }
    }

    proptest! {
        #[test]
        fn no_ball_passes_a_wall_without_touching_it(
            radius_mm in 0.1..5.0_f64,
            thickness_mm in 0.01..20.0_f64,
            start_mm in -500.0..-6.0_f64,
            way_mm in 0.0..1000.0_f64,
            aside in -1.0..1.0_f64,
        ) {
            let wall = Wall { thickness_m: thickness_mm * 1e-3 };
            let from = DVec3::new(start_mm, 0.0, 0.0) * 1e-3;
            let to = from + DVec3::new(way_mm, aside * way_mm, 0.0) * 1e-3;
            let touched = sweep(&wall, Some([from; 2]), [to; 2], radius_mm * 1e-3, 0.0).touch;
            let reaches_mm = start_mm + way_mm + radius_mm;
            if reaches_mm < -0.01 {
                prop_assert_eq!(touched, None);
            } else if reaches_mm > 0.01 {
                let touch = touched.expect("the wall is in the way");
                prop_assert!(touch.near.normal == DVec3::NEG_X || reaches_mm > 0.5 * thickness_mm);
                let is_slow = way_mm.hypot(aside * way_mm) <= 0.5 * radius_mm;
                prop_assert!(is_slow || (touch.depth_m * 1e3 - reaches_mm).abs() < 0.01, "{} {reaches_mm}", touch.depth_m * 1e3);
                let share = (-radius_mm - start_mm) / way_mm;
                prop_assert!((touch.share - share).abs() < 1e-3 || way_mm <= 0.6 * radius_mm);
            }
        }

        #[test]
        fn what_lies_in_a_body_stays_in_it(depth_mm in 0.0..9.0_f64, way_mm in -1.0..1.0_f64) {
            let wall = Wall { thickness_m: 0.02 };
            let at = |x_mm: f64| [DVec3::new(x_mm * 1e-3, 0.0, 0.0); 2];
            let touch = sweep(&wall, Some(at(depth_mm)), at(depth_mm + way_mm), 1e-3, 0.01).touch.expect("in the wall");
            let expected_mm = depth_mm + way_mm + 1.0;
            prop_assert!((touch.depth_m * 1e3 - expected_mm).abs() < 1e-6, "{} {expected_mm}", touch.depth_m * 1e3);
            prop_assert_eq!(touch.share, 0.0);
        }
    }
}
