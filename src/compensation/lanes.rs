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

/// out = max(out, input + s), over whole groups.
#[inline(always)]
pub(super) fn raise(out: &mut [f32], input: &[f32], s: f32) {
    for (o, i) in out.chunks_exact_mut(LANES).zip(input.chunks_exact(LANES)) {
        for lane in 0..LANES {
            let z = i[lane] + s;
            o[lane] = if z > o[lane] { z } else { o[lane] };
        }
    }
}

/// out = max(out, a, b), over whole groups.
#[inline(always)]
pub(super) fn raise_both(out: &mut [f32], a: &[f32], b: &[f32]) {
    for ((o, a), b) in out.chunks_exact_mut(LANES).zip(a.chunks_exact(LANES)).zip(b.chunks_exact(LANES)) {
        for lane in 0..LANES {
            let z = if a[lane] > b[lane] { a[lane] } else { b[lane] };
            o[lane] = if z > o[lane] { z } else { o[lane] };
        }
    }
}

/// Defines `$name`, which runs `$body` compiled for the widest vectors this processor has.
macro_rules! widest {
    ($(#[$doc:meta])* fn $name:ident<$generic:ident: $bound:path>($($arg:ident: $kind:ty),* $(,)?) = $body:path) => {
        $(#[$doc])*
        pub(super) fn $name<$generic: $bound>($($arg: $kind),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
                fn avx512<$generic: $bound>($($arg: $kind),*) {
                    $body($($arg),*)
                }
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
                fn avx2<$generic: $bound>($($arg: $kind),*) {
                    $body($($arg),*)
                }
                if is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("fma")
                    && is_x86_feature_detected!("bmi2")
                {
                    // SAFETY: the features were found on this processor.
                    return unsafe { avx512($($arg),*) };
                }
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2") {
                    // SAFETY: the features were found on this processor.
                    return unsafe { avx2($($arg),*) };
                }
            }
            $body($($arg),*)
        }
    };
}
pub(super) use widest;
