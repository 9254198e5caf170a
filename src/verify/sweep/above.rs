//! What the sweep does with every sample that it looks at, for the processor at hand: the same arithmetic on each, so
//! that the bits of the answer are the same too.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64 as x86;

/// Samples that are looked at together.
pub(super) const GROUP: usize = 16;

/// An instruction set.
pub(super) trait Above {
    /// The samples, as bits, at which `z - floor > over`. What is not a number is above nothing.
    fn above(z: &[f32; GROUP], floor: &[f32; GROUP], over: f32) -> u16;
    /// Takes the lower of z and `new` for the samples of these bits. What is not a number stays.
    fn lower(z: &mut [f32; GROUP], new: &[f32; GROUP], bits: u16);
    /// `level + ramp`, rounded to floats.
    fn line(level: f64, ramp: &[f64; GROUP]) -> [f32; GROUP];
    /// The lanes, as bits, whose range holds `at`.
    fn holding(first: &[i32; GROUP], end: &[i32; GROUP], at: i32) -> u16;
}

/// Any processor.
pub(super) struct Portable;

impl Above for Portable {
    #[inline(always)]
    fn above(z: &[f32; GROUP], floor: &[f32; GROUP], over: f32) -> u16 {
        (0..GROUP).fold(0, |bits, k| bits | u16::from(z[k] - floor[k] > over) << k)
    }

    #[inline(always)]
    fn lower(z: &mut [f32; GROUP], new: &[f32; GROUP], bits: u16) {
        for k in 0..GROUP {
            z[k] = if bits >> k & 1 == 1 && new[k] < z[k] { new[k] } else { z[k] };
        }
    }

    #[inline(always)]
    fn line(level: f64, ramp: &[f64; GROUP]) -> [f32; GROUP] {
        ramp.map(|ramp| (level + ramp) as f32)
    }

    #[inline(always)]
    fn holding(first: &[i32; GROUP], end: &[i32; GROUP], at: i32) -> u16 {
        (0..GROUP).fold(0, |bits, k| bits | u16::from(first[k] <= at && at < end[k]) << k)
    }
}

// SAFETY of both: [`widest`] comes here only where the processor has the instructions; loads are of whole arrays
// behind references and need no alignment.

/// x86 with 256 bits.
#[cfg(target_arch = "x86_64")]
pub(super) struct Avx2;

#[cfg(target_arch = "x86_64")]
impl Above for Avx2 {
    #[inline(always)]
    fn above(z: &[f32; GROUP], floor: &[f32; GROUP], over: f32) -> u16 {
        let half = |at: usize| unsafe {
            let [z, floor] = [z, floor].map(|values| x86::_mm256_loadu_ps(values.as_ptr().add(at)));
            let over = x86::_mm256_set1_ps(over);
            x86::_mm256_movemask_ps(x86::_mm256_cmp_ps::<{ x86::_CMP_GT_OQ }>(
                x86::_mm256_sub_ps(z, floor),
                over,
            ))
        };
        half(0) as u16 | (half(8) as u16) << 8
    }

    #[inline(always)]
    fn lower(z: &mut [f32; GROUP], new: &[f32; GROUP], bits: u16) {
        let half = |at: usize, bits: i32| unsafe {
            let lanes = x86::_mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let meant = x86::_mm256_and_si256(x86::_mm256_set1_epi32(bits), lanes);
            let meant = x86::_mm256_castsi256_ps(x86::_mm256_cmpeq_epi32(meant, lanes));
            let (old, new) =
                (x86::_mm256_loadu_ps(z.as_ptr().add(at)), x86::_mm256_loadu_ps(new.as_ptr().add(at)));
            // Of two that do not compare this gives the second.
            let least = x86::_mm256_min_ps(new, old);
            x86::_mm256_blendv_ps(old, least, meant)
        };
        let halves = [half(0, i32::from(bits & 0xff)), half(8, i32::from(bits >> 8))];
        unsafe {
            x86::_mm256_storeu_ps(z.as_mut_ptr(), halves[0]);
            x86::_mm256_storeu_ps(z.as_mut_ptr().add(8), halves[1]);
        }
    }

