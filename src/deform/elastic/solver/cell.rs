//! What a cell does to its corners.
//!
//! The displacements of eight corners are a sum of eight patterns, products of the signs of the corner's x, y and z: one moves the
//! cell, three deform it evenly (they make up the deformation gradient `F`), and four bend and twist it. With `R` the rotation
//! nearest to `F`, the cell's energy is
//!
//! ```text
//! V * (mu |F - R|^2 + lambda/2 (det F - 1)^2)  +  what bending and twisting cost
//! ```
//!
//! The first part and the bending are linear in the displacements while `R` is held: all seven patterns of a cell are
//! relaxed together by a matrix that is made once. The second part is one constraint more.

use super::lanes::{LANES, Lanes, Lanes3};

/// Patterns of a cell besides its movement: x, y, z, xy, yz, zx, xyz.
pub(super) const PATTERNS: usize = 7;

/// Sign of a pattern at a corner; bit `a` of the corner is set on the upper side along axis `a`.
pub(super) fn sign(pattern: usize, corner: usize) -> f64 {
    let along = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
    match pattern {
        0..=2 => along(pattern),
        3 => along(0) * along(1),
        4 => along(1) * along(2),
        5 => along(2) * along(0),
        _ => along(0) * along(1) * along(2),
    }
}

/// Place of an entry in the upper half of a symmetric matrix of [`PATTERNS`] rows.
pub(super) const fn entry(row: usize, column: usize) -> usize {
    let (row, column) = if row < column { (row, column) } else { (column, row) };
    row * PATTERNS - row * (row + 1) / 2 + column
}

/// Share of a cell's mobility that counts when it is relaxed, from the ratio of mobility to softness.
///
/// Soft cells go a little further than they had to if they were alone, because their neighbours take half of that back after them:
/// otherwise tissue would come out softer than it is by half that ratio. For stiff ones, where many cells have to agree, that would
/// be too much. They go at most 1.15 times as far, well below the 2 at which over-relaxation ends.
pub(super) fn counted(mobility_over_softness: f64) -> f64 {
    1.0 - 0.5 / (1.0 + mobility_over_softness * mobility_over_softness)
}

/// A node in the solver's space, metres from where it rests; and the inverse of its mass, 1/kg.
pub(super) type Node = [f32; 4];

/// Eight cells that share no node, and what is known of them beforehand.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Their patches; `u32::MAX` where there are fewer than eight.
    pub numbers: [u32; LANES],
    /// Which nodes their corners are.
    pub corners: [[u32; LANES]; 8],
    /// Where the corners' corrections go: to the nodes themselves, or to a place from where it is handed to those that a constrained
    /// node follows.
    pub targets: [[u32; LANES]; 8],
    /// Corrections of the patterns from what they lack, upper half.
    pub response: [Lanes; 28],
    /// Side lengths, halved, metres; and their inverses.
    pub half_side: [Lanes; 3],
    pub per_half_side: [Lanes; 3],
    /// What the even patterns lack after a correction, per correction.
    pub left: [Lanes; 3],
    /// How much further than to its goal a correction goes.
    pub beyond: Lanes,
    /// Mobility of the even patterns, upper half: xx, xy, xz, yy, yz, zz.
    pub mobility: [Lanes; 6],
    /// Softness of the volume, the share of the mobility that counts, and the least divisor.
    pub volume_softness: Lanes,
    pub volume_counted: Lanes,
    pub volume_floor: Lanes,
    /// Viscosity of even patterns (times the side's half squared) and of the others.
    pub viscosity: [Lanes; 5],
    /// Rotation of the cells: i, j, k, real.
    pub turn: [Lanes; 4],
    /// Constrained nodes among the corners.
    pub following: Vec<u32>,
}

