//! Rounding without the instructions and conversions that keep a compiler from making vectors of a loop.

/// The nearest whole number, the even one of two, up to 2^51: plain x86-64 has no instruction for it.
#[inline(always)]
pub(super) fn whole(value: f64) -> f64 {
    const SHIFT: f64 = (3u64 << 51) as f64;
    (value + SHIFT) - SHIFT
}

/// A whole number from 0 up to 2^32 - 1: `as` also bounds what is none, one by one.
#[inline(always)]
pub(super) fn to_u32(whole: f64) -> u32 {
    /// Whole numbers stand in the low bits of a sum with it.
    const SHIFT: f64 = (1u64 << 52) as f64;
    (whole + SHIFT).to_bits() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_what_conversions_are() {
        for value in [0.0, 1.0, 199.0, 39_999.0, 1_048_576.0, f64::from(u32::MAX)] {
            assert_eq!(to_u32(value), value as u32);
        }
        for value in [-2.5, -0.4, 0.5, 1.5, 2.49, 1e12 + 0.5] {
            assert_eq!(whole(value), value.round_ties_even());
        }
    }
}
