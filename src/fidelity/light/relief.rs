//! Which rays from a heightfield meet it again: a horizon that proves for most places that none does, and a
//! march along the samples for the rest.

use std::ops::Range;

use glam::DVec3;

use crate::grid::{Heights, Window};

/// Samples along a side of a patch that shares its horizon.
const PATCH: usize = 16;

/// Patches from a patch to the rings that are looked at, each ring up to the next.
const RINGS: [usize; 13] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128];

/// A march passes over what stands less than this over the ray, in mm: rounding of the samples.
const OVER_MM: f64 = 1e-6;

/// Heights and their horizons; the frame is the heights' own.
pub struct Relief<'a> {
    heights: &'a Heights,
    step_mm: f64,
    /// Steepest face of the whole surface, for what lies past the window.
    steepest: f64,
    across: usize,
    patches: Vec<Patch>,
    /// Lowest and highest of all.
    ends_mm: [f32; 2],
}

#[derive(Clone, Copy)]
struct Patch {
    /// Rays that climb faster than this meet nothing.
    clear: f64,
    /// Steepest climb between neighbouring samples here and one patch around.
    slope: f64,
    /// Highest z within each ring.
    highest: [f32; RINGS.len()],
}

/// Where a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// It meets nothing.
    Clear,
    /// It meets the surface next to this sample (column and row of the window's frame).
    At(i64, i64),
    /// It leaves the window flatter than the steepest face.
    Unknown,
}