/// Sums and differences of corners that give the eight patterns times 8: place 0 is the movement, then as [`sign`] has it.
#[inline(always)]
fn patterns(c: [Lanes; 8]) -> [Lanes; 8] {
    let (a0, a1, a2, a3) = (c[0] + c[1], c[2] + c[3], c[4] + c[5], c[6] + c[7]);
    let (d0, d1, d2, d3) = (c[1] - c[0], c[3] - c[2], c[5] - c[4], c[7] - c[6]);
    let (s0, s1, t0, t1) = (a0 + a1, a2 + a3, a1 - a0, a3 - a2);
    let (u0, u1, v0, v1) = (d0 + d1, d2 + d3, d1 - d0, d3 - d2);
    [s0 + s1, u0 + u1, t0 + t1, s1 - s0, v0 + v1, t1 - t0, u1 - u0, v1 - v0]
}

/// What the patterns sum up to at the corners.
#[inline(always)]
fn corners([x, y, z, xy, yz, zx, xyz]: [Lanes; PATTERNS]) -> [Lanes; 8] {
    let [a, b, c, d] = corners_of_side(-z, x - zx, y - yz, xy - xyz);
    let [e, f, g, h] = corners_of_side(z, x + zx, y + yz, xy + xyz);
    [a, b, c, d, e, f, g, h]
}

/// The same for four corners at one side along z.
#[inline(always)]
fn corners_of_side(base: Lanes, x: Lanes, y: Lanes, xy: Lanes) -> [Lanes; 4] {
    let (low, high) = (base - y, base + y);
    let (along_low, along_high) = (x - xy, x + xy);
    [low - along_low, low + along_low, high - along_high, high + along_high]
}

#[inline(always)]
fn gather(nodes: &[Node], of: &[[u32; LANES]; 8]) -> ([[Lanes; 8]; 3], [Lanes; 8]) {
    let mut axes = [[Lanes::ZERO; 8]; 3];
    let mut inverse_masses = [Lanes::ZERO; 8];
    for corner in 0..8 {
        let [a, b, c, d, e, f, g, h] = of[corner];
        let (a, b, c, d) = (nodes[a as usize], nodes[b as usize], nodes[c as usize], nodes[d as usize]);
        let (e, f, g, h) = (nodes[e as usize], nodes[f as usize], nodes[g as usize], nodes[h as usize]);
        axes[0][corner] = Lanes([a[0], b[0], c[0], d[0], e[0], f[0], g[0], h[0]]);
        axes[1][corner] = Lanes([a[1], b[1], c[1], d[1], e[1], f[1], g[1], h[1]]);
        axes[2][corner] = Lanes([a[2], b[2], c[2], d[2], e[2], f[2], g[2], h[2]]);
        inverse_masses[corner] = Lanes([a[3], b[3], c[3], d[3], e[3], f[3], g[3], h[3]]);
    }
    (axes, inverse_masses)
}

/// Columns of the rotation of a quaternion of length 1.
#[inline(always)]
fn columns([i, j, k, w]: [Lanes; 4]) -> [Lanes3; 3] {
    let (one, two) = (Lanes::splat(1.0), Lanes::splat(2.0));
    let (i2, j2, k2) = (i * two, j * two, k * two);
    let (ii, jj, kk, ij, jk, ki) = (i * i2, j * j2, k * k2, i * j2, j * k2, k * i2);
    let (wi, wj, wk) = (w * i2, w * j2, w * k2);
    [
        Lanes3 { x: one - (jj + kk), y: ij + wk, z: ki - wj },
        Lanes3 { x: ij - wk, y: one - (ii + kk), z: jk + wi },
        Lanes3 { x: ki + wj, y: jk - wi, z: one - (ii + jj) },
    ]
}

