//! The light of a row of samples of a mirror, many at once: the same steps as for one sample, without branches.

use glam::{DMat3, DVec3};

use super::Stage;
use super::metal::Metal;
use super::relief::Relief;
use super::tally::ROOM_BINS;
use crate::fidelity::pixels::total;
use crate::fidelity::rounding::to_u32;
use crate::grid::Heights;
use crate::optics::Series;

/// Samples that are worked on together; what is kept of them stays in the processor's first cache.
const CHUNK: usize = 128;

/// What became of some samples of a row, one entry a sample.
pub(super) struct Chunk {
    /// Light that falls, 0 where the sample has to be looked at by itself.
    pub taken: [f64; CHUNK],
    pub reflected: [f64; CHUNK],
    /// What of it meets the audience.
    pub arrived: [f64; CHUNK],
    /// Sums of the three.
    pub sums: [f64; 3],
    /// 0 or more where the ray meets the audience.
    met: [f64; CHUNK],
    /// Bin of the room.
    pub bin: [u32; CHUNK],
    /// Whether the sample was worked out; else it has no data beside it, or something may stand in a ray's way.
    pub done: [bool; CHUNK],
    clear2: [f64; CHUNK],
    /// One over the distance to the projector in m; first the distance squared.
    per_m: [f64; CHUNK],
    /// Cosine between the surface's normal and the way to the projector.
    cosine: [f64; CHUNK],
    /// The same, 1 where it is of no use.
    steep: [f64; CHUNK],
    /// 1 where the sample was worked out, else 0.
    known: [f64; CHUNK],
    /// Half the room's bins over the mirrored ray's length.
    unit: [f64; CHUNK],
    /// Samples from the first one on.
    across: [f64; CHUNK],
    out: [[f64; CHUNK]; 3],
    turn: [[f64; CHUNK]; 3],
}

impl Chunk {
    pub const SAMPLES: usize = CHUNK;

    pub fn new() -> Chunk {
        let zero = [0.0; CHUNK];
        Chunk {
            taken: zero,
            reflected: zero,
            arrived: zero,
            sums: [0.0; 3],
            met: zero,
            bin: [0; CHUNK],
            done: [false; CHUNK],
            clear2: zero,
            per_m: zero,
            cosine: zero,
            steep: zero,
            known: zero,
            unit: zero,
            across: zero,
            out: [zero; 3],
            turn: [zero; 3],
        }
    }

    /// Works out `count` samples from `column` on, none of them at the window's border. Only for mirrors at their
    /// true places.
    pub fn fill(
        &mut self,
        (heights, relief, stage): (&Heights, &Relief, &Stage),
        outlines: &[&[[DVec3; 2]]],
        row: i64,
        column: i64,
        count: usize,
    ) {
        let window = heights.window;
        let (r, c) = ((row - window.row) as usize, (column - window.column) as usize);
        let line = |r: usize, c: usize| &heights.z_mm[r * window.columns + c..][..count];
        relief.each_clear(r, c..c + count, |columns, clear| {
            self.clear2[columns.start - c..columns.end - c].fill(clear * clear);
        });
        (0..count).for_each(|k| self.across[k] = f64::from(k as i32));
        let rows = [line(r, c), line(r, c - 1), line(r, c + 1), line(r - 1, c), line(r + 1, c)];
        widest(self, &rows, &About::new(stage, relief.step_mm(), row, column), outlines);
    }

    /// As [`Chunk::fill`], for samples of a row that need not lie side by side.
    pub fn gather(
        &mut self,
        (heights, relief, stage): (&Heights, &Relief, &Stage),
        outlines: &[&[[DVec3; 2]]],
        row: i64,
        columns: &[i64],
    ) {
        let Some(&first) = columns.first() else { return };
        let window = heights.window;
        let r = (row - window.row) as usize;
        let [below, here, above] = [row - 1, row, row + 1].map(|row| heights.row(row));
        let mut five = [[0.0f32; CHUNK]; 5];
        for (k, &column) in columns.iter().enumerate() {
            let c = (column - window.column) as usize;
            let clear = relief.clear(c, r);
            self.clear2[k] = clear * clear;
            self.across[k] = (column - first) as f64;
            let samples = [here[c], here[c - 1], here[c + 1], below[c], above[c]];
            five.iter_mut().zip(samples).for_each(|(line, z)| line[k] = z);
        }
        let rows = five.each_ref().map(|line| &line[..columns.len()]);
        widest(self, &rows, &About::new(stage, relief.step_mm(), row, first), outlines);
    }
}

