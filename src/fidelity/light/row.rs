//! The light of a row of samples of a mirror, many at once: the same steps as for one sample, without branches.

use glam::{DMat3, DVec3};

use super::Stage;
use super::relief::Relief;
use super::tally::ROOM_BINS;
use crate::grid::Heights;

/// Samples that are worked on together; what is kept of them stays in the processor's first cache.
const CHUNK: usize = 128;

/// What became of some samples of a row, one entry a sample.
pub(super) struct Chunk {
    /// Light that falls, 0 where the sample has to be looked at by itself.
    pub taken: [f64; CHUNK],
    pub reflected: [f64; CHUNK],
    /// 0 or more where the ray meets the audience.
    pub met: [f64; CHUNK],
    /// Bin of the room.
    pub bin: [u32; CHUNK],
    /// Whether the sample was worked out; else it has no data beside it, or something may stand in a ray's way.
    pub done: [bool; CHUNK],
    clear2: [f64; CHUNK],
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
            met: zero,
            bin: [0; CHUNK],
            done: [false; CHUNK],
            clear2: zero,
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
        for (k, clear2) in self.clear2[..count].iter_mut().enumerate() {
            let clear = relief.clear(c + k, r);
            *clear2 = clear * clear;
        }
        (0..count).for_each(|k| self.across[k] = k as f64);
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
    metal: [[f64; 2]; 2],
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
            metal: stage.metal.by_index(),
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
        met,
        bin,
        done,
        clear2,
        across: samples,
        out: [ox, oy, oz],
        turn: [qx, qy, qz],
    } = chunk;
    let per_mm = 0.5 / about.step_mm;
    let [[n, k], [constant, of_index]] = about.metal;
    let (nk, nk4) = (n * n - k * k, 4.0 * n * n * k * k);
    let half = 0.5 * ROOM_BINS as f64;
    let turned = about.rotation;
    let (px0, py, pz0) = (about.place[0] * 1e-3, about.place[1] * 1e-3, about.place[2] * 1e-3);
    let (step_m, p) = (about.step_mm * 1e-3, about.projector);
    for at in 0..count {
        let zx = (f64::from(right[at]) - f64::from(left[at])) * per_mm;
        let zy = (f64::from(above[at]) - f64::from(below[at])) * per_mm;
        let px = px0 + samples[at] * step_m;
        let pz = pz0 + f64::from(here[at]) * 1e-3;
        let (ix, iy, iz) = (p.x - px, p.y - py, p.z - pz);
        let dot = iz - ix * zx - iy * zy;
        let n2 = 1.0 + zx * zx + zy * zy;
        // Roots and quotients are what takes the time here: |i| and |N| by one quotient.
        let (length, n1) = ((ix * ix + iy * iy + iz * iz).sqrt(), n2.sqrt());
        let per = 1.0 / (length * n1);
        let cos = dot * per;
        let falls = cos * n1;
        // The conductor's reflectance, as in `ComplexIndex::reflectance`.
        let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
        let t = nk - sin2;
        let a2b2 = (t * t + nk4).sqrt();
        let ac = 2.0 * (0.5 * (a2b2 + t)).sqrt() * cos;
        // s (1 + (u - v) / (u + v)) / 2 with s = (a^2 + b^2 + cos^2 - ac) / (a^2 + b^2 + cos^2 + ac).
        let (u, v) = (cos2 * a2b2 + sin2 * sin2, ac * sin2);
        let fresnel = (a2b2 + cos2 - ac) * u / ((a2b2 + cos2 + ac) * (u + v));
        let reflectance = constant + of_index * fresnel;
        // The mirrored ray, |N|^2 |i| long.
        let (x, y, z) = (-2.0 * dot * zx - n2 * ix, -2.0 * dot * zy - n2 * iy, 2.0 * dot - n2 * iz);
        let (flat2, clear) = (x * x + y * y, clear2[at]);
        let free = (z > 0.0) & (z * z > clear * flat2) & (dot > 0.0) & (iz > 0.0);
        // Without data somewhere nothing of this is true.
        done[at] = free & (iz * iz > clear * (ix * ix + iy * iy));
        taken[at] = falls;
        reflected[at] = falls * reflectance;
        (ox[at], oy[at], oz[at]) = (x, y, z);
        qx[at] = y * pz - z * py;
        qy[at] = z * px - x * pz;
        qz[at] = x * py - y * px;
        let unit = half * per * (per * length);
        let across = (turned.x_axis.x * x + turned.y_axis.x * y + turned.z_axis.x * z) * unit + half;
        let up = (turned.x_axis.y * x + turned.y_axis.y * y + turned.z_axis.y * z) * unit + half;
        let last = (ROOM_BINS - 1) as f64;
        let (across, up) = (across.max(0.0).min(last), up.max(0.0).min(last));
        bin[at] = across as i32 as u32 + ROOM_BINS as u32 * (up as i32 as u32);
        met[at] = -1.0;
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
}