/// Brings a rotation closer to the one that is nearest to `F`, by a step of Newton's kind that is exact to second order where the
/// cell is hardly strained. Inverted cells are turned too, never mirrored.
#[inline(always)]
fn turn_towards(turn: [Lanes; 4], f: &[Lanes3; 3]) -> [Lanes; 4] {
    let r = columns(turn);
    let twist = r[0].cross(f[0]) + r[1].cross(f[1]) + r[2].cross(f[2]);
    let stretch = r[0].dot(f[0]) + r[1].dot(f[1]) + r[2].dot(f[2]);
    let size = (f[0].dot(f[0]) + f[1].dot(f[1]) + f[2].dot(f[2])).sqrt();
    // Half the angle is wanted, and two thirds of the trace is what a turn of an unstrained cell is divided by.
    let divisor = (stretch * Lanes::splat(4.0 / 3.0)).max(size + Lanes::splat(1e-6));
    let o = twist * (Lanes::splat(1.0) / divisor);
    let [i, j, k, w] = turn;
    let made = [
        i + (o.x * w + o.y * k - o.z * j),
        j + (o.y * w + o.z * i - o.x * k),
        k + (o.z * w + o.x * j - o.y * i),
        w - (o.x * i + o.y * j + o.z * k),
    ];
    let square = made[0] * made[0] + made[1] * made[1] + made[2] * made[2] + made[3] * made[3];
    let by = Lanes::splat(1.0) / square.sqrt();
    [made[0] * by, made[1] * by, made[2] * by, made[3] * by]
}

/// Gives corners their share of a correction of the patterns.
#[inline(always)]
fn scatter(nodes: &mut [Node], targets: &[[u32; LANES]; 8], by: &[Lanes3; PATTERNS], inverse_masses: &[Lanes; 8]) {
    // Spelled out: the compiler does not take the array's own `map` into functions for a certain processor.
    let [a, b, c, d, e, f, g] = *by;
    let x = corners([a.x, b.x, c.x, d.x, e.x, f.x, g.x]);
    let y = corners([a.y, b.y, c.y, d.y, e.y, f.y, g.y]);
    let z = corners([a.z, b.z, c.z, d.z, e.z, f.z, g.z]);
    let eighth = Lanes::splat(0.125);
    for corner in 0..8 {
        let mass = inverse_masses[corner] * eighth;
        let (x, y, z) = (x[corner] * mass, y[corner] * mass, z[corner] * mass);
        for lane in 0..LANES {
            let node = &mut nodes[targets[corner][lane] as usize];
            // Whole, so that it is one addition.
            let [a, b, c, d] = *node;
            *node = [a + x.0[lane], b + y.0[lane], c + z.0[lane], d + 0.0];
        }
    }
}

/// The patterns of eight cells.
#[inline(always)]
fn patterns_of(axes: &[[Lanes; 8]; 3]) -> [Lanes3; PATTERNS] {
    let [x, y, z] = [patterns(axes[0]), patterns(axes[1]), patterns(axes[2])];
    let eighth = Lanes::splat(0.125);
    let mut made = [Lanes3::ZERO; PATTERNS];
    for (n, pattern) in made.iter_mut().enumerate() {
        *pattern = Lanes3 { x: x[n + 1] * eighth, y: y[n + 1] * eighth, z: z[n + 1] * eighth };
    }
    made
}

/// Deformation gradient: column `b` is where the unit vector along axis `b` goes.
#[inline(always)]
fn gradient(p: &[Lanes3; PATTERNS], per_half_side: &[Lanes; 3]) -> [Lanes3; 3] {
    let one = Lanes::splat(1.0);
    let mut f = [p[0] * per_half_side[0], p[1] * per_half_side[1], p[2] * per_half_side[2]];
    f[0].x = f[0].x + one;
    f[1].y = f[1].y + one;
    f[2].z = f[2].z + one;
    f
}

