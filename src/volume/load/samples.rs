//! Numbers of any type, from bytes or text, stored as narrowly as they allow.

use super::malformed;
use crate::files::excerpt;
use crate::volume::Voxels;
use crate::volume::error::VolumeFault;
use std::borrow::Cow;

/// Type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Element {
    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// Bytes of a number in text, in the machine's little-endian order; `None` where the type has no such number.
    fn parse(self, word: &str, into: &mut Vec<u8>) -> Option<()> {
        macro_rules! push {
            ($type:ty) => {
                into.extend(word.parse::<$type>().ok()?.to_le_bytes())
            };
        }
        match self {
            Self::U8 => push!(u8),
            Self::I8 => push!(i8),
            Self::U16 => push!(u16),
            Self::I16 => push!(i16),
            Self::U32 => push!(u32),
            Self::I32 => push!(i32),
            Self::U64 => push!(u64),
            Self::I64 => push!(i64),
            Self::F32 => push!(f32),
            Self::F64 => push!(f64),
        }
        Some(())
    }
}

/// Order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

/// Numbers as voxels, and how many of them were not finite. Those get the value at the dark end: the least, or with
/// `is_falling` (a negative slope) the greatest of the finite ones.
///
/// Bytes beyond the last whole number are not looked at; the caller has counted them.
pub(super) fn decode(
    bytes: Cow<'_, [u8]>,
    element: Element,
    order: ByteOrder,
    is_falling: bool,
) -> Result<(Voxels, u64), VolumeFault> {
    macro_rules! numbers {
        ($type:ty) => {{
            let read = match order {
                ByteOrder::Little => <$type>::from_le_bytes,
                ByteOrder::Big => <$type>::from_be_bytes,
            };
            bytes.as_chunks().0.iter().map(move |number| read(*number))
        }};
    }
    let voxels = match element {
        Element::U8 => Voxels::U8(bytes.into_owned()),
        Element::U16 => Voxels::U16(numbers!(u16).collect()),
        Element::I16 => Voxels::I16(numbers!(i16).collect()),
        Element::I8 => narrow(numbers!(i8), |number| number.into()),
        Element::U32 => narrow(numbers!(u32), |number| number as f32),
        Element::I32 => narrow(numbers!(i32), |number| number as f32),
        Element::U64 => narrow(numbers!(u64), |number| number as f32),
        Element::I64 => narrow(numbers!(i64), |number| number as f32),
        Element::F32 => return narrow_floating(numbers!(f32).map(f64::from), is_falling),
        Element::F64 => return narrow_floating(numbers!(f64), is_falling),
    };
    Ok((voxels, 0))
}

/// Whole numbers in the first of u8, i16 and u16 that holds them all, or else as floating point.
pub(super) fn narrow<T>(numbers: impl Iterator<Item = T> + Clone, rounded: impl Fn(T) -> f32) -> Voxels
where
    T: Copy + Ord + TryInto<u8> + TryInto<i16> + TryInto<u16>,
{
    let (Some(least), Some(greatest)) = (numbers.clone().min(), numbers.clone().max()) else {
        return Voxels::U8(Vec::new());
    };
    fn fits<T: TryInto<U>, U>(least: T, greatest: T) -> bool {
        least.try_into().is_ok() && greatest.try_into().is_ok()
    }
    // Every number lies between two that fit, so none of them falls back to 0.
    fn cast<T: TryInto<U>, U: Default>(number: T) -> U {
        number.try_into().unwrap_or_default()
    }
    if fits::<T, u8>(least, greatest) {
        Voxels::U8(numbers.map(cast).collect())
    } else if fits::<T, i16>(least, greatest) {
        Voxels::I16(numbers.map(cast).collect())
    } else if fits::<T, u16>(least, greatest) {
        Voxels::U16(numbers.map(cast).collect())
    } else {
        Voxels::F32(numbers.map(rounded).collect())
    }
}

