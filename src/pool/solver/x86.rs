//! Vectors of x86-64 processors that have AVX-512 or AVX2. They round as plain Rust does, step by step and
//! without fused operations.
//!
//! What is unsafe is in here: calls for which the processor's features were looked up, and reading at places that were limited.

use super::vectors::{Lanes, Work, last_pair};
use std::arch::x86_64::*;

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
        // SAFETY: there are sixteen numbers; the features were looked up.
        unsafe { _mm512_loadu_ps(from.as_ptr()) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn load_bytes(from: &[u8]) -> __m512 {
        let from: &[u8; 16] = from.first_chunk().expect("long enough");
        // SAFETY: there are sixteen bytes; the features were looked up.
        unsafe { _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(_mm_loadu_si128(from.as_ptr().cast()))) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn store(numbers: __m512, into: &mut [f32]) {
        let into: &mut [f32; 16] = into.first_chunk_mut().expect("long enough");
        // SAFETY: there is room for sixteen numbers; the features were looked up.
        unsafe { _mm512_storeu_ps(into.as_mut_ptr(), numbers) };
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
        // SAFETY: there are eight numbers; the features were looked up.
        unsafe { _mm256_loadu_ps(from.as_ptr()) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn load_bytes(from: &[u8]) -> __m256 {
        let from: &[u8; 8] = from.first_chunk().expect("long enough");
        // SAFETY: there are eight bytes; the features were looked up.
        unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(from.as_ptr().cast()))) }
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn store(numbers: __m256, into: &mut [f32]) {
        let into: &mut [f32; 8] = into.first_chunk_mut().expect("long enough");
        // SAFETY: there is room for eight numbers; the features were looked up.
        unsafe { _mm256_storeu_ps(into.as_mut_ptr(), numbers) };
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
}
