//! The same blending sixteen texels at a time, for x86-64 processors with AVX-512 or AVX2. Both round as the plain code
//! does, step by step and without fused operations, so all leave the same bits.
//!
//! What is unsafe is in here: the calls for which the processor's features were looked up, and reading tables and
//! arrays whose length is known.

use super::brush::{Brush, CHUNK_PX, PROFILE_STEPS, Rows, Steps, TABLE_LEN, for_each_chunk};
use super::portable;
use std::arch::x86_64::*;

/// Paints a brush's texels in some rows and ranges of columns, with the best that the processor has.
#[allow(unsafe_code)]
pub(super) fn paint(rows: &mut Rows, brush: &Brush, allowed: &[(u32, u32)]) {
    if is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
    {
        // SAFETY: the processor has all features that the function asks for.
        unsafe { paint_avx512(rows, brush, allowed) }
    } else {
        paint_without_avx512(rows, brush, allowed);
    }
}

/// What processors without AVX-512 do.
#[allow(unsafe_code)]
pub(super) fn paint_without_avx512(rows: &mut Rows, brush: &Brush, allowed: &[(u32, u32)]) {
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the only feature that the function asks for.
        unsafe { paint_avx2(rows, brush, allowed) }
    } else {
        portable::paint(rows, brush, allowed);
    }
}

