//! The text of an NRRD header.

use crate::files::excerpt;
use crate::volume::error::VolumeFault;
use crate::volume::load::malformed;
use crate::volume::load::text::whole;
use std::borrow::Cow;

/// Fields of a header, and where its voxels are.
pub(super) struct Header<'a> {
    /// Names in lower case and without blanks, with their values.
    fields: Vec<(String, Cow<'a, str>)>,
    pub(super) attached: Attached<'a>,
}

/// Where the voxels are.
pub(super) enum Attached<'a> {
    /// Behind the header, from this byte on.
    At(usize),
    /// In a file of this name.
    File(Cow<'a, str>),
    /// In several files of these names.
    List(Vec<Cow<'a, str>>),
    /// In several files with numbers.
    Pattern(Cow<'a, str>),
}

/// No sensible header is longer; a file of raw numbers without a blank line is not searched to its end.
const LONGEST: usize = 1 << 20;

impl<'a> Header<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, VolumeFault> {
        let mut lines = Lines { bytes, at: 0 };
        let magic = lines.next().unwrap_or_default();
        match magic.strip_prefix("NRRD000") {
            Some("1" | "2" | "3" | "4" | "5") => {}
            Some(version) => {
                return Err(malformed("magic", format!("version `{}` of NRRD is not known", excerpt(version))));
            }
            None => return Err(malformed("magic", "the file does not begin with NRRD0001 to NRRD0005")),
        }
        let mut fields: Vec<(String, Cow<'a, str>)> = Vec::new();
        let mut list = None;
        let mut number = 1;
        while let Some(line) = lines.next() {
            number += 1;
            if lines.at > LONGEST {
                return Err(malformed("header", "it does not end within its first MiB; a blank line ends it"));
            }
            if line.is_empty() {
                break;
            }
            if line.starts_with('#') {
                continue;
            }
            let Some((name, value)) = split_field(&line) else {
                if is_key_value(&line) {
                    continue;
                }
                let reason = format!("`{}` is neither a field nor a comment", excerpt(&line));
                return Err(malformed(format!("line {number}"), reason));
            };
            let short = squeeze(name);
            if fields.iter().any(|(other, _)| *other == short) {
                return Err(malformed(name.trim(), format!("it is given a second time in line {number}")));
            }
            let is_list = short == "datafile" && value.split_whitespace().next().is_some_and(|word| word == "LIST");
            let value: Cow<'a, str> = Cow::Owned(value.trim().to_string());
            fields.push((short, value));
            if is_list {
                // The rest of the header is file names.
                let rest = std::iter::from_fn(|| lines.next()).take_while(|line| !line.is_empty());
                list = Some(rest.map(|name| Cow::Owned(name.trim().to_string())).collect::<Vec<Cow<'a, str>>>());
                break;
            }
        }
        let end = lines.at;
        let data_file = fields.iter().find(|(name, _)| name == "datafile").map(|(_, value)| value.clone());
        let attached = match (data_file, list) {
            (_, Some(list)) => Attached::List(list),
            (Some(value), None) if value.contains('%') => Attached::Pattern(value),
            (Some(value), None) => Attached::File(value),
            (None, None) => Attached::At(end),
        };
        Ok(Self { fields, attached })
    }

    /// The value of a field.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        let short = squeeze(name);
        self.fields.iter().find(|(other, _)| *other == short).map(|(_, value)| &**value)
    }

    /// The value of a field that must be there.
    pub(super) fn required(&self, name: &str) -> Result<&str, VolumeFault> {
        self.get(name).ok_or_else(|| malformed(name, "this field is missing"))
    }

    /// How many lines or bytes to leave out; 0 where the header does not say.
    pub(super) fn skip(&self, name: &str, least: i64) -> Result<i64, VolumeFault> {
        let skipped = self.get(name).map_or(Ok(0), |value| whole(name, value))?;
        match skipped >= least {
            true => Ok(skipped),
            false => Err(malformed(name, format!("{skipped} is less than {least}"))),
        }
    }
}

/// A line's field and its value. A colon with something glued to it belongs to a key and its value.
fn split_field(line: &str) -> Option<(&str, &str)> {
    let (name, value) = line.split_once(':')?;
    (value.is_empty() || value.starts_with([' ', '\t'])).then_some((name, value))
}

/// Whether a line is the author's own remark: `key:=value`.
fn is_key_value(line: &str) -> bool {
    line.split_once(":=").is_some()
}

/// Writers differ in blanks and capitals: `data file`, `datafile`, `Data File`.
fn squeeze(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_lowercase()).collect()
}

/// The lines of a text that bytes follow.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<Cow<'a, str>> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return None;
        }
        let searched = &rest[..rest.len().min(LONGEST)];
        let end = searched.iter().position(|byte| *byte == b'\n');
        self.at += end.map_or(searched.len(), |end| end + 1);
        let line = &searched[..end.unwrap_or(searched.len())];
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)))
    }
}
