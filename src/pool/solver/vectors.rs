//! Work on several numbers at a time, with the best that the processor has.

use super::portable::Portable;
#[cfg(target_arch = "x86_64")]
use super::x86;

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
    /// Places for [`squares`](Self::squares) of fields with so many numbers in a row.
    type Squares: Copy;
    fn to_squares(places: Self::Numbers, stride: usize) -> Self::Squares;
    /// Pairs at places and those a row above.
    fn squares(of: &[f32], places: &Self::Squares, stride: usize) -> [Self::Numbers; 4];
}

/// Squares from pairs.
#[inline(always)]
pub(super) fn pairs_of_rows<L: Lanes>(of: &[f32], places: L::Numbers, stride: usize) -> [L::Numbers; 4] {
    let [[a, b], [c, d]] = [L::pairs(of, places), L::pairs(&of[stride..], places)];
    [a, b, c, d]
}

/// The greatest place of a pair; never negative.
#[inline(always)]
pub(super) fn last_pair(of: &[f32]) -> i32 {
    assert!((2..=i32::MAX as usize).contains(&of.len()));
    of.len() as i32 - 2
}

/// Which vectors do the work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Vectors {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Vectors {
    /// Those that the processor has, from the plainest on.
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(x86::has_avx2().then_some(Self::Avx2));
            all.extend(x86::has_avx512().then_some(Self::Avx512));
        }
        all
    }

    /// The widest.
    pub fn best() -> Self {
        Self::all().pop().unwrap_or(Self::Portable)
    }

    /// Does work with them.
    ///
    /// # Panics
    /// If the processor does not have them.
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self {
            Self::Portable => work.run::<Portable>(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86::with_avx2(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => x86::with_avx512(work),
        }
    }
}