/// Colours of the brush for 32-bit lanes: red and blue in the low bytes of the two 16-bit halves, and green and alpha.
fn colour_halves(brush: &Brush) -> (i32, i32) {
    let [red, green, blue, alpha] = brush.colour.map(i32::from);
    (red | blue << 16, green | alpha << 16)
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl")]
#[allow(unsafe_code)]
fn paint_avx512(rows: &mut Rows, brush: &Brush, allowed: &[(u32, u32)]) {
    const { assert!(TABLE_LEN.is_power_of_two() && CHUNK_PX == 16) };
    let table_mask = _mm512_set1_epi32(TABLE_LEN as i32 - 1);
    let outside = _mm512_set1_ps(PROFILE_STEPS as f32);
    let low_bytes = _mm512_set1_epi16(0xff);
    let opacity = _mm512_set1_epi16(brush.opacity);
    let (even, odd) = colour_halves(brush);
    let (even, odd) = (_mm512_set1_epi32(even), _mm512_set1_epi32(odd));
    let gloss = _mm256_set1_epi16(i16::from(brush.gloss));
    let lanes = _mm512_cvtepi32_ps(_mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
    let place = rows.place();
    let (colours, glosses) = rows.chunks();
    for_each_chunk(brush, place, allowed, |chunk, steps| {
        let steps = match &steps {
            Steps::Quadratic { column, start, end, row } => {
                let x = _mm512_add_ps(_mm512_set1_ps(*column), lanes);
                let slope = _mm512_add_ps(_mm512_set1_ps(row.b), _mm512_mul_ps(_mm512_set1_ps(row.c), x));
                let step = _mm512_add_ps(_mm512_set1_ps(row.a), _mm512_mul_ps(slope, x));
                // The smaller of two is the second where the first is no number.
                let step = _mm512_max_ps(_mm512_min_ps(step, outside), _mm512_setzero_ps());
                let is_in = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(x, _mm512_set1_ps(*start))
                    & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(x, _mm512_set1_ps(*end));
                _mm512_mask_mov_ps(outside, is_in, step)
            }
            // SAFETY: the list is sixteen numbers long.
            Steps::Listed(steps) => unsafe { _mm512_loadu_ps(steps.as_ptr()) },
        };
        let index = _mm512_and_si512(_mm512_cvttps_epi32(steps), table_mask);
        // SAFETY: the mask keeps every index below the table's length.
        let alpha = unsafe { _mm512_i32gather_epi32::<4>(index, brush.table.as_ptr()) };
        // In both halves of each texel's lane.
        let alpha = _mm512_mulhrs_epi16(_mm512_or_si512(alpha, _mm512_slli_epi32::<16>(alpha)), opacity);
        let lerp = |from, to| _mm512_add_epi16(from, _mm512_mulhrs_epi16(_mm512_sub_epi16(to, from), alpha));

        let colours: &mut [[u8; 4]; CHUNK_PX] = &mut colours[chunk];
        // SAFETY: the chunk is 64 bytes long.
        let old = unsafe { _mm512_loadu_si512(colours.as_ptr().cast()) };
        let low = lerp(_mm512_and_si512(old, low_bytes), even);
        let high = lerp(_mm512_srli_epi16::<8>(old), odd);
        let new = _mm512_or_si512(low, _mm512_slli_epi16::<8>(high));
        // SAFETY: as before, and the chunk is borrowed for writing.
        unsafe { _mm512_storeu_si512(colours.as_mut_ptr().cast(), new) };

        let glosses: &mut [u8; CHUNK_PX] = &mut glosses[chunk];
        let old = _mm256_cvtepu8_epi16(bytemuck::cast(*glosses));
        let change = _mm256_mulhrs_epi16(_mm256_sub_epi16(gloss, old), _mm512_cvtepi32_epi16(alpha));
        *glosses = bytemuck::cast(_mm256_cvtepi16_epi8(_mm256_add_epi16(old, change)));
    });
}

#[target_feature(enable = "avx2")]
#[allow(unsafe_code)]
fn paint_avx2(rows: &mut Rows, brush: &Brush, allowed: &[(u32, u32)]) {
    const { assert!(TABLE_LEN.is_power_of_two() && CHUNK_PX == 16) };
    let table_mask = _mm256_set1_epi32(TABLE_LEN as i32 - 1);
    let outside = _mm256_set1_ps(PROFILE_STEPS as f32);
    let low_bytes = _mm256_set1_epi16(0xff);
    let opacity = _mm256_set1_epi16(brush.opacity);
    let (even, odd) = colour_halves(brush);
    let (even, odd) = (_mm256_set1_epi32(even), _mm256_set1_epi32(odd));
    let gloss = _mm256_set1_epi16(i16::from(brush.gloss));
    let lanes = _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
    let lookup = |steps: __m256| {
        let index = _mm256_and_si256(_mm256_cvttps_epi32(steps), table_mask);
        // SAFETY: the mask keeps every index below the table's length.
        unsafe { _mm256_i32gather_epi32::<4>(brush.table.as_ptr(), index) }
    };
    let lerp = |from, to, alpha| _mm256_add_epi16(from, _mm256_mulhrs_epi16(_mm256_sub_epi16(to, from), alpha));
    let blend = |old, alpha| {
        let low = lerp(_mm256_and_si256(old, low_bytes), even, alpha);
        let high = lerp(_mm256_srli_epi16::<8>(old), odd, alpha);
        _mm256_or_si256(low, _mm256_slli_epi16::<8>(high))
    };
    let place = rows.place();
    let (colours, glosses) = rows.chunks();
    for_each_chunk(brush, place, allowed, |chunk, steps| {
        let [left, right] = match &steps {
            Steps::Quadratic { column, start, end, row } => {
                let (start, end) = (_mm256_set1_ps(*start), _mm256_set1_ps(*end));
                let [a, b, c] = [row.a, row.b, row.c].map(|value| _mm256_set1_ps(value));
                let step = |column: f32| {
                    let x = _mm256_add_ps(_mm256_set1_ps(column), lanes);
                    let step = _mm256_add_ps(a, _mm256_mul_ps(_mm256_add_ps(b, _mm256_mul_ps(c, x)), x));
                    // The smaller of two is the second where the first is no number.
                    let step = _mm256_max_ps(_mm256_min_ps(step, outside), _mm256_setzero_ps());
                    let is_in =
                        _mm256_and_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(x, start), _mm256_cmp_ps::<_CMP_LT_OQ>(x, end));
                    _mm256_blendv_ps(outside, step, is_in)
                };
                [step(*column), step(*column + 8.0)]
            }
            Steps::Listed(steps) => bytemuck::cast(*steps),
        };
        // Packing interleaves the halves; unpacking with itself undoes that and gives each texel's two lanes.
        let alpha = _mm256_mulhrs_epi16(_mm256_packs_epi32(lookup(left), lookup(right)), opacity);
        let colours: &mut [[u8; 4]; CHUNK_PX] = &mut colours[chunk];
        let [left, right]: [__m256i; 2] = bytemuck::cast(*colours);
        let left = blend(left, _mm256_unpacklo_epi16(alpha, alpha));
        *colours = bytemuck::cast([left, blend(right, _mm256_unpackhi_epi16(alpha, alpha))]);

        let glosses: &mut [u8; CHUNK_PX] = &mut glosses[chunk];
        let old = _mm256_cvtepu8_epi16(bytemuck::cast(*glosses));
        let new = lerp(old, gloss, _mm256_permute4x64_epi64::<0b11_01_10_00>(alpha));
        let packed = _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_packus_epi16(new, new));
        *glosses = bytemuck::cast(_mm256_castsi256_si128(packed));
    });
}
