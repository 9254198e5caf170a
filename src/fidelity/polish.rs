//! What polishing by hand could take off: a model, to be read beside the unpolished cut, never instead of it.
//!
//! A soft pad rests on what stands over its surroundings, so that edges and scallops go first. With p the height of a
//! sample over the mean of the square of 0.2 mm around it, a(1 - exp(-p / a)) is removed where p > 0: all of what is
//! far lower than the removal a, and a itself where much stands out. On a surface of radius R, p is (0.1 mm)^2 / (3 R),
//! so removal grows with curvature too. Grooves keep their depth. What the model leaves out: the direction of
//! strokes, pads of other sizes, roughness that polishing takes away or brings, and metal that is smeared.

use crate::grid::Heights;

/// Half the side of the square that a sample is compared with.
pub const PAD_MM: f64 = 0.1;

/// Samples from a sample to the border of its square.
pub fn reach(step_mm: f64) -> usize {
    (PAD_MM / step_mm).round().max(1.0) as usize
}

/// The surface after polishing off up to `removal_mm`. Near the window's border, and at holes, the square holds only
/// what is there.
pub fn polished(heights: &Heights, step_mm: f64, removal_mm: f64) -> Heights {
    let (columns, rows) = (heights.window.columns, heights.window.rows);
    let reach = reach(step_mm);
    // Sums and counts along rows, then along columns.
    let mut along: Vec<[f64; 2]> = Vec::with_capacity(columns * rows);
    for line in heights.z_mm.chunks(columns.max(1)) {
        let mut running = vec![[0.0; 2]; columns + 1];
        for (column, &z) in line.iter().enumerate() {
            let [sum, count] = running[column];
            running[column + 1] = if z.is_nan() { [sum, count] } else { [sum + f64::from(z), count + 1.0] };
        }
        along.extend((0..columns).map(|column| {
            let (low, high) =
                (running[column.saturating_sub(reach)], running[(column + reach + 1).min(columns)]);
            [high[0] - low[0], high[1] - low[1]]
        }));
    }
    let mut out = heights.clone();
    let mut sums = vec![[0.0; 2]; columns];
    let add = |sums: &mut [[f64; 2]], row: usize, sign: f64| {
        for (sum, part) in sums.iter_mut().zip(&along[row * columns..(row + 1) * columns]) {
            *sum = [sum[0] + sign * part[0], sum[1] + sign * part[1]];
        }
    };
    for row in 0..reach.min(rows) {
        add(&mut sums, row, 1.0);
    }
    for row in 0..rows {
        if row + reach < rows {
            add(&mut sums, row + reach, 1.0);
        }
        if row > reach {
            add(&mut sums, row - reach - 1, -1.0);
        }
        for (z, [sum, count]) in out.z_mm[row * columns..(row + 1) * columns].iter_mut().zip(&sums) {
            let over = f64::from(*z) - sum / count;
            if over > 0.0 {
                *z = (f64::from(*z) - removal_mm * -(-over / removal_mm).exp_m1()) as f32;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Window;

    fn surface(z_mm: impl Fn(f64, f64) -> f64) -> Heights {
        let window = Window { column: 0, row: 0, columns: 120, rows: 90 };
        let z = (0..120 * 90).map(|k| z_mm((k % 120) as f64 * 0.01, (k / 120) as f64 * 0.01) as f32);
        Heights { window, z_mm: z.collect() }
    }

    #[test]
    fn a_plane_and_a_groove_stay() {
        for (name, before) in
            [("plane", surface(|x, y| 0.2 * x - 0.1 * y)), ("groove", surface(|x, _| (x - 0.6).abs()))]
        {
            let after = polished(&before, 0.01, 0.002);
            for row in 20..70 {
                for column in [30, 60] {
                    let at = row * 120 + column;
                    assert!((before.z_mm[at] - after.z_mm[at]).abs() < 1e-6, "{name} {row} {column}");
                }
            }
        }
    }

    #[test]
    fn an_edge_goes_and_nothing_grows() {
        let before = surface(|x, _| -0.25 * (x - 0.6).abs());
        let mut last = 0.0;
        for removal_mm in [0.0005, 0.001, 0.004] {
            let after = polished(&before, 0.01, removal_mm);
            let at = 45 * 120 + 60;
            let gone = f64::from(before.z_mm[at] - after.z_mm[at]);
            // The edge stands 0.25 * 0.1 / 2 mm over its square, and a bit, since the square is of samples.
            let over = 0.25 * (110.0 / 21.0) * 0.01;
            let wanted = removal_mm * (1.0 - (-over / removal_mm).exp());
            assert!((gone - wanted).abs() < 1e-6, "{gone} {wanted}");
            // Heights are floats.
            assert!(gone > last && gone <= removal_mm + 1e-7);
            last = gone;
            assert!(
                before
                    .z_mm
                    .iter()
                    .zip(&after.z_mm)
                    .all(|(b, a)| a <= b && b - a <= removal_mm as f32 * 1.001 + 1e-7)
            );
        }
    }

    #[test]
    fn holes_stay_holes() {
        let mut before = surface(|x, y| 0.01 * (40.0 * x).sin() * (30.0 * y).cos());
        before.z_mm[45 * 120 + 50] = f32::NAN;
        let after = polished(&before, 0.01, 0.001);
        let holes = after.z_mm.iter().filter(|z| z.is_nan()).count();
        assert_eq!(holes, 1);
    }
}
