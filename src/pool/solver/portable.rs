//! Several numbers at a time in plain Rust: what vectors do, and what any processor can do.

use super::vectors::{Lanes, last_pair, pairs_of_rows};
use std::array::from_fn;

/// Eight numbers, for which the compiler may find vectors.
#[derive(Clone, Copy)]
pub(super) struct Portable;

const COUNT: usize = 8;

#[inline(always)]
fn map2<T>(a: [f32; COUNT], b: [f32; COUNT], of: impl Fn(f32, f32) -> T) -> [T; COUNT] {
    from_fn(|k| of(a[k], b[k]))
}

impl Lanes for Portable {
    const COUNT: usize = COUNT;
    type Numbers = [f32; COUNT];
    type Mask = [bool; COUNT];

    #[inline(always)]
    fn splat(value: f32) -> Self::Numbers {
        [value; COUNT]
    }

    #[inline(always)]
    fn steps() -> Self::Numbers {
        from_fn(|k| k as f32)
    }

    #[inline(always)]
    fn load(from: &[f32]) -> Self::Numbers {
        *from.first_chunk().expect("long enough")
    }

    #[inline(always)]
    fn load_bytes(from: &[u8]) -> Self::Numbers {
        from.first_chunk::<COUNT>().expect("long enough").map(f32::from)
    }

    #[inline(always)]
    fn store(numbers: Self::Numbers, into: &mut [f32]) {
        *into.first_chunk_mut().expect("long enough") = numbers;
    }

    #[inline(always)]
    fn add(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        map2(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        map2(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        map2(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn div(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        map2(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn min(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        map2(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        map2(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn floor(a: Self::Numbers) -> Self::Numbers {
        a.map(f32::floor)
    }

    #[inline(always)]
    fn is_less(a: Self::Numbers, b: Self::Numbers) -> Self::Mask {
        map2(a, b, |a, b| a < b)
    }

    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        from_fn(|k| a[k] & b[k])
    }

    #[inline(always)]
    fn not(a: Self::Mask) -> Self::Mask {
        a.map(|a| !a)
    }

    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        mask.iter().fold(false, |any, lane| any | lane)
    }

    #[inline(always)]
    fn select(mask: Self::Mask, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers {
        from_fn(|k| if mask[k] { a[k] } else { b[k] })
    }

    #[inline(always)]
    fn pairs(of: &[f32], places: Self::Numbers) -> [Self::Numbers; 2] {
        let last = last_pair(of);
        let places = places.map(|place| if place >= 0.0 { (place as i32).min(last) } else { last } as usize);
        [places.map(|place| of[place]), places.map(|place| of[place + 1])]
    }

    type Squares = Self::Numbers;

    #[inline(always)]
    fn to_squares(places: Self::Numbers, _: usize) -> Self::Numbers {
        places
    }

    #[inline(always)]
    fn squares(of: &[f32], places: &Self::Numbers, stride: usize) -> [Self::Numbers; 4] {
        pairs_of_rows::<Self>(of, *places, stride)
    }
}
