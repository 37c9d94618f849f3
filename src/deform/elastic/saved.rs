//! Bodies as scenes save them: what they are made of, and not how they move.

use super::error::ElasticError;
use super::{ElasticBody, ElasticCell, ElasticTissue};
use crate::deform::lattice::{DeformLattice, SavedTree};
use glam::{Affine3A, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What an [`ElasticBody`] is made of.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SavedBody {
    substeps: u32,
    drag_per_s: f32,
    rests_under_m_per_s2: Vec3,
    publishes: bool,
    body_from_box: Affine3A,
    tree: SavedTree,
    /// Each tissue once.
    tissues: Vec<ElasticTissue>,
    /// Number of its tissue and share of it, for each cell.
    cells: Vec<(usize, f32)>,
    pinned: Vec<usize>,
}

impl From<ElasticBody> for SavedBody {
    fn from(body: ElasticBody) -> Self {
        let (mut tissues, mut numbers) = (Vec::new(), BTreeMap::new());
        let cells = (0..body.tree().patches().len()).map(|number| {
            let ElasticCell { tissue, fill } = body.cell(number);
            let number = *numbers.entry(tissue.numbers().map(f32::to_bits)).or_insert_with(|| {
                tissues.push(tissue);
                tissues.len() - 1
            });
            (number, fill)
        });
        let cells = cells.collect();
        Self {
            substeps: body.substeps,
            drag_per_s: body.drag_per_s,
            rests_under_m_per_s2: body.rests_under_m_per_s2,
            publishes: body.publishes,
            body_from_box: body.body_from_box(),
            tree: body.tree().into(),
            tissues,
            cells,
            pinned: (0..body.tree().vertex_count())
                .filter(|&vertex| body.is_pinned(vertex) && !body.tree().is_constrained(vertex))
                .collect(),
        }
    }
}

impl TryFrom<SavedBody> for ElasticBody {
    type Error = ElasticError;

    fn try_from(saved: SavedBody) -> Result<Self, ElasticError> {
        let lattice = DeformLattice::over_tree(saved.body_from_box, saved.tree.try_into()?)?;
        let expected = lattice.tree().patches().len();
        if saved.cells.len() != expected {
            return Err(ElasticError::WrongCells { found: saved.cells.len(), expected });
        }
        let mut cells = Vec::with_capacity(expected);
        for (cell, &(number, fill)) in saved.cells.iter().enumerate() {
            let &tissue = saved.tissues.get(number).ok_or(ElasticError::NoTissue { cell, number })?;
            cells.push(ElasticCell { tissue, fill });
        }
        // Asked in the order of the patches.
        let mut cells = cells.into_iter();
        let empty = ElasticCell { tissue: ElasticTissue::default(), fill: 0.0 };
        let mut body = Self::new(&lattice, |_| cells.next().unwrap_or(empty))?;
        for vertex in saved.pinned {
            body.pin(vertex, true)?;
        }
        body.substeps = saved.substeps;
        body.drag_per_s = saved.drag_per_s;
        body.rests_under_m_per_s2 = saved.rests_under_m_per_s2;
        body.publishes = saved.publishes;
        Ok(body)
    }
}
