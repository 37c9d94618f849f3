//! Data files beside a header: which may be read, and under which names.

use super::malformed;
use super::text::whole;
use crate::files::{Fetch, excerpt};
use crate::volume::error::VolumeFault;
use std::borrow::Cow;

/// Most files that one volume is spread over: one per slice, several times over.
const MAX_FILES: u64 = 1 << 14;

/// The voxels of the files that a header names in `field`, one after the other: `total` bytes, the same share in each.
/// `piece` finds in a file's bytes those of its voxels; it is told how many belong there, and what to call them.
pub(super) fn gather(
    field: &str,
    names: &[String],
    total: u64,
    element_bytes: u64,
    fetch: Fetch<'_>,
    mut piece: impl for<'f> FnMut(&'f [u8], u64, &str) -> Result<Cow<'f, [u8]>, VolumeFault>,
) -> Result<Vec<u8>, VolumeFault> {
    let count = names.len() as u64;
    if count == 0 || !total.is_multiple_of(count * element_bytes) {
        let reason = format!("it names {count} files, but the voxels cannot be shared out evenly among so many");
        return Err(malformed(field, reason));
    }
    let mut all = Vec::new();
    for (place, name) in names.iter().enumerate() {
        let bytes = match fetch_named(name, fetch) {
            Ok(bytes) => bytes,
            Err(fault) => {
                // Who cannot answer at once is told of all the files, and not of one at each reading of the header.
                names[place + 1..].iter().for_each(|name| drop(fetch_named(name, fetch)));
                return Err(fault);
            }
        };
        let voxels = piece(&bytes, total / count, &format!("voxels in `{}`", excerpt(name)))?;
        match count {
            1 => all = voxels.into_owned(),
            _ => all.extend_from_slice(&voxels),
        }
    }
    Ok(all)
}

/// Fetches a file that a header names.
pub(super) fn fetch_named(named: &str, fetch: Fetch<'_>) -> Result<Vec<u8>, VolumeFault> {
    let path = inside(named)?;
    fetch(&path).map_err(|reason| VolumeFault::MissingFile { path: excerpt(named), reason: excerpt(&reason) })
}

/// The path below the header's folder that a name means. Nothing else is ever read: a header is data, and must not
/// choose freely among the files of whoever opens it.
fn inside(named: &str) -> Result<String, VolumeFault> {
    let forbidden = || VolumeFault::ForbiddenPath { path: excerpt(named) };
    // Headers written on Windows separate by backslashes. A colon begins a drive, a scheme or an alternate stream.
    if named.contains(|c: char| c == ':' || c.is_control()) || named.starts_with(['/', '\\', '~']) {
        return Err(forbidden());
    }
    let parts: Vec<&str> = named.split(['/', '\\']).filter(|part| !matches!(*part, "" | ".")).collect();
    if parts.iter().any(|part| part.trim_end_matches([' ', '.']).is_empty()) {
        return Err(forbidden());
    }
    match parts.is_empty() {
        true => Err(VolumeFault::MissingFile { path: excerpt(named), reason: "no file is named".into() }),
        false => Ok(parts.join("/")),
    }
}

/// The names that a printf pattern stands for: `name%03d.raw first last step`. A fourth number says how many axes a file has,
/// which the number of files says as well.
pub(super) fn pattern_names(field: &str, value: &str) -> Result<Vec<String>, VolumeFault> {
    let number = value.find('%').unwrap_or_default();
    let end = value[number..].find(char::is_whitespace).map_or(value.len(), |at| number + at);
    let (pattern, numbers) = value.split_at(end);
    let numbers = numbers.split_whitespace().map(|word| whole(field, word)).collect::<Result<Vec<i64>, _>>()?;
    let ([first, last, step] | [first, last, step, _]) = numbers[..] else {
        return Err(malformed(field, format!("`{}` needs the first, last and step number", excerpt(value))));
    };
    let bad = |reason: String| Err(malformed(field, format!("`{}` {reason}", excerpt(value))));
    if step == 0 || (step > 0) != (last >= first) && last != first {
        return bad("never comes to its last number".into());
    }
    let count = (last.abs_diff(first) / step.unsigned_abs()).saturating_add(1);
    if count > MAX_FILES {
        return bad(format!("stands for {count} files; at most {MAX_FILES} are read"));
    }
    let Some((before, after, width, fill)) = conversion(pattern) else {
        return bad("needs one number conversion such as `%03d`".into());
    };
    let name = |at: u64| {
        let number = first as i128 + i128::from(step) * i128::from(at);
        match fill {
            '0' => format!("{before}{number:0width$}{after}"),
            _ => format!("{before}{number:width$}{after}"),
        }
    };
    Ok((0..count).map(name).collect())
}

/// The pieces of a pattern with one `%d`: what stands before and after it, its width and what fills it.
fn conversion(pattern: &str) -> Option<(&str, &str, usize, char)> {
    let (before, rest) = pattern.split_once('%')?;
    let end = rest.find(|c: char| !c.is_ascii_digit())?;
    let (digits, after) = (&rest[..end], rest[end..].strip_prefix(['d', 'i', 'u'])?);
    let fill = if digits.starts_with('0') { '0' } else { ' ' };
    let width = if digits.is_empty() { 0 } else { digits.parse().ok().filter(|width| *width <= 20)? };
    (!after.contains('%')).then_some((before, after, width, fill))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_below_the_folder_are_read() {
        for (named, path) in [
            ("a.raw", "a.raw"),
            ("./a.raw", "a.raw"),
            ("./././deep//a b.raw", "deep/a b.raw"),
            (r"deep\a.raw", "deep/a.raw"),
            ("...a..b", "...a..b"),
        ] {
            assert_eq!(inside(named), Ok(path.into()));
        }
        for named in [
            "../a.raw",
            "deep/../../a",
            r"..\a",
            "/etc/passwd",
            r"\\host\share",
            r"C:\a",
            "c:a",
            "http://host/a",
            "~/a",
            "a/..",
            "a/.. /b",
            "a\0b",
            "file:a",
        ] {
            assert!(matches!(inside(named), Err(VolumeFault::ForbiddenPath { .. })), "{named}");
        }
        for named in ["", ".", "./"] {
            assert!(matches!(inside(named), Err(VolumeFault::MissingFile { .. })), "{named}");
        }
    }

    #[test]
    fn patterns_count_up_and_down() {
        let names = |value| pattern_names("data file", value);
        assert_eq!(names("s%02d.raw 8 12 2").unwrap(), ["s08.raw", "s10.raw", "s12.raw"]);
        assert_eq!(names("a b%d 2 1 -1 2").unwrap(), ["a b2", "a b1"]);
        assert_eq!(names("%3d 5 5 1").unwrap(), ["  5"]);
        for value in [
            "s%d 1 9",
            "s%d 1 2 3 4 5",
            "s%d 1 2 x",
            "s%d 9 1 1",
            "s%d 1 9 0",
            "s 1 2 1",
            "%s 1 2 1",
            "%d%d 1 2 1",
            "%99d 1 2 1",
            "%d 0 99999999 1",
        ] {
            assert!(matches!(names(value), Err(VolumeFault::Malformed { .. })), "{value}");
        }
        assert!(names(&format!("%d {} {} 1", i64::MIN, i64::MAX)).is_err());
    }
}
