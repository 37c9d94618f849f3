//! One tile of the heat map, warm or burnt.

use super::conductance::{Conductances, Stage};
use super::metrics::{Metrics, PADDED, Padded, SIDE};
use super::settings::HeatSettings;
use crate::reactions::burn::BurnRamp;
use crate::reactions::texels::TexelRect;

/// Dose at which a texel takes no more, J/mm2; keeps sums finite.
const MOST_DOSE_J_PER_MM2: f32 = 1e6;

/// Rise that counts as none, kelvin: conduction would otherwise fill tiles with numbers so small that the processor
/// takes a hundred times as long for them.
const LEAST_RISE_K: f32 = 1e-9;

/// What a tile has received for good.
#[derive(Clone, Debug)]
pub(super) struct Burn {
    /// Dose of each texel, J/mm2.
    pub dose_j_per_mm2: [[f32; SIDE]; SIDE],
    /// Look of each texel when it was last asked for.
    pub looks: [[u8; SIDE]; SIDE],
    /// Whether all that is or was burnt is to be told again.
    pub is_forgotten: bool,
    /// Whether doses were written since then.
    pub is_changed: bool,
}

impl Burn {
    fn none() -> Box<Self> {
        Box::new(Self {
            dose_j_per_mm2: [[0.0; SIDE]; SIDE],
            looks: [[0; SIDE]; SIDE],
            is_forgotten: false,
            is_changed: false,
        })
    }

    /// Takes the present looks; the texels of the tile that look otherwise than before.
    pub fn update_looks(&mut self, ramp: &BurnRamp) -> TexelRect {
        self.is_changed = false;
        let is_forgotten = std::mem::take(&mut self.is_forgotten);
        let mut changed = TexelRect::default();
        for (y, (doses, looks)) in self.dose_j_per_mm2.iter().zip(&mut self.looks).enumerate() {
            let new: [u8; SIDE] = std::array::from_fn(|x| ramp.index(doses[x]));
            let differs = |&x: &usize| new[x] != looks[x] || is_forgotten && looks[x] > 0;
            let Some(first) = (0..SIDE).find(differs) else { continue };
            let first = first as u32;
            let last = (0..SIDE).rfind(differs).unwrap_or(0) as u32;
            changed = changed.union(TexelRect { x: first, y: y as u32, width: last + 1 - first, height: 1 });
            *looks = new;
        }
        changed
    }

    /// Whether there is anything to remember.
    pub fn is_needed(&self) -> bool {
        self.is_changed
            || self.dose_j_per_mm2.iter().flatten().any(|&dose| dose > 0.0)
            || self.looks.iter().flatten().any(|&look| look > 0)
    }
}

/// A tile with heat in it.
#[derive(Clone, Debug)]
pub(super) struct HotTile {
    /// Column and row of tiles.
    pub place: (u32, u32),
    pub metrics: Box<Metrics>,
    pub conductances: Box<Conductances>,
    /// Texels that share a temperature, by row.
    pub texels_per_cell: [u32; SIDE],
    /// Rise over the body, kelvin; the ring about the tile is not in use.
    rise_k: Box<Padded>,
    /// Rise of the tile and of its neighbours' texels about it at the last stage of conduction, and at the one before.
    last_k: Box<Padded>,
    before_k: Box<Padded>,
    /// Where the next stage goes.
    next_k: Box<Padded>,
    pub burn: Option<Box<Burn>>,
    /// Which surface the metrics are of.
    pub surface_generation: u64,
    /// Whether a neighbour became warm or cold, or the metrics changed, since the conductances were computed.
    pub is_stale: bool,
}

impl HotTile {
    pub fn new(
        place: (u32, u32),
        metrics: Box<Metrics>,
        texels_per_cell: [u32; SIDE],
        burn: Option<Box<Burn>>,
        surface_generation: u64,
    ) -> Self {
        Self {
            place,
            metrics,
            conductances: Conductances::zero(),
            texels_per_cell,
            rise_k: Box::new([[0.0; PADDED]; PADDED]),
            last_k: Box::new([[0.0; PADDED]; PADDED]),
            before_k: Box::new([[0.0; PADDED]; PADDED]),
            next_k: Box::new([[0.0; PADDED]; PADDED]),
            burn,
            surface_generation,
            is_stale: true,
        }
    }

