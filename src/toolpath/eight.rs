//! Eight doubles at once, for the processor at hand: the same arithmetic on each, so that the bits of the answer are
//! the same too.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64 as x86;

/// Lanes of a group.
pub(super) const EIGHT: usize = 8;

/// An instruction set.
pub(super) trait Eight {
    type Group: Copy;

    fn splat(a: f64) -> Self::Group;
    fn load(a: &[f64; EIGHT]) -> Self::Group;
    fn store(group: Self::Group, a: &mut [f64; EIGHT]);
    fn add(a: Self::Group, b: Self::Group) -> Self::Group;
    fn subtract(a: Self::Group, b: Self::Group) -> Self::Group;
    fn multiply(a: Self::Group, b: Self::Group) -> Self::Group;
    /// The greater of each lane; lanes are numbers.
    fn greater(a: Self::Group, b: Self::Group) -> Self::Group;
    fn less(a: Self::Group, b: Self::Group) -> Self::Group;
    /// Of these lanes, as bits, those where a < b.
    fn is_less(bits: u8, a: Self::Group, b: Self::Group) -> u8;
    /// Those where low <= a <= high.
    fn within(bits: u8, low: Self::Group, a: Self::Group, high: Self::Group) -> u8;
    /// `a` in the lanes of these bits and `b` in the others.
    fn choose(bits: u8, a: Self::Group, b: Self::Group) -> Self::Group;
    /// Writes `value` to the lanes of these bits.
    fn mark(to: &mut [u32; EIGHT], bits: u8, value: u32);
    /// Each lane moved on by one, the first from `before`, all of whose lanes are alike.
    fn after(a: Self::Group, before: Self::Group) -> Self::Group;
    /// The same by two lanes.
    fn after2(a: Self::Group, before: Self::Group) -> Self::Group;
    /// The same by four.
    fn after4(a: Self::Group, before: Self::Group) -> Self::Group;
    /// The last lane in all.
    fn last(a: Self::Group) -> Self::Group;

    #[inline(always)]
    fn lane(a: Self::Group, lane: usize) -> f64 {
        let mut all = [0.0; EIGHT];
        Self::store(a, &mut all);
        all[lane]
    }
}

/// Any processor.
pub(super) struct Portable;

#[inline(always)]
fn moved<const BY: usize>(a: [f64; EIGHT], before: [f64; EIGHT]) -> [f64; EIGHT] {
    std::array::from_fn(|lane| if lane < BY { before[lane] } else { a[lane - BY] })
}

impl Eight for Portable {
    type Group = [f64; EIGHT];

    #[inline(always)]
    fn splat(a: f64) -> Self::Group {
        [a; EIGHT]
    }

    #[inline(always)]
    fn load(a: &[f64; EIGHT]) -> Self::Group {
        *a
    }

    #[inline(always)]
    fn store(group: Self::Group, a: &mut [f64; EIGHT]) {
        *a = group;
    }

    #[inline(always)]
    fn add(a: Self::Group, b: Self::Group) -> Self::Group {
        std::array::from_fn(|lane| a[lane] + b[lane])
    }

    #[inline(always)]
    fn subtract(a: Self::Group, b: Self::Group) -> Self::Group {
        std::array::from_fn(|lane| a[lane] - b[lane])
    }

    #[inline(always)]
    fn multiply(a: Self::Group, b: Self::Group) -> Self::Group {
        std::array::from_fn(|lane| a[lane] * b[lane])
    }

    #[inline(always)]
    fn greater(a: Self::Group, b: Self::Group) -> Self::Group {
        std::array::from_fn(|lane| if a[lane] > b[lane] { a[lane] } else { b[lane] })
    }

    #[inline(always)]
    fn less(a: Self::Group, b: Self::Group) -> Self::Group {
        std::array::from_fn(|lane| if a[lane] < b[lane] { a[lane] } else { b[lane] })
    }

    #[inline(always)]
    fn is_less(bits: u8, a: Self::Group, b: Self::Group) -> u8 {
        (0..EIGHT).fold(0, |found, lane| found | u8::from(a[lane] < b[lane]) << lane) & bits
    }

    #[inline(always)]
    fn within(bits: u8, low: Self::Group, a: Self::Group, high: Self::Group) -> u8 {
        let inside = |lane: usize| u8::from(low[lane] <= a[lane] && a[lane] <= high[lane]) << lane;
        (0..EIGHT).fold(0, |found, lane| found | inside(lane)) & bits
    }

