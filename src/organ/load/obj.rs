//! Wavefront OBJ. Material libraries are never opened.

use super::{check_counts, finite, malformed};
use crate::files::excerpt;
use crate::organ::clean::{RawMesh, Weld};
use crate::organ::error::MeshFault;
use glam::{Vec2, Vec3};

/// Reads all objects and groups, or the ones called `wanted`.
pub(super) fn read(bytes: &[u8], wanted: Option<&str>, weld: Weld) -> Result<RawMesh, MeshFault> {
    let text = String::from_utf8_lossy(bytes);
    let with_uvs = weld == Weld::ByPositionAndUv;
    let statements = check(&text, wanted, with_uvs)?;
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj_buf(&mut statements.as_bytes(), &options, |_| Ok(Default::default()))
        .map_err(|error| malformed("OBJ", error.to_string()))?;

    let mut raw = RawMesh { uvs: with_uvs.then(Vec::new), ..Default::default() };
    for model in &models {
        let mesh = &model.mesh;
        let position = |vertex: u32| Vec3::from_slice(&mesh.positions[3 * vertex as usize..][..3]);
        let first = raw.positions.len() as u32;
        match &mut raw.uvs {
            // One vertex per corner, since positions and texture coordinates are indexed apart; welding joins them.
            Some(uvs) => {
                raw.positions.extend(mesh.indices.iter().map(|&vertex| position(vertex)));
                uvs.extend(
                    mesh.texcoord_indices.iter().map(|&uv| Vec2::from_slice(&mesh.texcoords[2 * uv as usize..][..2])),
                );
                let faces = 0..mesh.indices.len() as u32 / 3;
                raw.triangles.extend(faces.map(|face| [0, 1, 2].map(|corner| first + 3 * face + corner)));
            }
            None => {
                raw.positions.extend((0..mesh.positions.len() as u32 / 3).map(position));
                raw.triangles.extend(mesh.indices.as_chunks().0.iter().map(|face: &[u32; 3]| face.map(|v| first + v)));
            }
        }
    }
    Ok(raw)
}

/// Checks every statement that matters and returns these alone, in their order.
///
/// tobj tells what is wrong but not where, reads polylines as faces, and makes up texture coordinates where a corner
/// has none; what comes out of here gives it no occasion to.
fn check(text: &str, wanted: Option<&str>, with_uvs: bool) -> Result<String, MeshFault> {
    let mut counts = Counts::default();
    let mut faces = 0;
    let mut names: Vec<&str> = Vec::new();
    let mut object = "";
    let mut inside = wanted.is_none();
    let mut was_inside = inside;
    let mut statements = String::new();
    for (index, line) in text.lines().enumerate() {
        let at = || format!("line {}", index + 1);
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let used = match keyword {
            "v" => {
                let [x, y, z] = numbers(&mut words).ok_or_else(|| malformed(at(), bad_line(line, "3 numbers")))?;
                finite(Vec3::new(x, y, z), at)?;
                counts.positions += 1;
                // Weights and colours may follow; neither is geometry.
                let end = words.next().map_or(line.len(), |fourth| fourth.as_ptr() as usize - line.as_ptr() as usize);
                statements.push_str(&line[..end]);
                statements.push('\n');
                false
            }
            "vt" if with_uvs => {
                let [u, v] = numbers(&mut words).ok_or_else(|| malformed(at(), bad_line(line, "2 numbers")))?;
                finite(Vec3::new(u, v, 0.0), at)?;
                counts.uvs += 1;
                true
            }
            "f" => {
                let mut corners = 0u64;
                for word in words {
                    let has_uv = counts.check_corner(word, at)?;
                    if inside && with_uvs && !has_uv {
                        return Err(MeshFault::NoUvs { place: at() });
                    }
                    corners += 1;
                }
                if corners < 3 {
                    return Err(malformed(at(), format!("a face with {corners} corner(s)")));
                }
                faces += corners - 2;
                check_counts(counts.positions, faces)?;
                inside
            }
            "o" | "g" => {
                let name = line.trim_start()[1..].trim();
                // A new object starts without a group; `g a b` is in both groups.
                let group = if keyword == "o" { "" } else { name };
                object = if keyword == "o" { name } else { object };
                let is_wanted =
                    |wanted| object == wanted || group == wanted || group.split_whitespace().any(|g| g == wanted);
                inside = wanted.is_none_or(is_wanted);
                was_inside |= inside;
                names.push(name);
                false
            }
            _ => false,
        };
        if line.trim_end().ends_with('\\') && matches!(keyword, "v" | "vt" | "f") {
            return Err(malformed(at(), "it goes on in the next line (`\\`); write it as one line"));
        }
        if used {
            statements.push_str(line);
            statements.push('\n');
        }
    }
    match wanted {
        Some(wanted) if !was_inside => {
            names.retain(|name| !name.is_empty());
            names.dedup();
            Err(MeshFault::NoSuchNode { wanted: wanted.into(), names: names.iter().map(|&name| name.into()).collect() })
        }
        _ if faces == 0 => Err(MeshFault::Empty),
        _ => Ok(statements),
    }
}

fn bad_line(line: &str, wants: &str) -> String {
    format!("{wants} belong in `{}`", excerpt(line))
}

/// The next `N` words as numbers.
fn numbers<'a, const N: usize>(words: &mut impl Iterator<Item = &'a str>) -> Option<[f32; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok()?;
    }
    Some(numbers)
}

/// How many positions and texture coordinates came before a line.
#[derive(Default)]
struct Counts {
    positions: u64,
    uvs: u64,
}

impl Counts {
    /// Checks `v`, `v/vt`, `v//vn` or `v/vt/vn` (1-based, or counted back from the latest); says whether `vt` is there.
    fn check_corner(&self, word: &str, at: impl Fn() -> String) -> Result<bool, MeshFault> {
        let syntax =
            || malformed(at(), format!("`{}` is not a face corner (v, v/vt, v//vn or v/vt/vn)", excerpt(word)));
        let index = |part: &str| part.parse::<i64>().map_err(|_| syntax());
        let check = |index: i64, what: &str, count: u64| match index != 0 && index.unsigned_abs() <= count {
            true => Ok(()),
            false => Err(MeshFault::IndexOutOfRange { place: at(), what: what.into(), index, count }),
        };
        let mut parts = word.split('/');
        check(index(parts.next().unwrap_or_default())?, "vertex", self.positions)?;
        let uv = parts.next().filter(|uv| !uv.is_empty()).map(index).transpose()?;
        parts.next().filter(|normal| !normal.is_empty()).map(index).transpose()?;
        if parts.next().is_some() {
            return Err(syntax());
        }
        // Where texture coordinates are not read, what their indices refer to is not known and does not matter.
        match uv.filter(|_| self.uvs > 0) {
            Some(uv) => check(uv, "texture coordinate", self.uvs).map(|()| true),
            None => Ok(false),
        }
    }
}