/// The same for floating-point numbers that may all be whole.
pub(super) fn narrow_floating(
    numbers: impl Iterator<Item = f64> + Clone,
    is_falling: bool,
) -> Result<(Voxels, u64), VolumeFault> {
    // A number beyond what 32 bits hold would become infinite.
    let is_finite = |number: f64| (number as f32).is_finite();
    let (mut least, mut greatest, mut are_whole, mut replaced) = (f64::INFINITY, f64::NEG_INFINITY, true, 0);
    for number in numbers.clone() {
        if is_finite(number) {
            least = least.min(number);
            greatest = greatest.max(number);
            // Far faster than rounding; beyond these it matters to none of the narrow types.
            are_whole &= f64::from(number as i32) == number;
        } else {
            replaced += 1;
        }
    }
    if least > greatest {
        return Err(malformed("voxels", "not one of them is a finite number"));
    }
    let instead = if is_falling { greatest } else { least };
    let numbers = numbers.map(|number| if is_finite(number) { number } else { instead });
    let within = |low: f64, high: f64| are_whole && least >= low && greatest <= high;
    let voxels = if within(0.0, 255.0) {
        Voxels::U8(numbers.map(|number| number as u8).collect())
    } else if within(i16::MIN.into(), i16::MAX.into()) {
        Voxels::I16(numbers.map(|number| number as i16).collect())
    } else if within(0.0, u16::MAX.into()) {
        Voxels::U16(numbers.map(|number| number as u16).collect())
    } else {
        Voxels::F32(numbers.map(|number| number as f32).collect())
    };
    Ok((voxels, replaced))
}

/// Bytes, red first, as colours with their opacity; full where there are only three of them.
pub(super) fn colours(bytes: &[u8], channels: u64) -> Voxels {
    Voxels::Rgba(match channels {
        3 => bytes.as_chunks().0.iter().map(|&[r, g, b]| [r, g, b, 255]).collect(),
        _ => bytes.as_chunks().0.to_vec(),
    })
}

/// Numbers in text, with blanks or commas between them, as little-endian bytes; exactly `count` of them.
pub(super) fn from_text(text: &[u8], element: Element, count: u64, what: &str) -> Result<Vec<u8>, VolumeFault> {
    // A digit and a blank each, but for the last.
    let most = (text.len() as u64).div_ceil(2);
    if count > most {
        let [expected, found] = [count.saturating_mul(element.bytes()), most * element.bytes()];
        return Err(VolumeFault::Truncated { what: what.into(), expected, found });
    }
    let expected = count * element.bytes();
    let mut bytes = Vec::with_capacity(expected as usize);
    let words = text.split(|byte| byte.is_ascii_whitespace() || *byte == b',').filter(|word| !word.is_empty());
    for (at, word) in words.enumerate() {
        if at as u64 == count {
            return Err(VolumeFault::Oversized { what: what.into(), expected });
        }
        let parsed = std::str::from_utf8(word).ok().and_then(|word| element.parse(word, &mut bytes));
        if parsed.is_none() {
            let word = excerpt(&String::from_utf8_lossy(word));
            return Err(malformed(what, format!("voxel number {at} is `{word}`, which is no {}", element.name())));
        }
    }
    match bytes.len() as u64 {
        found if found < expected => Err(VolumeFault::Truncated { what: what.into(), expected, found }),
        _ => Ok(bytes),
    }
}