    /// Rise of a texel of the tile, kelvin. A sharp edge may have left an undershoot.
    pub fn rise_k(&self, x: u32, y: u32) -> f32 {
        self.rise_k[y as usize + 1][x as usize + 1]
    }

    /// Area of a texel of the tile, square metres.
    pub fn area_m2(&self, x: usize, y: usize) -> f32 {
        self.metrics.area_m2[y + 1][x + 1]
    }

    /// Warms a texel by `added_k` and adds to its dose what arrives above the threshold. Returns the kelvins that do
    /// not stay, beyond the ceiling.
    pub fn heat(&mut self, (x, y): (usize, usize), added_k: f64, settings: &HeatSettings) -> f64 {
        let rise_k = &mut self.rise_k[y + 1][x + 1];
        let (before, threshold) = (f64::from(*rise_k), settings.threshold_rise_k);
        let reached = before + added_k;
        let above_k = reached.max(threshold) - before.max(threshold);
        if above_k > 0.0 {
            let burn = self.burn.get_or_insert_with(Burn::none);
            burn.is_changed = true;
            let dose = &mut burn.dose_j_per_mm2[y][x];
            *dose = (*dose + (above_k * settings.areal_capacity_j_per_m2_k() * 1e-6) as f32).min(MOST_DOSE_J_PER_MM2);
        }
        // Tissue that is hotter than the ceiling already (the setting may have been lowered) is not cooled by heating.
        let kept = reached.min(settings.ceiling_rise_k.max(before));
        *rise_k = kept as f32;
        reached - kept
    }

    /// Copies what a neighbour has along the common side or corner into the ring; `dx` and `dy` say where it lies.
    pub fn take_ring(&mut self, neighbour: &Self, (dx, dy): (i32, i32)) {
        // From where and how many, in padded texels, and where to.
        let span = |d: i32| match d {
            -1 => (SIDE, 0, 1),
            0 => (1, 1, SIDE),
            _ => (1, SIDE + 1, 1),
        };
        let ((from_x, to_x, width), (from_y, to_y, height)) = (span(dx), span(dy));
        for k in 0..height {
            let source = &neighbour.last_k[from_y + k][from_x..from_x + width];
            self.last_k[to_y + k][to_x..to_x + width].copy_from_slice(source);
        }
    }

    /// Starts a step of conduction from the present temperatures.
    pub fn start(&mut self) {
        *self.last_k = *self.rise_k;
        self.join_cells();
    }

    /// One stage of conduction within the tile and from its ring.
    pub fn conduct(&mut self, stage: Stage) {
        self.conductances.conduct(&self.last_k, &self.before_k, &mut self.next_k, stage);
        std::mem::swap(&mut self.before_k, &mut self.last_k);
        std::mem::swap(&mut self.last_k, &mut self.next_k);
        self.join_cells();
    }

    /// Gives the texels of each cell one temperature, where cells lie within the tile.
    fn join_cells(&mut self) {
        for y in 0..SIDE {
            let count = self.texels_per_cell[y] as usize;
            if (2..=SIDE).contains(&count) {
                let (areas_m2, last_k) = (&self.metrics.area_m2[y + 1], &mut self.last_k[y + 1]);
                for start in (1..=SIDE).step_by(count) {
                    let cell = start..start + count;
                    let mean_k = Mean::default().with(&areas_m2[cell.clone()], &last_k[cell.clone()]);
                    mean_k.fill(&areas_m2[cell.clone()], &mut last_k[cell]);
                }
            }
        }
    }

    /// Adds a row of the tile to the mean of a cell that reaches over tiles.
    pub fn add_row(&self, y: usize, mean: Mean) -> Mean {
        mean.with(&self.metrics.area_m2[y + 1][1..=SIDE], &self.last_k[y + 1][1..=SIDE])
    }

    /// Gives a row of the tile the mean of its cell.
    pub fn fill_row(&mut self, y: usize, mean: Mean) {
        mean.fill(&self.metrics.area_m2[y + 1][1..=SIDE], &mut self.last_k[y + 1][1..=SIDE]);
    }

