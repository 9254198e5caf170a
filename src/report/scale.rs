//! Ranges, round ticks and the unit that reads best.

/// 1, 2 or 5 times a power of ten, at least `value`.
pub fn round_up(value: f64) -> f64 {
    if value.is_nan() || value <= 0.0 {
        return 1.0;
    }
    let power = 10f64.powi(value.log10().floor() as i32);
    // The slack keeps 0.02 at 0.02 although its quotient by 0.01 is a bit more than 2.
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| value <= factor * power * (1.0 + 1e-9));
    factor.unwrap_or(10.0) * power
}

/// A range in mm, spread evenly or by the square root of the distance from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    pub low_mm: f64,
    pub high_mm: f64,
    /// Shows micrometres beside tenths of a millimetre: colours go by the square root.
    pub by_root: bool,
    pub quantity: Quantity,
}

/// What the figures of a scale are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    Length,
    /// Parts of a whole.
    Part,
    Degrees,
}

impl Scale {
    /// The lowest and highest value that are left when 0.2 % at either end is passed over, at least 0.1 um apart.
    pub fn robust(values: &[f32]) -> Scale {
        let sorted = sorted(values.iter().copied());
        let low_mm = quantile(&sorted, 0.002);
        let high_mm = quantile(&sorted, 0.998);
        let lack_mm = 0.5 * (1e-4 - (high_mm - low_mm)).max(0.0);
        Scale {
            low_mm: low_mm - lack_mm,
            high_mm: high_mm + lack_mm,
            by_root: false,
            quantity: Quantity::Length,
        }
    }

    /// From 0 to a round figure that 99.5 % of the values above `floor_mm` stay below.
    pub fn from_zero(values: &[f32], floor_mm: f32) -> Scale {
        let sorted = sorted(values.iter().copied().filter(|&value| value > floor_mm));
        let high_mm = round_up(quantile(&sorted, 0.995).max(1e-4));
        Scale { low_mm: 0.0, high_mm, by_root: true, quantity: Quantity::Length }
    }

    /// Parts of a whole from 0 to a round figure that 99.5 % of the values stay below, 1 at most.
    pub fn parts(values: &[f32]) -> Scale {
        let high_mm = Scale::from_zero(values, 0.0).high_mm.clamp(1e-3, 1.0);
        Scale { low_mm: 0.0, high_mm, by_root: true, quantity: Quantity::Part }
    }

    /// Degrees from 0 to a round figure that 99.5 % of the values stay below.
    pub fn degrees(values: &[f32]) -> Scale {
        let high_mm = Scale::from_zero(values, 0.0).high_mm.max(0.01);
        Scale { low_mm: 0.0, high_mm, by_root: true, quantity: Quantity::Degrees }
    }

    /// As far below 0 as above, to a round figure that 99.5 % of |values| stay below.
    pub fn about_zero(values: &[f32]) -> Scale {
        let sorted = sorted(values.iter().map(|value| value.abs()));
        let high_mm = round_up(quantile(&sorted, 0.995).max(1e-4));
        Scale { low_mm: -high_mm, high_mm, by_root: true, quantity: Quantity::Length }
    }

    /// Where a value stands between the ends, 0 to 1 within them.
    pub fn place(&self, value_mm: f64) -> f64 {
        let spread = |mm: f64| if self.by_root { mm.signum() * mm.abs().sqrt() } else { mm };
        (spread(value_mm) - spread(self.low_mm)) / (spread(self.high_mm) - spread(self.low_mm))
    }

    /// Name of the unit and how many of it make a millimetre.
    pub fn unit(&self) -> (&'static str, f64) {
        match self.quantity {
            Quantity::Part => return ("%", 100.0),
            Quantity::Degrees => return ("degrees", 1.0),
            Quantity::Length => {}
        }
        if self.low_mm.abs().max(self.high_mm.abs()) < 0.9 { ("µm", 1000.0) } else { ("mm", 1.0) }
    }

    /// Round values within the range, in mm, at most about `count` of them, labelled in the range's unit.
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        let (_, per_mm) = self.unit();
        if self.by_root {
            let up = [0.0, 0.05, 0.2, 0.5, 1.0];
            let down = up.iter().rev().take(if self.low_mm < 0.0 { 4 } else { 0 }).map(|part| -part);
            let values = down.chain(up).map(|part| part * self.high_mm);
            // Six decimals hide the last bit of 0.2 * 0.05.
            let label = |mm: f64| format!("{}", (mm * per_mm * 1e6).round() / 1e6).replace('-', "\u{2212}");
            return values.map(|mm| (mm, label(mm))).collect();
        }
        let ticks = ticks(self.low_mm * per_mm, self.high_mm * per_mm, count);
        ticks.into_iter().map(|(value, label)| (value / per_mm, label)).collect()
    }
}

/// Round values from `low` to `high` with their labels, at most about `count` of them.
pub fn ticks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let step = round_up((high - low) / count.max(1) as f64);
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    // The slack keeps an end that is round itself.
    let first = (low / step - 1e-6).ceil() as i64;
    let last = (high / step + 1e-6).floor() as i64;
    let label = |value: f64| format!("{value:.decimals$}").replace('-', "\u{2212}");
    (first..=last).map(|index| index as f64 * step).map(|value| (value, label(value))).collect()
}

fn sorted(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut values: Vec<f32> = values.filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    values
}

fn quantile(sorted: &[f32], fraction: f64) -> f64 {
    let index = (fraction * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(index).map_or(0.0, |&value| f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_round_up_to_one_two_five() {
        for (value, rounded) in
            [(0.02, 0.02), (0.0201, 0.05), (3.0, 5.0), (7.0, 10.0), (1.0, 1.0), (0.0, 1.0)]
        {
            assert!((round_up(value) / rounded - 1.0).abs() < 1e-9, "{value}");
        }
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let scale = Scale { low_mm: -0.02, high_mm: 0.02, by_root: false, quantity: Quantity::Length };
        let labels: Vec<String> = scale.ticks(4).into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels, ["\u{2212}20", "\u{2212}10", "0", "10", "20"]);
        assert_eq!(scale.unit().0, "µm");
        let labels: Vec<String> =
            Scale { by_root: true, ..scale }.ticks(4).into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels, ["\u{2212}20", "\u{2212}10", "\u{2212}4", "\u{2212}1", "0", "1", "4", "10", "20"]);
        let places = [-0.02, -0.005, 0.0, 0.005, 0.02].map(|mm| Scale { by_root: true, ..scale }.place(mm));
        assert_eq!(places, [0.0, 0.25, 0.5, 0.75, 1.0]);
    }
}
