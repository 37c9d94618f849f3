// Flow in a pool on the GPU, shared by its kernels. Rust twins: `pool/solver` (the arithmetic), `pool/render/flow/uniform.rs`.
//
// Spaces: cell coordinates have the middle of cell (i, j) at integers; pool places are metres in the pool's plane. A place
// in memory ("place") is (y + 1) * stride + x + 4: four numbers on the left of each row and a row on each side stay 0,
// so that neighbours can be read without asking.
// Fields: `velocity` holds two numbers per cell, through its left and its lower side, metres per second; `dissolved` the
// shares of blood and dust; `pressure` one number.
// A kernel writes all cells of the tiles that are listed. What lies elsewhere stays 0.
#define_import_path bevy_surgery::pool_flow

struct FlowUniform {
    // Columns and rows.
    size: vec2<u32>,
    // Numbers from row to row; a multiple of 4.
    stride: u32,
    // The first so many tiles have no wall within reach.
    deep_tiles: u32,
    // All of them.
    tiles: u32,
    // Sources that push and stir: the first one, how many, and the first tile of those that they reach.
    first_pushing: u32,
    pushing: u32,
    push_tile: u32,
    // The same for those with flow, and those that dissolve or clear something.
    first_acting: u32,
    acting: u32,
    act_tile: u32,
    // Shares of blood and dust that are kept in the step.
    keep: vec2<f32>,
    cell_m: f32,
    // Cells that a velocity of 1 goes in a step.
    cells_per_velocity: f32,
    // Squares of the length over which a step blurs, square cells.
    viscosity: f32,
    diffusion: f32,
    noise_side: u32,
    noise_period_m: f32,
    // Height of the surface, millimetres, for a pressure of 1.
    mm_per_pressure: f32,
    // Blood counts as hiding what is below from this share on, and so much of dust does.
    hidden_from: f32,
    dust_hides: f32,
}

@group(0) @binding(0) var<uniform> flow: FlowUniform;
// Columns in the lower, rows in the upper 16 bits of a tile's first cell: deep ones first.
@group(0) @binding(1) var<storage, read> tiles: array<u32>;
// By place: the bits below, and cells to the nearest wall in the second byte.
@group(0) @binding(2) var<storage, read> mask: array<u32>;

const WET: u32 = 1u;
// Fluid on both sides of the left side, and of the lower one.
const OPEN_X: u32 = 2u;
const OPEN_Y: u32 = 4u;
// Fluid on at least one side of it.
const KNOWN_X: u32 = 8u;
const KNOWN_Y: u32 = 16u;

// Rows that an invocation of a kernel with 32 x 4 invocations per tile walks up.
const ROWS: u32 = 8u;

// First cell of a tile.
fn tile_cell(tile: u32) -> vec2<u32> {
    let corner = tiles[tile];
    return vec2(corner & 0xffffu, corner >> 16u);
}

fn place_of(cell: vec2<u32>) -> u32 {
    return (cell.y + 1u) * flow.stride + cell.x + 4u;
}

// Middle of a cell in the pool's plane.
fn pool_from_cell(cell: vec2<f32>) -> vec2<f32> {
    return (cell - (vec2<f32>(flow.size) - 1.0) * 0.5) * flow.cell_m;
}

// 1 where a mask has one of some bits.
fn has(bits: u32, wanted: u32) -> f32 {
    return select(0.0, 1.0, (bits & wanted) != 0u);
}
