use super::Profile;
use crate::grid::Heights;

/// Samples along each side of a block whose highest is kept.
const SIDE: usize = 8;

/// Heights made ready for cutter locations at places of no row: each looks only at blocks that could hold a
/// contact.
#[derive(Debug)]
pub struct Places<'a> {
    heights: &'a Heights,
    step_mm: f64,
    /// Blocks in a row of them.
    columns: usize,
    rows: usize,
    /// Highest sample of each block; -inf without data.
    tops: Vec<f32>,
}

impl<'a> Places<'a> {
    pub fn new(heights: &'a Heights, step_mm: f64) -> Places<'a> {
        let window = heights.window;
        let (columns, rows) = (window.columns.div_ceil(SIDE), window.rows.div_ceil(SIDE));
        let mut tops = vec![f32::NEG_INFINITY; columns * rows];
        for (row, z_mm) in heights.z_mm.chunks_exact(window.columns.max(1)).enumerate() {
            let tops = &mut tops[row / SIDE * columns..][..columns];
            for (top, z_mm) in tops.iter_mut().zip(z_mm.chunks(SIDE)) {
                for &z in z_mm {
                    *top = if z > *top && z.is_finite() { z } else { *top };
                }
            }
        }
        Places { heights, step_mm, columns, rows, tops }
    }

    /// Blocks that hold samples up to `reach_mm` from a coordinate along an axis.
    fn blocks(&self, axis: usize, mm: f64, reach_mm: f64) -> std::ops::Range<usize> {
        let (first, count) = match axis {
            0 => (self.heights.window.column, self.columns),
            _ => (self.heights.window.row, self.rows),
        };
        let block = |mm: f64| ((mm / self.step_mm - 0.5 - first as f64) / SIDE as f64).floor();
        let low = block(mm - reach_mm).clamp(0.0, count as f64) as usize;
        low..(block(mm + reach_mm) + 1.0).clamp(low as f64, count as f64) as usize
    }

    /// The highest sample up to `reach_mm` from a place; -inf where there is none.
    pub fn ceiling_mm(&self, place_mm: [f64; 2], reach_mm: f64) -> f64 {
        let window = self.heights.window;
        let origin = [window.column as f64 + 0.5, window.row as f64 + 0.5];
        let at = |axis: usize, sample: usize| (origin[axis] + sample as f64) * self.step_mm - place_mm[axis];
        // A sample at the reach itself counts whatever the last bit of its place.
        let square = reach_mm * reach_mm * (1.0 + 1e-12);
        let columns = self.blocks(0, place_mm[0], reach_mm);
        let mut best = f32::NEG_INFINITY;
        for row in self.blocks(1, place_mm[1], reach_mm) {
            for column in columns.clone() {
                let top = self.tops[row * self.columns + column];
                let first = [column * SIDE, row * SIDE];
                let end = [(first[0] + SIDE).min(window.columns), (first[1] + SIDE).min(window.rows)];
                let near = |axis: usize| at(axis, first[axis]).max(-at(axis, end[axis] - 1)).max(0.0);
                let far = |axis: usize| at(axis, end[axis] - 1).max(-at(axis, first[axis]));
                let distance = |gap: &dyn Fn(usize) -> f64| gap(0).powi(2) + gap(1).powi(2);
                if top <= best || distance(&near) > square {
                    continue;
                }
                if distance(&far) <= square {
                    best = top;
                    continue;
                }
                for sample_row in first[1]..end[1] {
                    let left = square - at(1, sample_row).powi(2);
                    let z_mm = &self.heights.z_mm[sample_row * window.columns..][first[0]..end[0]];
                    for (i, &z_mm) in z_mm.iter().enumerate() {
                        if z_mm > best && z_mm.is_finite() && at(0, first[0] + i).powi(2) <= left {
                            best = z_mm;
                        }
                    }
                }
            }
        }
        f64::from(best)
    }

    /// The cutter location at a place, as [`points`](super::points) gives it; NaN where nothing is in reach. `near` is
    /// the block of a contact close by, where the search begins; it becomes this one's.
    pub fn drop_mm(&self, profile: &Profile, place_mm: [f64; 2], near: &mut Option<[usize; 2]>) -> f64 {
        let mut best = f64::NEG_INFINITY;
        let reach_mm = profile.radius_mm() + self.step_mm;
        let [columns, rows] = [0, 1].map(|axis| self.blocks(axis, place_mm[axis], reach_mm));
        let begin = near.filter(|[c, r]| columns.contains(c) && rows.contains(r));
        if let Some(block) = begin {
            self.raise(profile, place_mm, block, &mut best);
        }
        for row in rows {
            for column in columns.clone() {
                if begin != Some([column, row]) && self.raise(profile, place_mm, [column, row], &mut best) {
                    *near = Some([column, row]);
                }
            }
        }
        if best.is_finite() { best } else { f64::NAN }
    }

    /// Raises `best` to what the samples of a block ask for; tells whether they did.
    fn raise(&self, profile: &Profile, place_mm: [f64; 2], block: [usize; 2], best: &mut f64) -> bool {
        let window = self.heights.window;
        let first = [block[0] * SIDE, block[1] * SIDE];
        let end = [(first[0] + SIDE).min(window.columns), (first[1] + SIDE).min(window.rows)];
        let origin = [window.column as f64 + 0.5, window.row as f64 + 0.5];
        let at = |axis: usize, sample: usize| (origin[axis] + sample as f64) * self.step_mm - place_mm[axis];
        let gap = |axis: usize| at(axis, first[axis]).max(-at(axis, end[axis] - 1)).max(0.0);
        let Some(most_mm) = profile.s_mm(gap(0).hypot(gap(1))) else { return false };
        if f64::from(self.tops[block[1] * self.columns + block[0]]) + most_mm <= *best {
            return false;
        }
        let mut raised = false;
        for row in first[1]..end[1] {
            let dy_mm = at(1, row);
            let z_mm = &self.heights.z_mm[row * window.columns..][first[0]..end[0]];
            for (i, &z_mm) in z_mm.iter().enumerate() {
                let z_mm = f64::from(z_mm);
                // False for no data, too.
                if !(z_mm + most_mm > *best && z_mm.is_finite()) {
                    continue;
                }
                let dx_mm = at(0, first[0] + i);
                if let Some(s_mm) = profile.s_mm((dx_mm * dx_mm + dy_mm * dy_mm).sqrt())
                    && z_mm + s_mm > *best
                {
                    *best = z_mm + s_mm;
                    raised = true;
                }
            }
        }
        raised
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compensation::points;
    use crate::grid::Window;

    #[test]
    fn finds_what_looking_at_every_sample_finds() {
        let window = Window { column: -7, row: 11, columns: 61, rows: 53 };
        let z_mm = (0..window.samples()).map(|i| {
            let (c, r) = (i % window.columns, i / window.columns);
            let noise = (i * 7919 % 1013) as f32 * 1e-5;
            if (c / 9 + r / 7) % 11 == 3 { f32::NAN } else { 0.002 * c as f32 - 0.001 * r as f32 + noise }
        });
        let heights = Heights { window, z_mm: z_mm.collect() };
        let places = Places::new(&heights, 0.01);
        for text in ["ball:0.2", "flat:0.16", "bull:0.2:0.04", "vee:60:0.05:0.2", "taper:0.1:15:0.2"] {
            let profile = Profile::new(text.parse().unwrap(), 0.01, 0.004).unwrap();
            let mut near = None;
            for i in 0..400 {
                let place = [-0.2 + 0.0023 * f64::from(i), 0.05 + 0.0017 * f64::from(i)];
                let all = points(&heights, &profile, &[place])[0];
                let few = places.drop_mm(&profile, place, &mut near);
                assert!((few - all).abs() < 1e-12 || few.is_nan() && all.is_nan(), "{text}: {few} of {all}");
                let ceiling = places.ceiling_mm(place, profile.radius_mm());
                assert!(all.is_nan() || ceiling >= all, "{ceiling} under {all}");
            }
        }
        for i in 0..400 {
            let place = [-0.2 + 0.0023 * f64::from(i), 0.05 + 0.0017 * f64::from(i)];
            let reach_mm = 0.0007 * f64::from(i);
            let within = heights.z_mm.iter().enumerate().filter(|(k, z)| {
                let (c, r) = ((k % window.columns) as i64, (k / window.columns) as i64);
                let at = [window.column + c, window.row + r].map(|sample| 0.01 * (sample as f64 + 0.5));
                z.is_finite() && (at[0] - place[0]).hypot(at[1] - place[1]) <= reach_mm
            });
            let highest = within.map(|(_, &z)| z).fold(f32::NEG_INFINITY, f32::max);
            assert_eq!(places.ceiling_mm(place, reach_mm), f64::from(highest), "{place:?}, {reach_mm}");
        }
    }
}