/// Relaxes eight cells.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "rows and columns of a matrix")]
pub(super) fn relax(cells: &mut Cells, nodes: &mut [Node]) {
    let (axes, inverse_masses) = gather(nodes, &cells.corners);
    let p = patterns_of(&axes);
    let f = gradient(&p, &cells.per_half_side);
    cells.turn = turn_towards(cells.turn, &f);
    let r = columns(cells.turn);

    // What the patterns lack: the even ones that of a rotation, the others all.
    let one = Lanes::splat(1.0);
    let mut unturned = r;
    unturned[0].x = r[0].x - one;
    unturned[1].y = r[1].y - one;
    unturned[2].z = r[2].z - one;
    let mut lack = [Lanes3::ZERO; PATTERNS];
    for n in 0..3 {
        lack[n] = unturned[n] * cells.half_side[n] - p[n];
    }
    for n in 3..PATTERNS {
        lack[n] = Lanes3::ZERO - p[n];
    }
    let mut by = [Lanes3::ZERO; PATTERNS];
    for (row, by) in by.iter_mut().enumerate() {
        let mut sum = lack[0] * cells.response[entry(row, 0)];
        for (column, lack) in lack.iter().enumerate().skip(1) {
            sum = sum + *lack * cells.response[entry(row, column)];
        }
        *by = sum;
    }

    // The gradient after that, and its volume.
    let mut f = r;
    for n in 0..3 {
        let left = by[n] * cells.left[n] - lack[n] * cells.beyond;
        f[n] = r[n] - left * cells.per_half_side[n];
    }
    let cofactors = [f[1].cross(f[2]), f[2].cross(f[0]), f[0].cross(f[1])];
    let excess = f[0].dot(cofactors[0]) - one;
    let v = [
        cofactors[0] * cells.per_half_side[0],
        cofactors[1] * cells.per_half_side[1],
        cofactors[2] * cells.per_half_side[2],
    ];
    let m = &cells.mobility;
    let mixed = v[0].dot(v[1]) * m[1] + v[0].dot(v[2]) * m[2] + v[1].dot(v[2]) * m[4];
    let straight = v[0].dot(v[0]) * m[0] + v[1].dot(v[1]) * m[3] + v[2].dot(v[2]) * m[5];
    let divisor = ((straight + mixed + mixed) * cells.volume_counted).max(cells.volume_floor) + cells.volume_softness;
    // A cell that was blown up is not let implode at once.
    let by_volume = -(excess.min(Lanes::splat(2.0)).max(Lanes::splat(-2.0))) / divisor;
    for n in 0..3 {
        by[n] = by[n] + v[n] * by_volume;
    }
    scatter(nodes, &cells.targets, &by, &inverse_masses);
}

/// Slows down how eight cells are being strained, bent and twisted; not how they move and turn. Takes the nodes' velocities.
#[inline(always)]
pub(super) fn damp(cells: &mut Cells, velocities: &mut [Node]) {
    let (axes, inverse_masses) = gather(velocities, &cells.corners);
    let p = patterns_of(&axes);
    let r = columns(cells.turn);
    let rate = [p[0] * cells.per_half_side[0], p[1] * cells.per_half_side[1], p[2] * cells.per_half_side[2]];
    // The symmetric part of the rate in the cell's own axes: turning is no strain.
    let half = Lanes::splat(0.5);
    let (xx, yy, zz) = (r[0].dot(rate[0]), r[1].dot(rate[1]), r[2].dot(rate[2]));
    let xy = (r[0].dot(rate[1]) + r[1].dot(rate[0])) * half;
    let yz = (r[1].dot(rate[2]) + r[2].dot(rate[1])) * half;
    let zx = (r[2].dot(rate[0]) + r[0].dot(rate[2])) * half;
    let strained =
        [r[0] * xx + r[1] * xy + r[2] * zx, r[0] * xy + r[1] * yy + r[2] * yz, r[0] * zx + r[1] * yz + r[2] * zz];
    let mut by = [Lanes3::ZERO; PATTERNS];
    for n in 0..3 {
        by[n] = Lanes3::ZERO - strained[n] * (cells.per_half_side[n] * cells.viscosity[0]);
    }
    for n in 3..PATTERNS {
        by[n] = Lanes3::ZERO - p[n] * cells.viscosity[n - 2];
    }
    scatter(velocities, &cells.targets, &by, &inverse_masses);
}
