//! Groups of lanes on x86.

use super::lanes::{LANES, Vectors, Work};
use std::arch::x86_64 as x86;

/// x86 with 256 bits; only for code that is compiled for and run on such a processor.
pub(super) struct Avx2;

// SAFETY of every block in this and the next impl: the instructions are there, because [`widest`]
// runs this code only where the processor was found to have them; loads and stores are of whole
// arrays behind references and need no alignment.
impl Vectors for Avx2 {
    type Group = [x86::__m256; 2];

    #[inline(always)]
    fn splat(z: f32) -> Self::Group {
        unsafe { [x86::_mm256_set1_ps(z); 2] }
    }

    #[inline(always)]
    fn load(z: &[f32; LANES]) -> Self::Group {
        unsafe { [x86::_mm256_loadu_ps(z.as_ptr()), x86::_mm256_loadu_ps(z.as_ptr().add(8))] }
    }

    #[inline(always)]
    fn store(group: Self::Group, z: &mut [f32; LANES]) {
        unsafe {
            x86::_mm256_storeu_ps(z.as_mut_ptr(), group[0]);
            x86::_mm256_storeu_ps(z.as_mut_ptr().add(8), group[1]);
        }
    }

    #[inline(always)]
    fn add(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_add_ps(a[0], b[0]), x86::_mm256_add_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn subtract(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_sub_ps(a[0], b[0]), x86::_mm256_sub_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn multiply(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_mul_ps(a[0], b[0]), x86::_mm256_mul_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn greater(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_max_ps(a[0], b[0]), x86::_mm256_max_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn less(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_min_ps(a[0], b[0]), x86::_mm256_min_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn floor(a: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_floor_ps(a[0]), x86::_mm256_floor_ps(a[1])] }
    }

    #[inline(always)]
    fn ceil(a: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_ceil_ps(a[0]), x86::_mm256_ceil_ps(a[1])] }
    }

    #[inline(always)]
    fn at_least(a: Self::Group, b: Self::Group) -> u16 {
        let half = |a, b| unsafe { x86::_mm256_movemask_ps(x86::_mm256_cmp_ps::<{ x86::_CMP_GE_OQ }>(a, b)) };
        half(a[0], b[0]) as u16 | (half(a[1], b[1]) as u16) << 8
    }

    #[inline(always)]
    fn choose(bits: u16, a: Self::Group, b: Self::Group) -> Self::Group {
        let half = |bits: i32, a, b| unsafe {
            let lanes = x86::_mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let chosen = x86::_mm256_and_si256(x86::_mm256_set1_epi32(bits), lanes);
            let chosen = x86::_mm256_castsi256_ps(x86::_mm256_cmpeq_epi32(chosen, lanes));
            x86::_mm256_blendv_ps(b, a, chosen)
        };
        [half(i32::from(bits), a[0], b[0]), half(i32::from(bits >> 8), a[1], b[1])]
    }

    #[inline(always)]
    fn streamed() {
        unsafe { x86::_mm_sfence() }
    }

    #[inline(always)]
    fn fetch(z: &f32) {
        unsafe { x86::_mm_prefetch::<{ x86::_MM_HINT_T1 }>(std::ptr::from_ref(z).cast()) }
    }

    #[inline(always)]
    fn stream(group: Self::Group, z: &mut [f32; LANES]) {
        assert!(z.as_ptr().addr().is_multiple_of(size_of_val(z)));
        unsafe {
            x86::_mm256_stream_ps(z.as_mut_ptr(), group[0]);
            x86::_mm256_stream_ps(z.as_mut_ptr().add(8), group[1]);
        }
    }

    #[inline(always)]
    fn apart<W: Work<Self>>(work: W) -> W::Done {
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        #[inline(never)]
        fn run<W: Work<Avx2>>(work: W) -> W::Done {
            work.run()
        }
        unsafe { run(work) }
    }

    const INVERSE_ERROR: f32 = 4e-4;

    #[inline(always)]
    fn inverse_root(a: Self::Group) -> Self::Group {
        unsafe { [x86::_mm256_rsqrt_ps(a[0]), x86::_mm256_rsqrt_ps(a[1])] }
    }
}

/// x86 with 512 bits; as [`Avx2`].
pub(super) struct Avx512;

impl Vectors for Avx512 {
    type Group = x86::__m512;

    #[inline(always)]
    fn splat(z: f32) -> Self::Group {
        unsafe { x86::_mm512_set1_ps(z) }
    }

    #[inline(always)]
    fn load(z: &[f32; LANES]) -> Self::Group {
        unsafe { x86::_mm512_loadu_ps(z.as_ptr()) }
    }

    #[inline(always)]
    fn store(group: Self::Group, z: &mut [f32; LANES]) {
        unsafe { x86::_mm512_storeu_ps(z.as_mut_ptr(), group) }
    }

    #[inline(always)]
    fn add(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_add_ps(a, b) }
    }

    #[inline(always)]
    fn subtract(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_sub_ps(a, b) }
    }

    #[inline(always)]
    fn multiply(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_mul_ps(a, b) }
    }

    #[inline(always)]
    fn greater(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_max_ps(a, b) }
    }

    #[inline(always)]
    fn less(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_min_ps(a, b) }
    }

    #[inline(always)]
    fn floor(a: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_roundscale_ps::<{ x86::_MM_FROUND_TO_NEG_INF | x86::_MM_FROUND_NO_EXC }>(a) }
    }

    #[inline(always)]
    fn ceil(a: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_roundscale_ps::<{ x86::_MM_FROUND_TO_POS_INF | x86::_MM_FROUND_NO_EXC }>(a) }
    }

    #[inline(always)]
    fn at_least(a: Self::Group, b: Self::Group) -> u16 {
        unsafe { x86::_mm512_cmp_ps_mask::<{ x86::_CMP_GE_OQ }>(a, b) }
    }

    #[inline(always)]
    fn choose(bits: u16, a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_mask_blend_ps(bits, b, a) }
    }

    #[inline(always)]
    fn streamed() {
        unsafe { x86::_mm_sfence() }
    }

    #[inline(always)]
    fn fetch(z: &f32) {
        unsafe { x86::_mm_prefetch::<{ x86::_MM_HINT_T1 }>(std::ptr::from_ref(z).cast()) }
    }

    #[inline(always)]
    fn stream(group: Self::Group, z: &mut [f32; LANES]) {
        assert!(z.as_ptr().addr().is_multiple_of(size_of_val(z)));
        unsafe { x86::_mm512_stream_ps(z.as_mut_ptr().cast(), group) }
    }

    #[inline(always)]
    fn apart<W: Work<Self>>(work: W) -> W::Done {
        #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,bmi1,bmi2,lzcnt,popcnt")]
        #[inline(never)]
        fn run<W: Work<Avx512>>(work: W) -> W::Done {
            work.run()
        }
        unsafe { run(work) }
    }

    const INVERSE_ERROR: f32 = 1e-4;

    #[inline(always)]
    fn inverse_root(a: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_rsqrt14_ps(a) }
    }

    #[inline(always)]
    fn least(a: Self::Group) -> f32 {
        unsafe { x86::_mm512_reduce_min_ps(a) }
    }

    #[inline(always)]
    fn most(a: Self::Group) -> f32 {
        unsafe { x86::_mm512_reduce_max_ps(a) }
    }
}