impl<'a> Relief<'a> {
    /// Looks over the heights of a window; a ray that leaves it is clear if it climbs faster than `steepest`.
    pub fn new(heights: &'a Heights, step_mm: f64, steepest: f64) -> Relief<'a> {
        let Window { columns, rows, .. } = heights.window;
        let (across, down) = (columns.div_ceil(PATCH), rows.div_ceil(PATCH));
        let mut low = vec![f32::INFINITY; across * down];
        let mut high = vec![f32::NEG_INFINITY; across * down];
        let mut climbs = vec![0.0f32; across * down];
        for at in 0..across * down {
            let looked = Looked::over(heights, at % across * PATCH, at / across * PATCH);
            (low[at], high[at], climbs[at]) = looked.ends();
        }
        let ends_mm = [
            low.iter().fold(f32::INFINITY, |least, z| least.min(*z)),
            high.iter().fold(f32::NEG_INFINITY, |most, z| most.max(*z)),
        ];
        let slopes = spread(&climbs, across, down, 1);
        let size_mm = PATCH as f64 * step_mm;
        let mut patches: Vec<Patch> = (0..across * down)
            .map(|at| {
                let slope = f64::from(slopes[at]) / step_mm;
                Patch { clear: slope.max(steepest), slope, highest: [f32::NEG_INFINITY; RINGS.len()] }
            })
            .collect();
        let mut within = high;
        let mut radius = 0;
        for (ring, &reach) in RINGS.iter().enumerate() {
            while radius < reach {
                let by = (reach - radius).min(radius.max(1));
                within = spread(&within, across, down, by);
                radius += by;
            }
            for (at, patch) in patches.iter_mut().enumerate() {
                patch.highest[ring] = within[at];
                if ring > 0 && low[at].is_finite() {
                    let rise = f64::from(within[at]) - f64::from(low[at]);
                    patch.clear = patch.clear.max(rise / (RINGS[ring - 1] as f64 * size_mm));
                }
            }
            if radius >= across.max(down) {
                for patch in &mut patches {
                    for later in ring + 1..RINGS.len() {
                        patch.highest[later] = f32::NEG_INFINITY;
                    }
                }
                break;
            }
        }
        Relief { heights, step_mm, steepest, across, patches, ends_mm }
    }

    /// Lowest and highest z, infinity and minus infinity where there is no data.
    pub(super) fn ends_mm(&self) -> [f32; 2] {
        self.ends_mm
    }

    /// Distance of the samples in mm.
    pub(super) fn step_mm(&self) -> f64 {
        self.step_mm
    }

    /// The slope past which a ray from a sample meets nothing; columns and rows count from the window's corner.
    #[inline]
    pub(super) fn clear(&self, column: usize, row: usize) -> f64 {
        self.patches[row / PATCH * self.across + column / PATCH].clear
    }

    /// Shows the columns of a row, of those given, by runs of one [`Relief::clear`].
    pub(super) fn each_clear(
        &self,
        row: usize,
        columns: Range<usize>,
        mut show: impl FnMut(Range<usize>, f64),
    ) {
        let mut start = columns.start;
        while start < columns.end {
            let end = ((start / PATCH + 1) * PATCH).min(columns.end);
            show(start..end, self.clear(start, row));
            start = end;
        }
    }

    /// Shows the columns of a row, of those given, at which rays have to climb faster here than in another relief of
    /// the same window to be known to meet nothing; rows and columns count from the window's corner.
    pub(super) fn harder(
        &self,
        than: &Relief,
        row: usize,
        columns: Range<usize>,
        mut show: impl FnMut(Range<usize>),
    ) {
        self.each_clear(row, columns, |columns, clear| {
            if clear > than.clear(columns.start, row) {
                show(columns);
            }
        });
    }

    fn at(&self, column: i64, row: i64) -> f64 {
        f64::from(self.heights.z_mm[row as usize * self.heights.window.columns + column as usize])
    }

    /// Where the ray from a sample in a direction (of any length) ends.
    #[inline]
    pub fn end(&self, column: i64, row: i64, direction: DVec3) -> End {
        let window = self.heights.window;
        let (c, r) = ((column - window.column) as usize, (row - window.row) as usize);
        let patch = &self.patches[r / PATCH * self.across + c / PATCH];
        let flat2 = direction.x * direction.x + direction.y * direction.y;
        if direction.z > 0.0 && direction.z * direction.z > patch.clear * patch.clear * flat2 {
            return End::Clear;
        }
        self.march(c as i64, r as i64, patch, direction)
    }

    fn march(&self, column: i64, row: i64, patch: &Patch, direction: DVec3) -> End {
        let window = self.heights.window;
        let lateral = direction.x.abs().max(direction.y.abs());
        if lateral == 0.0 {
            return if direction.z > 0.0 {
                End::Clear
            } else {
                End::At(column + window.column, row + window.row)
            };
        }
        let climb = direction.z / direction.x.hypot(direction.y);
        let z0 = self.at(column, row);
        let size_mm = PATCH as f64 * self.step_mm;
        let far = (1..RINGS.len())
            .rev()
            .find(|&ring| z0 + climb * RINGS[ring - 1] as f64 * size_mm <= f64::from(patch.highest[ring]));
        let patches = match far {
            Some(ring) => RINGS[ring] + 1,
            None if climb > patch.slope => 0,
            None => RINGS[0] + 1,
        };
        // Rays that fall are followed to the window's edge.
        let most = if climb > 0.0 { (patches * PATCH) as i64 } else { i64::MAX };
        let along_x = direction.x.abs() >= direction.y.abs();
        let (major, minor) = if along_x { (direction.x, direction.y) } else { (direction.y, direction.x) };
        let way = major.signum() as i64;
        let (drift, rise) = (minor / major.abs(), direction.z / lateral * self.step_mm);
        let (columns, rows) = (window.columns as i64, window.rows as i64);
        let (count, width) = if along_x { (columns, rows) } else { (rows, columns) };
        let (start, across) = if along_x { (column, row as f64) } else { (row, column as f64) };
        let sample = |major: i64, minor: i64| {
            if along_x { self.at(major, minor) } else { self.at(minor, major) }
        };
        let mut k = 0;
        while k < most {
            k += 1;
            let (at, side) = (start + way * k, across + drift * k as f64);
            let below = side.floor();
            let first = below as i64;
            if !(0..count).contains(&at) || first < 0 || side > (width - 1) as f64 {
                return if climb > self.steepest { End::Clear } else { End::Unknown };
            }
            let part = side - below;
            let low = sample(at, first);
            let surface = if part > 0.0 { low + part * (sample(at, first + 1) - low) } else { low };
            // False for no data, which nothing meets.
            if surface > z0 + rise * k as f64 + OVER_MM {
                let nearest = if part < 0.5 { first } else { first + 1 };
                let (column, row) = if along_x { (at, nearest) } else { (nearest, at) };
                return End::At(column + window.column, row + window.row);
            }
        }
        // Over all that the window shows; past it the steepest face could stand.
        if climb > self.steepest { End::Clear } else { End::Unknown }
    }
}

/// Lowest, highest and steepest of the samples of a patch, a column to each place.
struct Looked {
    least: [f32; PATCH],
    most: [f32; PATCH],
    /// Climbs to the right and upwards.
    across: [f32; PATCH],
    up: [f32; PATCH],
}

impl Looked {
    /// Of the patch whose first sample this is.
    fn over(heights: &Heights, column: usize, row: usize) -> Looked {
        let Window { columns, rows, .. } = heights.window;
        let mut looked = Looked {
            least: [f32::INFINITY; PATCH],
            most: [f32::NEG_INFINITY; PATCH],
            across: [0.0; PATCH],
            up: [0.0; PATCH],
        };
        for row in row..(row + PATCH).min(rows) {
            let line = &heights.z_mm[row * columns..(row + 1) * columns];
            let above = heights.z_mm.get((row + 1) * columns..(row + 2) * columns).unwrap_or(line);
            let (z, right) = (&line[column..], line.get(column + 1..).unwrap_or(&[]));
            match (z.first_chunk(), right.first_chunk(), above[column..].first_chunk()) {
                (Some(z), Some(right), Some(above)) => looked.take(z, right, above),
                _ => {
                    // At the right edge there is nothing more.
                    let mut ends = [[f32::NAN; PATCH]; 3];
                    for (to, from) in ends.iter_mut().zip([z, right, &above[column..]]) {
                        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
                    }
                    looked.take(&ends[0], &ends[1], &ends[2]);
                }
            }
        }
        looked
    }

