//! The one inner loop, and how it is compiled for the processor at hand.
//!
//! Every kernel works on whole groups of [`LANES`] samples: a group may run past the samples it
//! is meant for, because any sample that lies under the cutter may raise the cutter, and padding
//! holds [`NONE`]. Groups leave no tails, so the same code is vectorised for any width, and
//! (max, +) in f32 gives the same bits for all of them.

/// Samples that a kernel takes at once.
pub(super) const LANES: usize = 16;

/// No data, inside kernels: far below any height, and finite, so that differences are numbers.
pub(super) const NONE: f32 = -1e30;

/// Everything below this came from [`NONE`].
pub(super) const LEAST: f32 = -1e29;

/// `count` rounded up to whole groups.
#[inline(always)]
pub(super) fn whole_groups(count: usize) -> usize {
    count.div_ceil(LANES) * LANES
}

/// A group of [`LANES`] heights and what an instruction set does with it.
///
/// Plain loops over arrays were tried: whether the compiler makes vectors of them changes with the
/// optimization level and with what they are inlined into, by a factor of ten.
pub(super) trait Vectors {
    type Group: Copy;

    fn splat(z: f32) -> Self::Group;
    fn load(z: &[f32; LANES]) -> Self::Group;
    fn store(group: Self::Group, z: &mut [f32; LANES]);
    fn add(a: Self::Group, b: Self::Group) -> Self::Group;
    fn subtract(a: Self::Group, b: Self::Group) -> Self::Group;
    fn multiply(a: Self::Group, b: Self::Group) -> Self::Group;
    /// The greater of each lane; lanes are numbers and never -0.
    fn greater(a: Self::Group, b: Self::Group) -> Self::Group;
    fn less(a: Self::Group, b: Self::Group) -> Self::Group;
    fn floor(a: Self::Group) -> Self::Group;
    fn ceil(a: Self::Group) -> Self::Group;
    /// Lanes where a >= b, as bits.
    fn at_least(a: Self::Group, b: Self::Group) -> u16;
    /// `a` in the lanes of these bits and `b` in the others.
    fn choose(bits: u16, a: Self::Group, b: Self::Group) -> Self::Group;

    /// 1 / sqrt(a) for 1e-12 <= a <= 1e31, relatively within [`Vectors::INVERSE_ERROR`].
    fn inverse_root(a: Self::Group) -> Self::Group;
    const INVERSE_ERROR: f32;

    /// Stores past the caches; `z` starts a cache line. [`Vectors::streamed`] follows before another thread looks at it.
    #[inline(always)]
    fn stream(group: Self::Group, z: &mut [f32; LANES]) {
        Self::store(group, z);
    }

    /// Waits for what was streamed.
    #[inline(always)]
    fn streamed() {}

    /// Asks for what will be read soon.
    #[inline(always)]
    fn fetch(_: &f32) {}

    /// Does some work in a function of its own, compiled for the same processor: it stands once in the program, not
    /// wherever it is called.
    fn apart<W: Work<Self>>(work: W) -> W::Done
    where
        Self: Sized;

    /// The least of all lanes.
    #[inline(always)]
    fn least(a: Self::Group) -> f32 {
        let mut lanes = [0.0; LANES];
        Self::store(a, &mut lanes);
        lanes.iter().fold(f32::MAX, |m, &z| if z < m { z } else { m })
    }

    /// The greatest of all lanes.
    #[inline(always)]
    fn most(a: Self::Group) -> f32 {
        let mut lanes = [0.0; LANES];
        Self::store(a, &mut lanes);
        lanes.iter().fold(f32::MIN, |m, &z| if z > m { z } else { m })
    }
}

/// Something to do with these vectors.
pub(super) trait Work<V> {
    type Done;

    fn run(self) -> Self::Done;
}

/// Any processor.
pub(super) struct Portable;

impl Vectors for Portable {
    type Group = [f32; LANES];

    #[inline(always)]
    fn splat(z: f32) -> Self::Group {
        [z; LANES]
    }

    #[inline(always)]
    fn load(z: &[f32; LANES]) -> Self::Group {
        *z
    }

    #[inline(always)]
    fn store(group: Self::Group, z: &mut [f32; LANES]) {
        *z = group;
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
    fn floor(a: Self::Group) -> Self::Group {
        a.map(f32::floor)
    }

    #[inline(always)]
    fn ceil(a: Self::Group) -> Self::Group {
        a.map(f32::ceil)
    }

    #[inline(always)]
    fn at_least(a: Self::Group, b: Self::Group) -> u16 {
        (0..LANES).fold(0, |bits, lane| bits | u16::from(a[lane] >= b[lane]) << lane)
    }

    #[inline(always)]
    fn choose(bits: u16, a: Self::Group, b: Self::Group) -> Self::Group {
        std::array::from_fn(|lane| if bits >> lane & 1 == 1 { a[lane] } else { b[lane] })
    }

    #[inline(never)]
    fn apart<W: Work<Self>>(work: W) -> W::Done {
        work.run()
    }

    const INVERSE_ERROR: f32 = 1e-6;

    #[inline(always)]
    fn inverse_root(a: Self::Group) -> Self::Group {
        a.map(|a| 1.0 / a.sqrt())
    }
}

/// The whole groups of a slice.
#[inline(always)]
pub(super) fn groups(z: &[f32]) -> &[[f32; LANES]] {
    z.as_chunks().0
}

/// The whole groups of a slice, to write.
#[inline(always)]
pub(super) fn groups_mut(z: &mut [f32]) -> &mut [[f32; LANES]] {
    z.as_chunks_mut().0
}

/// out = max(a, b), over whole groups.
#[inline(always)]
pub(super) fn higher<V: Vectors>(out: &mut [f32], a: &[f32], b: &[f32]) {
    for ((out, a), b) in groups_mut(out).iter_mut().zip(groups(a)).zip(groups(b)) {
        V::store(V::greater(V::load(a), V::load(b)), out);
    }
}

/// Defines `$name`, which runs the generic function `$body::<V, P>` with the widest vectors that
/// this processor has.
macro_rules! widest {
    ($(#[$doc:meta])* fn $name:ident<$($generic:ident: $bound:path)?>($($arg:ident: $kind:ty),* $(,)?) = $body:ident) => {
        $(#[$doc])*
        pub(super) fn $name<$($generic: $bound)?>($($arg: $kind),*) {
            #[cfg(target_arch = "x86_64")]
            {
                use $crate::compensation::x86::{Avx2, Avx512};
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,bmi1,bmi2,lzcnt,popcnt")]
                fn avx512<$($generic: $bound)?>($($arg: $kind),*) {
                    $body::<Avx512 $(, $generic)?>($($arg),*)
                }
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
                fn avx2<$($generic: $bound)?>($($arg: $kind),*) {
                    $body::<Avx2 $(, $generic)?>($($arg),*)
                }
                let with_avx2 = is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("bmi2")
                    && is_x86_feature_detected!("lzcnt");
                if with_avx2
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
                {
                    // SAFETY: the features were found on this processor.
                    return unsafe { avx512($($arg),*) };
                }
                if with_avx2 {
                    // SAFETY: the features were found on this processor.
                    return unsafe { avx2($($arg),*) };
                }
            }
            $body::<$crate::compensation::lanes::Portable $(, $generic)?>($($arg),*)
        }
    };
}
pub(super) use widest;
