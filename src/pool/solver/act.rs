//! Sources act on the fluid.

use super::field::{FRAME, Field, rows_at_once};
use super::places::Places;
use crate::pool::source::{FLOW_REACH, FluidSource, SOURCE_REACH, StepAmounts};
use crate::pool::{PoolGrid, StirNoise};
use glam::{UVec2, Vec2};
use rayon::prelude::*;

/// Cells (and one more, for sides) that a source reaches: from the first to before the second.
fn reached(grid: &PoolGrid, source: &FluidSource, radii: f32) -> [UVec2; 2] {
    let reach = Vec2::splat(source.radius_m * radii);
    let most = grid.size() + 1;
    let cell = |place_m: Vec2| grid.cell_from_pool(place_m).clamp(Vec2::ZERO, most.as_vec2());
    [cell(source.place_m - reach).floor().as_uvec2(), (cell(source.place_m + reach).ceil().as_uvec2() + 1).min(most)]
}

/// Adds to the velocities through sides between wet cells what a function of the offset from the source and of the place says.
fn add_velocity(
    velocity: &mut [Field; 2],
    grid: &PoolGrid,
    places: &Places,
    source: &FluidSource,
    radii: f32,
    of: impl Fn(Vec2, Vec2) -> Vec2 + Sync,
) {
    let [low, high] = reached(grid, source, radii);
    let half_m = 0.5 * grid.cell_m();
    let (columns, rows) = (low.x as usize..high.x as usize, (high.y - low.y) as usize);
    for (axis, (field, open)) in velocity.iter_mut().zip([&places.open_x, &places.open_y]).enumerate() {
        let in_reach = field.rows_mut().enumerate().skip(low.y as usize).take(rows);
        in_reach.with_min_len(rows_at_once(columns.len().max(1))).for_each(|(y, row)| {
            let open = open.row(y as isize);
            // Open sides lie in spans.
            let wet = places.spans.of_row(y).iter();
            for x in wet.flat_map(|span| span.start.max(columns.start)..span.end.min(columns.end)) {
                if open[FRAME + x] > 0.0 {
                    let mut place_m = grid.pool_from_cell(UVec2::new(x as u32, y as u32));
                    place_m[axis] -= half_m;
                    row[FRAME + x] += of(place_m - source.place_m, place_m)[axis];
                }
            }
        });
    }
}

/// Before the pressure: jets and burrs.
pub(super) fn push(
    velocity: &mut [Field; 2],
    grid: &PoolGrid,
    places: &Places,
    source: &FluidSource,
    noise: &StirNoise,
) {
    if source.push_m_s == Vec2::ZERO && source.stir_m_s == 0.0 {
        return;
    }
    add_velocity(velocity, grid, places, source, SOURCE_REACH, |offset_m, place_m| {
        let weight = source.weight(offset_m);
        if weight == 0.0 || source.stir_m_s == 0.0 {
            return weight * source.push_m_s;
        }
        weight * (source.push_m_s + source.stir_m_s * noise.at(place_m + source.stir_offset_m))
    });
}

/// After the pressure: what flows in and out, which a pressure without sources would take away.
pub(super) fn flow(velocity: &mut [Field; 2], grid: &PoolGrid, places: &Places, source: &FluidSource) {
    if source.flow_m2_s != 0.0 {
        add_velocity(velocity, grid, places, source, FLOW_REACH, |offset_m, _| source.flow_m_s(offset_m));
    }
}

/// Whether a source brings or takes away anything.
pub(super) fn dissolves(source: &FluidSource) -> bool {
    source.clear > 0.0 || source.amount != [0.0; 2]
}

/// What a source brings is shared out over the wet cells by its weights, so that walls do not change the amount.
pub(super) fn dissolve(
    dissolved: &mut [Field; 2],
    grid: &PoolGrid,
    places: &Places,
    source: &FluidSource,
    amounts: &mut StepAmounts,
) {
    let weights = weight_sum(grid, places, source);
    if weights <= 0.0 {
        return;
    }
    let [low, high] = reached(grid, source, SOURCE_REACH);
    for y in low.y..high.y {
        for x in low.x..high.x {
            let cell = UVec2::new(x, y);
            if places.wet.at(cell) == 0.0 {
                continue;
            }
            let weight = source.weight(grid.pool_from_cell(cell) - source.place_m);
            for (what, field) in dissolved.iter_mut().enumerate() {
                let share = field.at_mut(cell);
                let left = *share * (1.0 - (source.clear * weight).clamp(0.0, 1.0));
                let after = (left + source.amount[what] * weight / weights).clamp(0.0, 1.0);
                amounts.cleared[what] += f64::from(*share - left);
                amounts.brought[what] += f64::from(after - left);
                *share = after;
            }
        }
    }
}

/// Sum of a source's weights over the wet cells.
pub(super) fn weight_sum(grid: &PoolGrid, places: &Places, source: &FluidSource) -> f32 {
    let [low, high] = reached(grid, source, SOURCE_REACH);
    let mut sum = 0.0;
    for y in low.y..high.y {
        for x in low.x..high.x {
            let cell = UVec2::new(x, y);
            if places.wet.at(cell) > 0.0 {
                sum += source.weight(grid.pool_from_cell(cell) - source.place_m);
            }
        }
    }
    sum
}
