//! Numbers as a controller reads them, from whole counts: nothing is rounded here.

use super::dialect::{LengthUnit, Number, Point};

/// How many last decimals one unit of the grid is; None if it is no whole number of them.
pub(super) fn decimal_steps(word: &Number, unit_mm: f64) -> Option<i64> {
    match word.unit {
        LengthUnit::Grid => Some(1),
        LengthUnit::Mm => {
            let steps = unit_mm * 10f64.powi(word.decimals as i32);
            // unit_mm is a decimal number read into binary: 0.0001 * 1e4 is 1 but for the last bit.
            let whole = steps.round();
            (whole >= 1.0 && (steps - whole).abs() < 1e-9 * whole).then_some(whole as i64)
        }
    }
}

/// `count` last decimals, exactly: 1500 with three decimals is 1.5.
pub(super) fn number(count: i64, decimals: u32, point: Point) -> String {
    let mut bytes = Vec::new();
    push_number(&mut bytes, count, decimals, point);
    bytes.into_iter().map(char::from).collect()
}

/// As [`number`], at the end of a line.
pub(super) fn push_number(line: &mut Vec<u8>, count: i64, decimals: u32, point: Point) {
    let mut digits = [b'0'; 32];
    let mut rest = count.unsigned_abs();
    let mut start = digits.len();
    while rest > 0 {
        start -= 1;
        digits[start] = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    if count < 0 {
        line.push(b'-');
    }
    let split = digits.len() - decimals as usize;
    line.extend_from_slice(if start < split { &digits[start..split] } else { b"0" });
    let zeros = digits[split..].iter().rev().take_while(|&&b| b == b'0').count();
    let fraction = &digits[split..digits.len() - zeros];
    if !fraction.is_empty() {
        line.push(b'.');
        line.extend_from_slice(fraction);
    } else if point == Point::Always {
        line.extend_from_slice(if decimals > 0 { b".0" } else { b"." });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spelled_from_whole_counts() {
        let cases = [
            (0, 4, Point::Fraction, "0"),
            (-1, 4, Point::Fraction, "-0.0001"),
            (15_000, 4, Point::Fraction, "1.5"),
            (-123_456_789, 4, Point::Fraction, "-12345.6789"),
            (30, 1, Point::Always, "3.0"),
            (53, 1, Point::Always, "5.3"),
            (8, 0, Point::Always, "8."),
            (-2_147_483_648, 0, Point::Fraction, "-2147483648"),
        ];
        for (count, decimals, point, text) in cases {
            assert_eq!(number(count, decimals, point), text);
        }
    }
}