struct About {
    /// The first sample from the stage's middle in mm, without its height.
    place: [f64; 3],
    step_mm: f64,
    projector: DVec3,
    metal: Metal,
    rotation: DMat3,
}

impl About {
    fn new(stage: &Stage, step_mm: f64, row: i64, column: i64) -> About {
        About {
            place: [
                (column as f64 + 0.5) * step_mm - stage.middle_mm.x,
                (row as f64 + 0.5) * step_mm - stage.middle_mm.y,
                -stage.middle_mm.z,
            ],
            step_mm,
            projector: stage.projector_m,
            metal: stage.metal,
            rotation: stage.rotation,
        }
    }
}

/// Runs [`work`] with the widest vectors that this processor has; the answer is the same for all.
fn widest(chunk: &mut Chunk, rows: &[&[f32]; 5], about: &About, outlines: &[&[[DVec3; 2]]]) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
        fn avx512(chunk: &mut Chunk, rows: &[&[f32]; 5], about: &About, outlines: &[&[[DVec3; 2]]]) {
            work(chunk, rows, about, outlines);
        }
        #[target_feature(enable = "avx2")]
        fn avx2(chunk: &mut Chunk, rows: &[&[f32]; 5], about: &About, outlines: &[&[[DVec3; 2]]]) {
            work(chunk, rows, about, outlines);
        }
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx2")
        {
            // SAFETY: the features were found on this processor.
            return unsafe { avx512(chunk, rows, about, outlines) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the feature was found on this processor.
            return unsafe { avx2(chunk, rows, about, outlines) };
        }
    }
    work(chunk, rows, about, outlines);
}

#[inline(always)]
fn work(chunk: &mut Chunk, rows: &[&[f32]; 5], about: &About, outlines: &[&[[DVec3; 2]]]) {
    let count = rows[0].len().min(CHUNK);
    let [here, left, right, below, above] = rows.map(|row| &row[..count]);
    let Chunk {
        taken,
        reflected,
        arrived,
        sums,
        met,
        bin,
        done,
        clear2,
        per_m,
        cosine,
        steep,
        known,
        unit,
        across: samples,
        out: [ox, oy, oz],
        turn: [qx, qy, qz],
    } = chunk;
    let per_mm = 0.5 / about.step_mm;
    let half = 0.5 * ROOM_BINS as f64;
    let turned = about.rotation;
    let (px0, py, pz0) = (about.place[0] * 1e-3, about.place[1] * 1e-3, about.place[2] * 1e-3);
    let (step_m, p) = (about.step_mm * 1e-3, about.projector);
    let place = |at: usize, z_mm: f32| (px0 + samples[at] * step_m, pz0 + f64::from(z_mm) * 1e-3);
    let iy = p.y - py;
    for at in 0..count {
        let (px, pz) = place(at, here[at]);
        let (ix, iz) = (p.x - px, p.z - pz);
        per_m[at] = ix * ix + iy * iy + iz * iz;
    }
    invert_roots(&mut per_m[..count]);
    for at in 0..count {
        let zx = (f64::from(right[at]) - f64::from(left[at])) * per_mm;
        let zy = (f64::from(above[at]) - f64::from(below[at])) * per_mm;
        let (px, pz) = place(at, here[at]);
        let (ix, iz) = (p.x - px, p.z - pz);
        let dot = iz - ix * zx - iy * zy;
        let n2 = 1.0 + zx * zx + zy * zy;
        let per_n = 1.0 / n2.sqrt();
        let falls = dot * per_m[at];
        let cos = falls * per_n;
        cosine[at] = cos;
        // The mirrored ray, |N|^2 |i| long.
        let (x, y, z) = (-2.0 * dot * zx - n2 * ix, -2.0 * dot * zy - n2 * iy, 2.0 * dot - n2 * iz);
        let (flat2, clear) = (x * x + y * y, clear2[at]);
        let free = (z > 0.0) & (z * z > clear * flat2) & (dot > 0.0) & (iz > 0.0);
        // Without data somewhere nothing of this is true.
        known[at] = if free & (iz * iz > clear * (ix * ix + iy * iy)) { 1.0 } else { 0.0 };
        steep[at] = if free { cos } else { 1.0 };
        taken[at] = falls;
        (ox[at], oy[at], oz[at]) = (x, y, z);
        qx[at] = y * pz - z * py;
        qy[at] = z * px - x * pz;
        qz[at] = x * py - y * px;
        unit[at] = half * (per_n * per_n) * per_m[at];
        met[at] = -1.0;
    }
    // By themselves: loops that write numbers of several sizes among these are not made vectors of.
    for at in 0..count {
        let (x, y, z) = (ox[at], oy[at], oz[at]);
        let across = (turned.x_axis.x * x + turned.y_axis.x * y + turned.z_axis.x * z) * unit[at] + half;
        let up = (turned.x_axis.y * x + turned.y_axis.y * y + turned.z_axis.y * z) * unit[at] + half;
        let last = (ROOM_BINS - 1) as f64;
        let (across, up) = (across.max(0.0).min(last), up.max(0.0).min(last));
        bin[at] = to_u32(across.floor() + ROOM_BINS as f64 * up.floor());
    }
    (0..count).for_each(|at| done[at] = known[at] > 0.0);
    match &about.metal.series {
        Some(series) if least(&steep[..count]) >= Series::LEAST_COSINE => {
            (0..count).for_each(|at| reflected[at] = taken[at] * series.at(cosine[at]));
        }
        _ => (0..count).for_each(|at| reflected[at] = taken[at] * about.metal.reflectance.at(cosine[at])),
    }
    for edges in outlines {
        let mut least = [f64::INFINITY; CHUNK];
        for [m, e] in *edges {
            for at in 0..count {
                // direction . (moment - place x edge), with the place's part as edge . (direction x place).
                let side =
                    ox[at] * m.x + oy[at] * m.y + oz[at] * m.z - (qx[at] * e.x + qy[at] * e.y + qz[at] * e.z);
                least[at] = if side < least[at] { side } else { least[at] };
            }
        }
        for at in 0..count {
            met[at] = if least[at] > met[at] { least[at] } else { met[at] };
        }
    }
    for at in 0..count {
        taken[at] = if known[at] > 0.0 { taken[at] } else { 0.0 };
        reflected[at] = if known[at] > 0.0 { reflected[at] } else { 0.0 };
        arrived[at] = if met[at] >= 0.0 { reflected[at] } else { 0.0 };
    }
    *sums = [&taken[..count], &reflected[..count], &arrived[..count]].map(total);
}