    #[inline(always)]
    fn choose(bits: u8, a: Self::Group, b: Self::Group) -> Self::Group {
        std::array::from_fn(|lane| if bits >> lane & 1 == 1 { a[lane] } else { b[lane] })
    }

    #[inline(always)]
    fn mark(to: &mut [u32; EIGHT], bits: u8, value: u32) {
        for (lane, to) in to.iter_mut().enumerate() {
            *to = if bits >> lane & 1 == 1 { value } else { *to };
        }
    }

    #[inline(always)]
    fn after(a: Self::Group, before: Self::Group) -> Self::Group {
        moved::<1>(a, before)
    }

    #[inline(always)]
    fn after2(a: Self::Group, before: Self::Group) -> Self::Group {
        moved::<2>(a, before)
    }

    #[inline(always)]
    fn after4(a: Self::Group, before: Self::Group) -> Self::Group {
        moved::<4>(a, before)
    }

    #[inline(always)]
    fn last(a: Self::Group) -> Self::Group {
        [a[EIGHT - 1]; EIGHT]
    }
}

/// x86 with 512 bits; only for code that is compiled for and run on such a processor.
#[cfg(target_arch = "x86_64")]
pub(super) struct Avx512;

// SAFETY of every block: the instructions are there, because this code is run only where the processor was found to
// have them; loads and stores are of whole arrays behind references and need no alignment.
#[cfg(target_arch = "x86_64")]
impl Eight for Avx512 {
    type Group = x86::__m512d;

    #[inline(always)]
    fn splat(a: f64) -> Self::Group {
        unsafe { x86::_mm512_set1_pd(a) }
    }

    #[inline(always)]
    fn load(a: &[f64; EIGHT]) -> Self::Group {
        unsafe { x86::_mm512_loadu_pd(a.as_ptr()) }
    }

    #[inline(always)]
    fn store(group: Self::Group, a: &mut [f64; EIGHT]) {
        unsafe { x86::_mm512_storeu_pd(a.as_mut_ptr(), group) }
    }

    #[inline(always)]
    fn add(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_add_pd(a, b) }
    }

    #[inline(always)]
    fn subtract(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_sub_pd(a, b) }
    }

    #[inline(always)]
    fn multiply(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_mul_pd(a, b) }
    }

    #[inline(always)]
    fn greater(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_max_pd(a, b) }
    }

    #[inline(always)]
    fn less(a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_min_pd(a, b) }
    }

    #[inline(always)]
    fn is_less(bits: u8, a: Self::Group, b: Self::Group) -> u8 {
        unsafe { x86::_mm512_mask_cmp_pd_mask::<{ x86::_CMP_LT_OQ }>(bits, a, b) }
    }

    #[inline(always)]
    fn within(bits: u8, low: Self::Group, a: Self::Group, high: Self::Group) -> u8 {
        unsafe {
            let above = x86::_mm512_mask_cmp_pd_mask::<{ x86::_CMP_LE_OQ }>(bits, low, a);
            x86::_mm512_mask_cmp_pd_mask::<{ x86::_CMP_LE_OQ }>(above, a, high)
        }
    }

    #[inline(always)]
    fn choose(bits: u8, a: Self::Group, b: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_mask_blend_pd(bits, b, a) }
    }

    #[inline(always)]
    fn mark(to: &mut [u32; EIGHT], bits: u8, value: u32) {
        unsafe {
            x86::_mm256_mask_storeu_epi32(
                to.as_mut_ptr().cast(),
                bits,
                x86::_mm256_set1_epi32(value.cast_signed()),
            )
        }
    }

    #[inline(always)]
    fn after(a: Self::Group, before: Self::Group) -> Self::Group {
        moved_on::<7>(a, before)
    }

    #[inline(always)]
    fn after2(a: Self::Group, before: Self::Group) -> Self::Group {
        moved_on::<6>(a, before)
    }

    #[inline(always)]
    fn after4(a: Self::Group, before: Self::Group) -> Self::Group {
        moved_on::<4>(a, before)
    }

    #[inline(always)]
    fn last(a: Self::Group) -> Self::Group {
        unsafe { x86::_mm512_permutexvar_pd(x86::_mm512_set1_epi64(7), a) }
    }
}

/// The lanes of `before` and `a` in a row, from this one on.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn moved_on<const FROM: i32>(a: x86::__m512d, before: x86::__m512d) -> x86::__m512d {
    unsafe {
        let (a, before) = (x86::_mm512_castpd_si512(a), x86::_mm512_castpd_si512(before));
        x86::_mm512_castsi512_pd(x86::_mm512_alignr_epi64::<FROM>(a, before))
    }
}
