//! Numbers in the text of a header.

use super::malformed;
use crate::files::excerpt;
use crate::volume::error::VolumeFault;

/// A whole number.
pub(super) fn whole(field: &str, text: &str) -> Result<i64, VolumeFault> {
    text.trim().parse().map_err(|_| malformed(field, format!("`{}` is not a whole number", excerpt(text))))
}

/// A number; NaN and infinity are numbers here, and are refused where they make no sense.
pub(super) fn number(field: &str, text: &str) -> Result<f64, VolumeFault> {
    text.trim().parse().map_err(|_| malformed(field, format!("`{}` is not a number", excerpt(text))))
}

/// So many numbers with blanks between them.
pub(super) fn numbers(field: &str, text: &str, count: usize) -> Result<Vec<f64>, VolumeFault> {
    let numbers = text.split_whitespace().map(|word| number(field, word)).collect::<Result<Vec<_>, _>>()?;
    match numbers.len() == count {
        true => Ok(numbers),
        false => Err(malformed(field, format!("there are {} numbers where {count} belong", numbers.len()))),
    }
}

/// Sides of a grid: so many positive whole numbers.
pub(super) fn sides(field: &str, text: &str, count: usize) -> Result<Vec<u64>, VolumeFault> {
    let words: Vec<&str> = text.split_whitespace().collect();
    if words.len() != count {
        return Err(malformed(field, format!("there are {} numbers where {count} belong", words.len())));
    }
    let side = |word: &&str| match word.parse::<u64>() {
        Ok(side) if side > 0 => Ok(side),
        _ => Err(malformed(field, format!("`{}` is not a positive whole number", excerpt(word)))),
    };
    words.iter().map(side).collect()
}

/// A distance between voxels.
pub(super) fn spacing(field: &str, spacing_mm: f64) -> Result<f64, VolumeFault> {
    match spacing_mm.is_finite() && spacing_mm > 0.0 {
        true => Ok(spacing_mm),
        false => Err(malformed(field, format!("{spacing_mm:?} is not a positive number"))),
    }
}

/// The product of sizes, or `None` where it is beyond all bytes there are.
pub(super) fn product(factors: impl IntoIterator<Item = u64>) -> Option<u64> {
    factors.into_iter().try_fold(1_u64, u64::checked_mul)
}
