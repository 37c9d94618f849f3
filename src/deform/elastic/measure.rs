//! What is read off a body: strain and energy.

use super::solver::Solver;
use super::tissue::ElasticTissue;
use crate::deform::lattice::Tree;
use glam::{DMat3, DVec3};

/// Deformation gradient in the middle of a cell.
pub(super) fn gradient(tree: &Tree, solver: &Solver, box_sides_m: DVec3, number: usize) -> DMat3 {
    let sides_m = box_sides_m * tree.patches()[number].side();
    let mut made = DMat3::IDENTITY;
    for (corner, vertex) in tree.corners(number).into_iter().enumerate() {
        let by = solver.displacement(vertex).as_dvec3();
        for axis in 0..3 {
            let sign = if corner >> axis & 1 == 1 { 0.25 } else { -0.25 };
            *made.col_mut(axis) += by * (sign / sides_m[axis]);
        }
    }
    made
}

/// Greatest stretch in the middle of a cell.
pub(super) fn stretch(tree: &Tree, solver: &Solver, box_sides_m: DVec3, number: usize) -> f32 {
    let f = gradient(tree, solver, box_sides_m, number);
    let square = f.transpose() * f;
    // The greatest eigenvalue of a symmetric matrix that has none below 0.
    let mut along = DVec3::new(1.0, 0.97, 1.03);
    for _ in 0..60 {
        along = (square * along).normalize_or_zero();
    }
    (square * along).length().sqrt() as f32
}

/// Energy of cells that deform evenly and of moving nodes, joules.
pub(super) fn energy_j(tree: &Tree, solver: &Solver, cells: &[(ElasticTissue, f32)], box_sides_m: DVec3) -> f64 {
    let elastic: f64 = cells
        .iter()
        .enumerate()
        .map(|(number, (tissue, fill))| {
            let f = gradient(tree, solver, box_sides_m, number);
            let (mu, lambda) = tissue.lame_pa();
            let volume_m3 = (box_sides_m * tree.patches()[number].side()).element_product() * f64::from(*fill);
            let volume = f.determinant() - 1.0;
            volume_m3 * (mu * distance_squared(&f, &rotation(&f)) + 0.5 * lambda * volume * volume)
        })
        .sum();
    let kinetic: f64 = (0..tree.vertex_count())
        .map(|node| 0.5 * f64::from(solver.mass_kg(node)) * solver.velocity(node).as_dvec3().length_squared())
        .sum();
    elastic + kinetic
}

fn distance_squared(a: &DMat3, b: &DMat3) -> f64 {
    (0..3).map(|n| a.col(n).distance_squared(b.col(n))).sum()
}

/// The rotation nearest to a matrix that is not inverted, by Higham's iteration.
fn rotation(f: &DMat3) -> DMat3 {
    let mut made = *f;
    for _ in 0..30 {
        if made.determinant().abs() < 1e-12 {
            return DMat3::IDENTITY;
        }
        made = (made + made.inverse().transpose()) * 0.5;
    }
    made
}