    #[inline(always)]
    fn line(level: f64, ramp: &[f64; GROUP]) -> [f32; GROUP] {
        let mut out = [0.0; GROUP];
        for at in (0..GROUP).step_by(4) {
            unsafe {
                let sum = x86::_mm256_add_pd(
                    x86::_mm256_set1_pd(level),
                    x86::_mm256_loadu_pd(ramp.as_ptr().add(at)),
                );
                x86::_mm_storeu_ps(out.as_mut_ptr().add(at), x86::_mm256_cvtpd_ps(sum));
            }
        }
        out
    }

    #[inline(always)]
    fn holding(first: &[i32; GROUP], end: &[i32; GROUP], at: i32) -> u16 {
        let half = |from: usize| unsafe {
            let load = |values: &[i32; GROUP]| x86::_mm256_loadu_si256(values.as_ptr().add(from).cast());
            let at = x86::_mm256_set1_epi32(at);
            let early = x86::_mm256_cmpgt_epi32(load(first), at);
            let inside = x86::_mm256_andnot_si256(early, x86::_mm256_cmpgt_epi32(load(end), at));
            x86::_mm256_movemask_ps(x86::_mm256_castsi256_ps(inside))
        };
        half(0) as u16 | (half(8) as u16) << 8
    }
}

/// x86 with 512 bits.
#[cfg(target_arch = "x86_64")]
pub(super) struct Avx512;

#[cfg(target_arch = "x86_64")]
impl Above for Avx512 {
    #[inline(always)]
    fn above(z: &[f32; GROUP], floor: &[f32; GROUP], over: f32) -> u16 {
        unsafe {
            let [z, floor] = [z, floor].map(|values| x86::_mm512_loadu_ps(values.as_ptr()));
            let over = x86::_mm512_set1_ps(over);
            x86::_mm512_cmp_ps_mask::<{ x86::_CMP_GT_OQ }>(x86::_mm512_sub_ps(z, floor), over)
        }
    }

    #[inline(always)]
    fn lower(z: &mut [f32; GROUP], new: &[f32; GROUP], bits: u16) {
        unsafe {
            let (old, new) = (x86::_mm512_loadu_ps(z.as_ptr()), x86::_mm512_loadu_ps(new.as_ptr()));
            // Of two that do not compare this gives the second.
            x86::_mm512_storeu_ps(z.as_mut_ptr(), x86::_mm512_mask_min_ps(old, bits, new, old));
        }
    }

    #[inline(always)]
    fn line(level: f64, ramp: &[f64; GROUP]) -> [f32; GROUP] {
        let mut out = [0.0; GROUP];
        for at in [0, 8] {
            unsafe {
                let sum = x86::_mm512_add_pd(
                    x86::_mm512_set1_pd(level),
                    x86::_mm512_loadu_pd(ramp.as_ptr().add(at)),
                );
                x86::_mm256_storeu_ps(out.as_mut_ptr().add(at), x86::_mm512_cvtpd_ps(sum));
            }
        }
        out
    }

    #[inline(always)]
    fn holding(first: &[i32; GROUP], end: &[i32; GROUP], at: i32) -> u16 {
        unsafe {
            let load = |values: &[i32; GROUP]| x86::_mm512_loadu_si512(values.as_ptr().cast());
            let at = x86::_mm512_set1_epi32(at);
            x86::_mm512_cmple_epi32_mask(load(first), at) & x86::_mm512_cmpgt_epi32_mask(load(end), at)
        }
    }
}

/// The lanes, as bits, from `first` on and before `end`, where lane 0 stands at `at`.
#[inline(always)]
pub(super) fn lanes(first: i32, end: i32, at: i32) -> u16 {
    let below = |place: i32| (1u32 << (place - at).clamp(0, GROUP as i32)) - 1;
    (below(end) & !below(first)) as u16
}
