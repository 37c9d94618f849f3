//! Vectors of x86-64 processors that have AVX-512 or AVX2. They round as plain Rust does, step by step and
//! without fused operations.
//!
//! What is unsafe is in here: calls for which the processor's features were looked up, and reading at places that were limited.

use super::vectors::{Lanes, Work, last_pair, pairs_of_rows};
use std::arch::x86_64::*;
// For loads and stores: builds that check pointers also check those of the processor's own, one by one.
use std::mem::transmute;

pub(super) fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
}

pub(super) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

/// # Panics
/// Without AVX-512.
#[allow(unsafe_code)]
pub(super) fn with_avx512<W: Work>(work: W) -> W::Output {
    assert!(has_avx512());
    // SAFETY: the processor has all features that the function asks for.
    unsafe { run_avx512(work) }
}

/// # Panics
/// Without AVX2.
#[allow(unsafe_code)]
pub(super) fn with_avx2<W: Work>(work: W) -> W::Output {
    assert!(has_avx2());
    // SAFETY: the processor has the only feature that the function asks for.
    unsafe { run_avx2(work) }
}

#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl")]
fn run_avx512<W: Work>(work: W) -> W::Output {
    work.run::<Avx512>()
}

#[target_feature(enable = "avx2")]
fn run_avx2<W: Work>(work: W) -> W::Output {
    work.run::<Avx2>()
}

/// Sixteen numbers. Used by [`run_avx512`] alone.
#[derive(Clone, Copy)]
struct Avx512;

/// Eight numbers. Used by [`run_avx2`] alone.
#[derive(Clone, Copy)]
struct Avx2;

/// Functions that call the processor's own operations.
macro_rules! operations {
    ($($name:ident($($argument:ident: $kind:ty),*) -> $result:ty = $of:expr;)*) => {
        $(
            #[inline(always)]
            #[allow(unsafe_code)]
            fn $name($($argument: $kind),*) -> $result {
                // SAFETY: this kind of vectors is used only after the processor's features were looked up.
                unsafe { $of }
            }
        )*
    };
}

impl Lanes for Avx512 {
    const COUNT: usize = 16;
    type Numbers = __m512;
    type Mask = __mmask16;