/// One over the root of each, by a series where they differ as little as those of samples side by side do.
#[inline(always)]
fn invert_roots(values: &mut [f64]) {
    /// With this much of the middle one left out is less than a rounding: 231 / 1024 of its sixth power.
    const APART: f64 = 2e-3;
    let middle = values.get(values.len() / 2).copied().unwrap_or(1.0);
    let (per, root) = (1.0 / middle, 1.0 / middle.sqrt());
    let apart = 1.0 - least(values) * per;
    let beyond = most(values) * per - 1.0;
    // No data elsewhere stays no data.
    if middle.is_finite() && apart <= APART && beyond <= APART {
        for value in values.iter_mut() {
            let x = *value * per - 1.0;
            let powers = [-63.0 / 256.0, 35.0 / 128.0, -5.0 / 16.0, 3.0 / 8.0, -0.5, 1.0];
            *value = root * powers.iter().fold(0.0, |sum, power| sum * x + power);
        }
    } else {
        values.iter_mut().for_each(|value| *value = 1.0 / value.sqrt());
    }
}

/// The least of some values but NaN, without waiting for each.
#[inline(always)]
fn least(values: &[f64]) -> f64 {
    let lower = |a: f64, b: f64| if b < a { b } else { a };
    reduce(values, f64::INFINITY, lower)
}

/// The most of some values but NaN, without waiting for each.
#[inline(always)]
fn most(values: &[f64]) -> f64 {
    let higher = |a: f64, b: f64| if b > a { b } else { a };
    reduce(values, f64::NEG_INFINITY, higher)
}

#[inline(always)]
fn reduce(values: &[f64], from: f64, of: impl Fn(f64, f64) -> f64 + Copy) -> f64 {
    let (eights, rest) = values.as_chunks::<8>();
    let mut lanes = [from; 8];
    for eight in eights {
        for (lane, value) in lanes.iter_mut().zip(eight) {
            *lane = of(*lane, *value);
        }
    }
    lanes.iter().chain(rest).fold(from, |all, value| of(all, *value))
}
