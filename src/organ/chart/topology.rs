//! Whether a surface is a sphere as far as its connections go.

use super::ChartError;
use crate::organ::mesh::SurfaceMesh;

/// Accepts closed, consistently oriented, connected manifolds of genus 0 and says what is wrong with others.
pub(super) fn check_sphere(mesh: &SurfaceMesh) -> Result<(), ChartError> {
    let count = mesh.positions_m.len();
    if mesh.triangles.is_empty() {
        return Err(ChartError::Empty);
    }
    if let Some(vertex) = mesh.positions_m.iter().position(|position| !position.is_finite()) {
        return Err(ChartError::NotFinite { vertex: vertex as u32 });
    }
    for (face, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        let face = face as u32;
        if let Some(vertex) = [a, b, c].into_iter().find(|&vertex| vertex as usize >= count) {
            return Err(ChartError::NoSuchVertex { face, vertex });
        }
        if a == b || b == c || c == a {
            return Err(ChartError::RepeatedCorner { face });
        }
    }
    let mut edges: Vec<(u32, u32)> = mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    edges.sort_unstable();
    if let Some(twice) = edges.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(ChartError::NotManifold { edge: [twice[0].0, twice[0].1] });
    }
    if let Some(&(a, b)) = edges.iter().find(|&&(a, b)| edges.binary_search(&(b, a)).is_err()) {
        return Err(ChartError::Open { edge: [a, b] });
    }
    let parts = check_vertices(mesh)?;
    if parts > 1 {
        return Err(ChartError::Parts { count: parts });
    }
    let euler = count as i64 - (edges.len() / 2) as i64 + mesh.triangles.len() as i64;
    if euler != 2 {
        return Err(ChartError::Genus { genus: (2 - euler) / 2 });
    }
    Ok(())
}

/// Every vertex must have one closed fan of faces; counts the connected parts.
fn check_vertices(mesh: &SurfaceMesh) -> Result<usize, ChartError> {
    let neighbours = mesh.neighbours();
    let count = mesh.positions_m.len();
    let mut uses = vec![0usize; count];
    let mut first = vec![None; count];
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        for &vertex in triangle {
            uses[vertex as usize] += 1;
            first[vertex as usize].get_or_insert(face as u32);
        }
    }
    for vertex in 0..count as u32 {
        let Some(start) = first[vertex as usize] else {
            return Err(ChartError::UnusedVertex { vertex });
        };
        let (mut face, mut fan) = (start, 0);
        loop {
            let corner = mesh.triangles[face as usize].iter().position(|&other| other == vertex).unwrap_or(0);
            face = neighbours[face as usize][corner];
            fan += 1;
            if face == start || fan > uses[vertex as usize] {
                break;
            }
        }
        if fan != uses[vertex as usize] {
            return Err(ChartError::PinchedVertex { vertex });
        }
    }
    let mut seen = vec![false; mesh.triangles.len()];
    let mut parts = 0;
    for start in 0..mesh.triangles.len() {
        if seen[start] {
            continue;
        }
        parts += 1;
        seen[start] = true;
        let mut open = vec![start];
        while let Some(face) = open.pop() {
            for neighbour in neighbours[face] {
                let neighbour = neighbour as usize;
                if !std::mem::replace(&mut seen[neighbour], true) {
                    open.push(neighbour);
                }
            }
        }
    }
    Ok(parts)
}
