//! The one comparison that the sweep makes for every sample that it looks at, and how it is compiled for the processor
//! at hand. Everything else is the same arithmetic on every processor, so that the bits of the answer are too.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64 as x86;

/// Samples that are looked at together.
pub(super) const GROUP: usize = 16;

/// An instruction set.
pub(super) trait Above {
    /// The samples, as bits, at which `z - floor > over`. What is not a number is above nothing.
    fn above(z: &[f32; GROUP], floor: &[f32; GROUP], over: f32) -> u16;
}

/// Any processor.
pub(super) struct Portable;

impl Above for Portable {
    #[inline(always)]
    fn above(z: &[f32; GROUP], floor: &[f32; GROUP], over: f32) -> u16 {
        (0..GROUP).fold(0, |bits, k| bits | u16::from(z[k] - floor[k] > over) << k)
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
}
