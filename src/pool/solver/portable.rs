//! Several numbers at a time in plain Rust: what vectors do, and what any processor can do.

use std::array::from_fn;

/// Work that is written once for vectors of any kind.
pub(super) trait Work {
    type Output;

    /// To be inlined wholly: what is called from here is compiled for the vectors' processor only as part of it.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Vectors of numbers. All kinds round alike and treat what is no number alike, so that all leave the same bits.
pub(super) trait Lanes: Copy {
    /// Numbers in a vector; a divisor of 16.
    const COUNT: usize;
    type Numbers: Copy;
    type Mask: Copy;

    fn splat(value: f32) -> Self::Numbers;
    /// 0, 1, 2 ...
    fn steps() -> Self::Numbers;
    /// The first of a slice that is not shorter.
    fn load(from: &[f32]) -> Self::Numbers;
    fn load_bytes(from: &[u8]) -> Self::Numbers;
    fn store(numbers: Self::Numbers, into: &mut [f32]);
    fn add(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn sub(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn mul(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn div(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    /// The second where one of them is no number.
    fn min(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    /// The second where one of them is no number.
    fn max(a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    fn floor(a: Self::Numbers) -> Self::Numbers;
    /// False where one of them is no number.
    fn is_less(a: Self::Numbers, b: Self::Numbers) -> Self::Mask;
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn not(a: Self::Mask) -> Self::Mask;
    fn any(mask: Self::Mask) -> bool;
    /// The first where the mask is true.
    fn select(mask: Self::Mask, a: Self::Numbers, b: Self::Numbers) -> Self::Numbers;
    /// The numbers of a slice at whole places, and the ones after each. Places beyond the slice, negative ones and what is no
    /// number count as its last pair.
    fn pairs(of: &[f32], places: Self::Numbers) -> [Self::Numbers; 2];
}

/// The greatest place of a pair; never negative.
#[inline(always)]
pub(super) fn last_pair(of: &[f32]) -> i32 {
    assert!((2..=i32::MAX as usize).contains(&of.len()));
    of.len() as i32 - 2
}

/// Runs work without vectors, or with those that the compiler finds.
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
}