/// Bytes as pairs of hexadecimal digits; exactly `count` bytes.
pub(super) fn from_hex(text: &[u8], count: u64, what: &str) -> Result<Vec<u8>, VolumeFault> {
    let most = text.len() as u64 / 2;
    if count > most {
        return Err(VolumeFault::Truncated { what: what.into(), expected: count, found: most });
    }
    let mut bytes = Vec::with_capacity(count as usize);
    let mut high = None;
    for (at, &character) in text.iter().enumerate().filter(|(_, character)| !character.is_ascii_whitespace()) {
        let Some(digit) = char::from(character).to_digit(16) else {
            let shown = excerpt(&char::from(character).to_string());
            return Err(malformed(what, format!("`{shown}` (character {at}) is no hexadecimal digit")));
        };
        if bytes.len() as u64 == count {
            return Err(VolumeFault::Oversized { what: what.into(), expected: count });
        }
        match high.take() {
            None => high = Some(digit as u8),
            Some(high) => bytes.push(high << 4 | digit as u8),
        }
    }
    match (bytes.len() as u64, high) {
        (found, _) if found < count => Err(VolumeFault::Truncated { what: what.into(), expected: count, found }),
        (_, Some(_)) => Err(VolumeFault::Oversized { what: what.into(), expected: count }),
        _ => Ok(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_take_the_narrowest_type_that_holds_them() {
        let stored = |numbers: &[i64]| narrow(numbers.iter().copied(), |number| number as f32);
        assert_eq!(stored(&[0, 255]), Voxels::U8(vec![0, 255]));
        assert_eq!(stored(&[-1, 255]), Voxels::I16(vec![-1, 255]));
        assert_eq!(stored(&[0, 32_767]), Voxels::I16(vec![0, 32_767]));
        assert_eq!(stored(&[0, 65_535]), Voxels::U16(vec![0, 65_535]));
        assert_eq!(stored(&[-1, 65_535]), Voxels::F32(vec![-1.0, 65_535.0]));
        assert_eq!(stored(&[i64::MIN, 0]), Voxels::F32(vec![i64::MIN as f32, 0.0]));
        let floating = |numbers: &[f64]| narrow_floating(numbers.iter().copied(), false).unwrap();
        assert_eq!(floating(&[-0.0, 255.0]), (Voxels::U8(vec![0, 255]), 0));
        assert_eq!(floating(&[-1024.0, 3071.0]), (Voxels::I16(vec![-1024, 3071]), 0));
        assert_eq!(floating(&[0.0, 40_000.0]), (Voxels::U16(vec![0, 40_000]), 0));
        assert_eq!(floating(&[0.5, 40_000.0]), (Voxels::F32(vec![0.5, 40_000.0]), 0));
        assert_eq!(floating(&[3e9, 0.0]), (Voxels::F32(vec![3e9, 0.0]), 0));
    }

    #[test]
    fn voxels_that_are_not_finite_get_the_dark_end() {
        let numbers = [f64::NAN, 2.5, f64::INFINITY, -1.5, 1e300, f64::NEG_INFINITY];
        let stored = |is_falling| narrow_floating(numbers.into_iter(), is_falling).unwrap();
        assert_eq!(stored(false), (Voxels::F32(vec![-1.5, 2.5, -1.5, -1.5, -1.5, -1.5]), 4));
        assert_eq!(stored(true), (Voxels::F32(vec![2.5, 2.5, 2.5, -1.5, 2.5, 2.5]), 4));
        assert_eq!(
            narrow_floating([f64::NAN].into_iter(), false).unwrap_err().to_string(),
            "voxels: not one of them is a finite number"
        );
    }

    #[test]
    fn text_is_counted_and_held_against_its_type() {
        let read = |text: &str, element, count| from_text(text.as_bytes(), element, count, "voxels");
        assert_eq!(read(" 1,2\n300 ", Element::I16, 3).unwrap(), [1, 0, 2, 0, 44, 1]);
        let message = |text: &str, element, count| read(text, element, count).unwrap_err().to_string();
        assert_eq!(message("1 2 300", Element::U8, 3), "voxels: voxel number 2 is `300`, which is no u8");
        assert_eq!(message("1 -2", Element::U16, 2), "voxels: voxel number 1 is `-2`, which is no u16");
        assert!(message("1 2 3", Element::U8, 2).starts_with("voxels: more than the 2 bytes"));
        assert!(message("10 2", Element::I16, 3).starts_with("voxels: 4 bytes found where 6 belong"));
        assert!(message("1 2", Element::F64, u64::MAX).contains("found where"));
        let hex = |text: &str, count| from_hex(text.as_bytes(), count, "voxels");
        assert_eq!(hex("0aF\nf 10", 3).unwrap(), [10, 255, 16]);
        assert_eq!(hex("0g", 1).unwrap_err().to_string(), "voxels: `g` (character 1) is no hexadecimal digit");
        assert!(hex("0a0", 1).is_err() && hex("0a0b", 1).is_err() && hex("0a", 2).is_err());
    }
}