    /// Comparisons leave out NaN.
    #[inline(always)]
    fn take(&mut self, z: &[f32; PATCH], right: &[f32; PATCH], above: &[f32; PATCH]) {
        for k in 0..PATCH {
            let (across, up) = ((right[k] - z[k]).abs(), (above[k] - z[k]).abs());
            self.least[k] = if z[k] < self.least[k] { z[k] } else { self.least[k] };
            self.most[k] = if z[k] > self.most[k] { z[k] } else { self.most[k] };
            self.across[k] = if across > self.across[k] { across } else { self.across[k] };
            self.up[k] = if up > self.up[k] { up } else { self.up[k] };
        }
    }

    /// Lowest, highest, and a climb from sample to sample that none exceeds.
    fn ends(&self) -> (f32, f32, f32) {
        let most = |of: &[f32; PATCH]| of.iter().fold(f32::NEG_INFINITY, |most, z| most.max(*z));
        let least = self.least.iter().fold(f32::INFINITY, |least, z| least.min(*z));
        (least, most(&self.most), most(&self.across).hypot(most(&self.up)))
    }
}

/// Largest value within `by` places along both axes.
fn spread(values: &[f32], across: usize, down: usize, by: usize) -> Vec<f32> {
    let mut rows = vec![f32::NEG_INFINITY; values.len()];
    for r in 0..down {
        for c in 0..across {
            let near = &values[r * across + c.saturating_sub(by)..=r * across + (c + by).min(across - 1)];
            rows[r * across + c] = near.iter().fold(f32::NEG_INFINITY, |most, v| most.max(*v));
        }
    }
    let mut out = vec![f32::NEG_INFINITY; values.len()];
    for r in 0..down {
        for near in r.saturating_sub(by)..=(r + by).min(down - 1) {
            for c in 0..across {
                out[r * across + c] = out[r * across + c].max(rows[near * across + c]);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use parry3d::math::Vector;
    use parry3d::query::{Ray, RayCast};
    use parry3d::shape::HeightField;
    use parry3d::utils::Array2;

    use super::*;

    const STEP_MM: f64 = 0.01;

    fn hills(columns: usize, rows: usize) -> Heights {
        let window = Window { column: -3, row: 5, columns, rows };
        let mut heights = Heights::empty(window);
        for (index, z) in heights.z_mm.iter_mut().enumerate() {
            let (c, r) = ((index % columns) as f64, (index / columns) as f64);
            *z = (0.06 * (0.23 * c).sin() * (0.19 * r).cos()) as f32;
        }
        heights
    }

    /// The march against ray casting in the triangles between the samples. The two surfaces differ inside a square of
    /// four samples, so a few rays that graze an edge may be told differently.
    #[test]
    fn it_meets_what_a_ray_cast_meets() {
        let (columns, rows) = (90, 70);
        let heights = hills(columns, rows);
        let relief = Relief::new(&heights, STEP_MM, 0.1);
        // parry's field lies in x and z with y up.
        let field = Array2::new(rows, columns, {
            let by_column = (0..columns).flat_map(|c| (0..rows).map(move |r| (r, c)));
            by_column.map(|(r, c)| heights.z_mm[r * columns + c] * 100.0).collect()
        });
        let size = Vector::new((columns - 1) as f32, 1.0, (rows - 1) as f32);
        let field = HeightField::new(field, size);
        let (mut met, mut clear, mut differ) = (0, 0, 0);
        for k in 0..6000u32 {
            let turn = |by: f64| (f64::from(k) * by).fract();
            let c = 20 + (turn(0.7548) * (columns - 40) as f64) as usize;
            let r = 20 + (turn(0.5698) * (rows - 40) as f64) as usize;
            let angle = turn(0.3247) * std::f64::consts::TAU;
            let direction = DVec3::new(angle.cos(), angle.sin(), 0.3 + 2.5 * turn(0.618));
            let end = relief.end(c as i64 - 3, r as i64 + 5, direction);
            let lift = 1e-3;
            let origin = Vector::new(
                c as f32 - 0.5 * (columns - 1) as f32,
                heights.z_mm[r * columns + c] * 100.0 + lift,
                r as f32 - 0.5 * (rows - 1) as f32,
            );
            let ray =
                Ray::new(origin, Vector::new(direction.x as f32, direction.z as f32, direction.y as f32));
            let hit = field.cast_local_ray(&ray, 1e4, false).is_some();
            match end {
                End::At(..) if hit => met += 1,
                End::Clear if !hit => clear += 1,
                End::Unknown => {}
                // A ray flatter than the ground it starts on is under it at once; the cast starts at a corner of six
                // triangles and misses that.
                End::At(column, row)
                    if (column + 3 - c as i64).abs().max((row - 5 - r as i64).abs()) <= 1 => {}
                _ => differ += 1,
            }
        }
        assert!(met > 150 && clear > 2000, "{met} met, {clear} clear, {differ} differ");
        assert!(differ < 60, "{met} met, {clear} clear, {differ} differ");
    }

    #[test]
    fn a_wall_throws_the_shadow_of_its_height() {
        let window = Window { column: 0, row: 0, columns: 400, rows: 3 };
        let mut heights = Heights::empty(window);
        for (index, z) in heights.z_mm.iter_mut().enumerate() {
            *z = if index % 400 < 300 { 0.0 } else { 0.5 };
        }
        let relief = Relief::new(&heights, STEP_MM, 0.0);
        // At a slope of 1 the shadow is 50 samples long.
        for column in 0..300 {
            let end = relief.end(column, 1, DVec3::new(1.0, 0.0, 1.0));
            assert_eq!(matches!(end, End::At(..)), column > 250, "{column}: {end:?}");
            assert_eq!(relief.end(column, 1, DVec3::new(-1.0, 0.0, 1.0)), End::Clear);
        }
    }
}
