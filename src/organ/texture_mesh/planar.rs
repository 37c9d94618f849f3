//! Texture meshes for organs that bring their own planar texture coordinates, borders and all.

use super::{
    super::{mesh::SurfaceMesh, sphere::SphereMesh},
    MOST_TRIANGLES, SkinMesh, TextureMesh, TextureMeshError, TextureMeshOptions, TextureMeshReport, check_chart,
    finish,
    overlay::{Cells, overlay},
};
use glam::{DVec2, DVec3};

/// Makes a texture mesh from a regular lattice of equilateral triangles in the plane of an organ's own texture
/// coordinates, and lays it over the geometric mesh.
///
/// `chart` holds the homogeneous directions `(u, v, 1)`, or `(u, -v, 1)` where the file mirrors, not normalised, so that straight lines in the
/// plane are great circles; faces that look the other way in the plane are refused. The lattice's edge in the plane is
/// the asked length divided by the mean stretch of the organ's coordinates, so the triangles are only as regular on the
/// surface as those coordinates are. Lattice triangles that touch no face are left out; parts of triangles off the
/// organ do not exist.
///
/// # Errors
/// [`TextureMeshError`] for senseless edge lengths, for an organ without area and for flipped faces.
pub fn build_planar(
    mesh: &SurfaceMesh,
    chart: &SphereMesh,
    options: &TextureMeshOptions,
) -> Result<(TextureMesh, SkinMesh, TextureMeshReport), TextureMeshError> {
    let edge_length_m = options.edge_length_for(mesh.area_m2())?;
    check_chart(mesh, chart)?;
    let flat = |vertex: u32| {
        let d = chart.directions[vertex as usize];
        DVec2::new(d.x, d.y) / d.z
    };
    if chart.directions.iter().any(|d| !(d.z > 0.0 && d.is_finite())) {
        return Err(TextureMeshError::InvalidChart);
    }
    let area_uv: f64 = chart
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(flat);
            0.5 * (b - a).perp_dot(c - a)
        })
        .sum();
    if area_uv.is_nan() || area_uv <= 0.0 {
        return Err(TextureMeshError::InvalidChart);
    }
    let edge_uv = edge_length_m * (area_uv / mesh.area_m2()).sqrt();
    let used = chart.triangles.iter().flatten().map(|&v| flat(v));
    let (low, high) = used.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let Some(lattice) = lattice(low, high, edge_uv) else {
        return Err(TextureMeshError::TooFine {
            edge_length_m: edge_length_m as f32,
            triangles: 2.0 * ((high - low) / edge_uv).element_product() / 0.75f64.sqrt(),
        });
    };
    let (texture, cells) = drop_unused(&lattice, overlay(chart, &lattice)?);
    let positions_m: Vec<DVec3> = mesh.positions_m.iter().map(|p| p.as_dvec3()).collect();
    Ok(finish(&positions_m, chart, texture, cells, edge_length_m, options))
}

/// An equilateral lattice over a rectangle and two cells beyond; `None` where that would be too many triangles.
fn lattice(low: DVec2, high: DVec2, edge: f64) -> Option<SphereMesh> {
    let row = edge * 0.75f64.sqrt();
    let columns = (high.x - low.x) / edge + 5.0;
    let rows = (high.y - low.y) / row + 4.0;
    // The lattice also covers what a concave organ leaves free.
    let triangles = columns * rows * 2.0;
    if !triangles.is_finite() || triangles > 8.0 * f64::from(MOST_TRIANGLES) {
        return None;
    }
    let (columns, rows) = (columns.ceil() as u32, rows.ceil() as u32);
    let mut directions = Vec::with_capacity(((columns + 1) * (rows + 1)) as usize);
    for j in 0..=rows {
        for i in 0..=columns {
            let shift = if j % 2 == 1 { 0.5 } else { 0.0 };
            let x = low.x + (f64::from(i) + shift - 2.25) * edge;
            let y = low.y + (f64::from(j) - 1.75) * row;
            directions.push(DVec3::new(x, y, 1.0));
        }
    }
    let at = |i: u32, j: u32| j * (columns + 1) + i;
    let mut triangles = Vec::with_capacity((2 * columns * rows) as usize);
    for j in 0..rows {
        for i in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
            if j % 2 == 0 {
                triangles.extend([[a, b, c], [b, d, c]]);
            } else {
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
    }
    Some(SphereMesh::new(directions, triangles))
}

/// Leaves out the triangles without a piece on the organ and the vertices that only they have.
fn drop_unused(lattice: &SphereMesh, mut cells: Cells) -> (SphereMesh, Cells) {
    let mut triangle_number = vec![u32::MAX; lattice.triangles.len()];
    let mut vertex_number = vec![u32::MAX; lattice.directions.len()];
    let mut triangles = Vec::new();
    let mut kept = Vec::new();
    // Cells are ordered by triangle, so the numbers keep the order.
    for cell in &mut cells.cells {
        let number = &mut triangle_number[cell.texture_triangle as usize];
        if *number == u32::MAX {
            *number = triangles.len() as u32;
            let triangle = lattice.triangles[cell.texture_triangle as usize];
            for vertex in triangle {
                if vertex_number[vertex as usize] == u32::MAX {
                    vertex_number[vertex as usize] = kept.len() as u32;
                    kept.push(vertex as usize);
                }
            }
            triangles.push(triangle.map(|v| vertex_number[v as usize]));
        }
        cell.texture_triangle = *number;
    }
    let first_texture = cells.geometric_vertices;
    let first_crossing = first_texture + cells.texture_vertices;
    let renumbered = |vertex: u32| {
        let vertex = vertex as usize;
        if vertex < first_texture {
            vertex as u32
        } else if vertex < first_crossing {
            first_texture as u32 + vertex_number[vertex - first_texture]
        } else {
            (vertex - cells.texture_vertices + kept.len()) as u32
        }
    };
    for cell in &mut cells.cells {
        for vertex in &mut cell.vertices[..cell.len] {
            *vertex = renumbered(*vertex);
        }
    }
    for edge in &mut cells.crossed_edges {
        *edge = edge.map(|v| vertex_number[v as usize]);
    }
    let pick = |from: usize| from + first_texture;
    cells.vertices = (0..first_texture)
        .chain(kept.iter().map(|&v| pick(v)))
        .chain(first_crossing..cells.vertices.len())
        .map(|v| cells.vertices[v])
        .collect();
    cells.directions = (0..first_texture)
        .chain(kept.iter().map(|&v| pick(v)))
        .chain(first_crossing..cells.directions.len())
        .map(|v| cells.directions[v])
        .collect();
    cells.texture_points = kept.iter().map(|&v| cells.texture_points[v]).collect();
    cells.texture_vertices = kept.len();
    let directions = kept.iter().map(|&v| lattice.directions[v]).collect();
    (SphereMesh::new(directions, triangles), cells)
}