    operations! {
        splat(value: f32) -> __m512 = _mm512_set1_ps(value);
        steps() -> __m512 = _mm512_setr_ps(0., 1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11., 12., 13., 14., 15.);
        add(a: __m512, b: __m512) -> __m512 = _mm512_add_ps(a, b);
        sub(a: __m512, b: __m512) -> __m512 = _mm512_sub_ps(a, b);
        mul(a: __m512, b: __m512) -> __m512 = _mm512_mul_ps(a, b);
        div(a: __m512, b: __m512) -> __m512 = _mm512_div_ps(a, b);
        min(a: __m512, b: __m512) -> __m512 = _mm512_min_ps(a, b);
        max(a: __m512, b: __m512) -> __m512 = _mm512_max_ps(a, b);
        floor(a: __m512) -> __m512 = _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(a);
        is_less(a: __m512, b: __m512) -> __mmask16 = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b);
        select(mask: __mmask16, a: __m512, b: __m512) -> __m512 = _mm512_mask_blend_ps(mask, b, a);
    }

    #[inline(always)]
    fn and(a: __mmask16, b: __mmask16) -> __mmask16 {
        a & b
    }

    #[inline(always)]
    fn not(a: __mmask16) -> __mmask16 {
        !a
    }

    #[inline(always)]
    fn any(mask: __mmask16) -> bool {
        mask != 0
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn load(from: &[f32]) -> __m512 {
        let from: &[f32; 16] = from.first_chunk().expect("long enough");
        // SAFETY: any sixteen numbers are such a vector.
        unsafe { transmute(*from) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn load_bytes(from: &[u8]) -> __m512 {
        let from: &[u8; 16] = from.first_chunk().expect("long enough");
        // SAFETY: any sixteen bytes are such a vector; the features were looked up.
        unsafe { _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(transmute::<[u8; 16], __m128i>(*from))) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn store(numbers: __m512, into: &mut [f32]) {
        let into: &mut [f32; 16] = into.first_chunk_mut().expect("long enough");
        // SAFETY: such a vector is any sixteen numbers.
        *into = unsafe { transmute::<__m512, [f32; 16]>(numbers) };
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn pairs(of: &[f32], places: __m512) -> [__m512; 2] {
        let last = last_pair(of);
        // SAFETY: the features were looked up; no place is beyond the last pair, as what is negative, too great or no number
        // becomes a number beyond all pairs first.
        unsafe {
            let places = _mm512_min_epu32(_mm512_cvttps_epi32(places), _mm512_set1_epi32(last));
            let of = of.as_ptr().cast::<f64>();
            let low = _mm512_i32gather_pd::<4>(_mm512_castsi512_si256(places), of);
            let high = _mm512_i32gather_pd::<4>(_mm512_extracti64x4_epi64::<1>(places), of);
            let (low, high) = (_mm512_castpd_ps(low), _mm512_castpd_ps(high));
            let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
            let odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
            [_mm512_permutex2var_ps(low, even, high), _mm512_permutex2var_ps(low, odd, high)]
        }
    }

    type Squares = Squares;

    #[inline(always)]
    #[allow(unsafe_code)]
    fn to_squares(places: __m512, stride: usize) -> Squares {
        // SAFETY: the features were looked up.
        unsafe {
            let whole = _mm512_cvttps_epi32(places);
            let first = _mm_cvtsi128_si32(_mm512_castsi512_si128(whole));
            let last = _mm_extract_epi32::<3>(_mm512_extracti32x4_epi32::<3>(whole));
            let stride = stride as i32;
            // The lower of two rows; the columns of a smooth flow begin near the first place's.
            let is_falling = i64::from(last) + i64::from(stride / 2) < i64::from(first);
            let base = first.wrapping_sub(if is_falling { stride + BEFORE } else { BEFORE });
            let from_base = _mm512_sub_epi32(whole, _mm512_set1_epi32(base));
            let is_above = _mm512_cmpge_epi32_mask(from_base, _mm512_set1_epi32(stride));
            let index = _mm512_mask_sub_epi32(from_base, is_above, from_base, _mm512_set1_epi32(stride));
            let is_in = _mm512_cmplt_epu32_mask(index, _mm512_set1_epi32(WINDOW - 1));
            let base = usize::try_from(base).ok().filter(|_| is_in == !0);
            Squares { places, base, index, is_above }
        }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn squares(of: &[f32], places: &Squares, stride: usize) -> [__m512; 4] {
        let Squares { places, base, index, is_above } = *places;
        let rows = base.map(|base| [base, base + stride, base + 2 * stride]);
        let Some(rows) = rows.filter(|[.., top]| top + WINDOW as usize <= of.len()) else {
            return pairs_of_rows::<Self>(of, places, stride);
        };
        // SAFETY: the features were looked up.
        unsafe {
            let next = _mm512_add_epi32(index, _mm512_set1_epi32(1));
            let mut pairs = [[_mm512_setzero_ps(); 2]; 3];
            for (pair, row) in pairs.iter_mut().zip(rows) {
                let (low, high) = (Self::load(&of[row..]), Self::load(&of[row + 16..]));
                *pair = [_mm512_permutex2var_ps(low, index, high), _mm512_permutex2var_ps(low, next, high)];
            }
            let [below, own, above] = pairs;
            [
                _mm512_mask_blend_ps(is_above, below[0], own[0]),
                _mm512_mask_blend_ps(is_above, below[1], own[1]),
                _mm512_mask_blend_ps(is_above, own[0], above[0]),
                _mm512_mask_blend_ps(is_above, own[1], above[1]),
            ]
        }
    }
}

/// Columns that are loaded to take numbers from, and those of them before the first lane's place.
const WINDOW: i32 = 32;
const BEFORE: i32 = 6;

/// Places in memory. Where the flow is smooth they lie in a window of two rows, and those above them in the third one: taking
/// them from there is three times as fast as gathering each for itself.
#[derive(Clone, Copy)]
struct Squares {
    places: __m512,
    /// The window's first place, if all lie in it.
    base: Option<usize>,
    /// Columns of the window, and whether the place is in the upper row.
    index: __m512i,
    is_above: __mmask16,
}

impl Lanes for Avx2 {
    const COUNT: usize = 8;
    type Numbers = __m256;
    type Mask = __m256;

    operations! {
        splat(value: f32) -> __m256 = _mm256_set1_ps(value);
        steps() -> __m256 = _mm256_setr_ps(0., 1., 2., 3., 4., 5., 6., 7.);
        add(a: __m256, b: __m256) -> __m256 = _mm256_add_ps(a, b);
        sub(a: __m256, b: __m256) -> __m256 = _mm256_sub_ps(a, b);
        mul(a: __m256, b: __m256) -> __m256 = _mm256_mul_ps(a, b);
        div(a: __m256, b: __m256) -> __m256 = _mm256_div_ps(a, b);
        min(a: __m256, b: __m256) -> __m256 = _mm256_min_ps(a, b);
        max(a: __m256, b: __m256) -> __m256 = _mm256_max_ps(a, b);
        floor(a: __m256) -> __m256 = _mm256_floor_ps(a);
        is_less(a: __m256, b: __m256) -> __m256 = _mm256_cmp_ps::<_CMP_LT_OQ>(a, b);
        and(a: __m256, b: __m256) -> __m256 = _mm256_and_ps(a, b);
        not(a: __m256) -> __m256 = _mm256_xor_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(-1)));
        any(mask: __m256) -> bool = _mm256_movemask_ps(mask) != 0;
        select(mask: __m256, a: __m256, b: __m256) -> __m256 = _mm256_blendv_ps(b, a, mask);
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn load(from: &[f32]) -> __m256 {
        let from: &[f32; 8] = from.first_chunk().expect("long enough");
        // SAFETY: any eight numbers are such a vector.
        unsafe { transmute(*from) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn load_bytes(from: &[u8]) -> __m256 {
        let from: &[u8; 8] = from.first_chunk().expect("long enough");
        // SAFETY: the features were looked up.
        unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_set_epi64x(0, i64::from_le_bytes(*from)))) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn store(numbers: __m256, into: &mut [f32]) {
        let into: &mut [f32; 8] = into.first_chunk_mut().expect("long enough");
        // SAFETY: such a vector is any eight numbers.
        *into = unsafe { transmute::<__m256, [f32; 8]>(numbers) };
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn pairs(of: &[f32], places: __m256) -> [__m256; 2] {
        let last = last_pair(of);
        // SAFETY: the features were looked up; no place is beyond the last pair, as what is negative, too great or no number
        // becomes a number beyond all pairs first.
        unsafe {
            let places = _mm256_min_epu32(_mm256_cvttps_epi32(places), _mm256_set1_epi32(last));
            let of = of.as_ptr().cast::<f64>();
            let low = _mm256_i32gather_pd::<4>(of, _mm256_castsi256_si128(places));
            let high = _mm256_i32gather_pd::<4>(of, _mm256_extracti128_si256::<1>(places));
            let (low, high) = (_mm256_castpd_ps(low), _mm256_castpd_ps(high));
            // Shuffling works within halves: the middle two quarters change places.
            let in_order = |numbers: __m256| {
                let quarters = _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_castps_si256(numbers));
                _mm256_castsi256_ps(quarters)
            };
            let even = _mm256_shuffle_ps::<0b10_00_10_00>(low, high);
            let odd = _mm256_shuffle_ps::<0b11_01_11_01>(low, high);
            [in_order(even), in_order(odd)]
        }
    }

    type Squares = __m256;

    #[inline(always)]
    fn to_squares(places: __m256, _: usize) -> __m256 {
        places
    }

    #[inline(always)]
    fn squares(of: &[f32], places: &__m256, stride: usize) -> [__m256; 4] {
        pairs_of_rows::<Self>(of, *places, stride)
    }
}