    /// Adds conducted heat above the threshold to the dose, lets the tile cool and makes the new temperatures the
    /// present ones.
    pub fn settle(&mut self, settings: &HeatSettings, kept_share: f32) {
        let threshold_k = settings.threshold_rise_k as f32;
        let warmest_k = warmest(self.last_k[1..=SIDE].iter().map(inner));
        if warmest_k > threshold_k {
            let dose_per_k = (settings.areal_capacity_j_per_m2_k() * 1e-6) as f32;
            let burn = self.burn.get_or_insert_with(Burn::none);
            burn.is_changed = true;
            for (y, doses) in burn.dose_j_per_mm2.iter_mut().enumerate() {
                let (before, after) = (inner(&self.rise_k[y + 1]), inner(&self.last_k[y + 1]));
                for ((dose, &before), &after) in doses.iter_mut().zip(before).zip(after) {
                    let above_k = (after.max(threshold_k) - before.max(threshold_k)).max(0.0);
                    *dose = (*dose + dose_per_k * above_k).min(MOST_DOSE_J_PER_MM2);
                }
            }
        }
        for row in &mut self.last_k[1..=SIDE] {
            for rise_k in &mut row[1..=SIDE] {
                let kept_k = *rise_k * kept_share;
                *rise_k = if kept_k.abs() > LEAST_RISE_K { kept_k } else { 0.0 };
            }
        }
        *self.rise_k = *self.last_k;
    }

    /// The greatest rise, kelvin.
    pub fn warmest_k(&self) -> f32 {
        warmest(self.rise_k[1..=SIDE].iter().map(inner))
    }

    /// The greatest rise along the side or in the corner towards a neighbour, kelvin.
    pub fn warmest_towards_k(&self, (dx, dy): (i32, i32)) -> f32 {
        let span = |d: i32| match d {
            -1 => 1..=1,
            0 => 1..=SIDE,
            _ => SIDE..=SIDE,
        };
        warmest(self.rise_k[span(dy)].iter().map(|row| &row[span(dx)]))
    }

    /// The greatest rise in a row, kelvin.
    pub fn warmest_in_row_k(&self, y: usize) -> f32 {
        warmest(std::iter::once(&self.rise_k[y + 1][1..=SIDE]))
    }

    /// Heat in it over capacity per area, K m2.
    pub fn heat_k_m2(&self) -> f64 {
        let rows = self.metrics.area_m2[1..=SIDE].iter().zip(&self.rise_k[1..=SIDE]);
        rows.flat_map(|(areas, rises)| inner(areas).iter().zip(inner(rises)))
            .map(|(&area_m2, &rise_k)| f64::from(area_m2) * f64::from(rise_k))
            .sum()
    }
}

/// Mean temperature of texels, weighted by area.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mean {
    area_m2: f64,
    heat_k_m2: f64,
}

impl Mean {
    fn with(mut self, areas_m2: &[f32], rises_k: &[f32]) -> Self {
        for (&area_m2, &rise_k) in areas_m2.iter().zip(rises_k) {
            self.area_m2 += f64::from(area_m2);
            self.heat_k_m2 += f64::from(area_m2) * f64::from(rise_k);
        }
        self
    }

    /// Texels without area keep what they have.
    fn fill(self, areas_m2: &[f32], rises_k: &mut [f32]) {
        let mean_k = (self.heat_k_m2 / self.area_m2) as f32;
        for (&area_m2, rise_k) in areas_m2.iter().zip(rises_k) {
            if area_m2 > 0.0 {
                *rise_k = mean_k;
            }
        }
    }
}

/// A row without the neighbours' texels at its ends.
fn inner(row: &[f32; PADDED]) -> &[f32] {
    &row[1..=SIDE]
}

/// Eight maxima side by side: a single one would wait for itself at every texel.
fn warmest<'a>(rows: impl Iterator<Item = &'a [f32]>) -> f32 {
    let mut lanes = [0.0f32; 8];
    for row in rows {
        for chunk in row.chunks(8) {
            for (lane, &value) in lanes.iter_mut().zip(chunk) {
                *lane = lane.max(value);
            }
        }
    }
    lanes.into_iter().fold(0.0, f32::max)
}
