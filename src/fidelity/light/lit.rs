//! A surface in front of its room, and how the light of its samples is followed.

use glam::DVec3;
use rayon::prelude::*;

use super::ground::Ground;
use super::metal::draw;
use super::row::Chunk;
use super::tally::{LightTally, ROOM_BINS};
use super::view::bin_of;
use super::{End, Pose, Relief, Room, Stage};
use crate::fidelity::pixels::{Line, Pixels};
use crate::grid::{Heights, Window};

/// Bounces that are followed; light that has not left by then is unresolved.
const BOUNCES: u64 = 6;

/// Rows per task; a constant, so that it is no part of how sums come about.
const BAND_ROWS: usize = 256;

/// Heights that the projector shines on.
pub(super) struct Lit<'a> {
    pub ground: Ground<'a>,
    pub relief: Relief<'a>,
    pub stage: Stage<'a>,
    /// Directions are drawn, or stand at a cell's centre: one sample at a time.
    alone: bool,
}

/// One band's sums, and its rows' light by pixels of the map if one is wanted.
type Band = (LightTally, Vec<Line>);

/// First rows of the bands of a window, and their ends.
pub(super) fn bands(window: Window) -> Vec<(i64, i64)> {
    let starts = (window.row..window.row_end()).step_by(BAND_ROWS);
    starts.map(|first| (first, (first + BAND_ROWS as i64).min(window.row_end()))).collect()
}

impl<'a> Lit<'a> {
    /// For the samples of `window`; None where there is no data.
    pub fn new(
        heights: &'a Heights,
        window: Window,
        step_mm: f64,
        pose: &Pose,
        room: &Room<'a>,
    ) -> Option<Lit<'a>> {
        let relief = Relief::new(heights, step_mm, room.steepest);
        let (columns, rows) = (window.columns as f64 * step_mm, window.rows as f64 * step_mm);
        let [low, high] = relief.ends_mm();
        if low > high {
            return None;
        }
        let corner = DVec3::new(window.column as f64, window.row as f64, 0.0) * step_mm;
        let middle_mm = corner + 0.5 * DVec3::new(columns, rows, f64::from(low) + f64::from(high));
        let within_mm = columns.hypot(rows) + f64::from(high) - f64::from(low);
        let stage = Stage::new(room, pose, middle_mm, within_mm);
        let alone = !room.metal.is_mirror() || room.far_field.is_some();
        Some(Lit { ground: Ground { heights, step_mm }, relief, stage, alone })
    }

    /// The audience's outlines if samples can be followed many at once.
    pub fn outlines(&self) -> Option<Vec<&[[DVec3; 2]]>> {
        if self.alone { None } else { self.stage.silhouette.outlines() }
    }

    /// An empty tally of this room.
    pub fn tally(&self) -> LightTally {
        LightTally { drawn: !self.stage.metal.is_mirror(), ..LightTally::default() }
    }

    /// Adds a row of a window; `each` is shown what was worked out together, by its first column.
    pub fn row(
        &self,
        outlines: Option<&[&[[DVec3; 2]]]>,
        (row, window): (i64, Window),
        (tally, chunk): (&mut LightTally, &mut Chunk),
        line: &mut Option<Line>,
        mut each: impl FnMut(i64, &[bool]),
    ) {
        let mut column = window.column;
        while column < window.column_end() {
            let end = (column + Chunk::SAMPLES as i64).min(window.column_end());
            match outlines {
                Some(outlines) if self.ground.surrounded(column, end, row) => {
                    let count = (end - column) as usize;
                    let surface = (self.ground.heights, &self.relief, &self.stage);
                    chunk.fill(surface, outlines, row, column, count);
                    self.chunk(tally, chunk, row, |k| column + k as i64, count, line);
                    each(column, &chunk.done[..count]);
                }
                _ => {
                    for column in column..end {
                        let light = self.sample(tally, column, row);
                        line.iter_mut().for_each(|line| line.add(column, light));
                    }
                }
            }
            column = end;
        }
    }

    /// Adds samples that were worked out together, and looks at the others by themselves. `line` only for samples
    /// side by side.
    pub fn chunk(
        &self,
        tally: &mut LightTally,
        chunk: &Chunk,
        row: i64,
        column: impl Fn(usize) -> i64,
        count: usize,
        line: &mut Option<Line>,
    ) {
        let done = chunk.done[..count].iter().filter(|done| **done).count();
        let [taken, reflected, arrived] =
            [&chunk.taken, &chunk.reflected, &chunk.arrived].map(|row| &row[..count]);
        let [all, left, met] = chunk.sums;
        tally.samples += done as u64;
        tally.incident += all;
        tally.absorbed += all - left;
        tally.on_audience += met;
        tally.leak += left - met;
        // On one facet all light goes one way.
        let mut k = 0;
        while k < count {
            let bin = chunk.bin[k];
            let (mut left, mut met) = (0.0, 0.0);
            while k < count && chunk.bin[k] == bin {
                left += reflected[k];
                met += arrived[k];
                k += 1;
            }
            tally.room[bin as usize] += left;
            tally.met[bin as usize] += met;
        }
        if let Some(line) = line {
            line.add_run(column(0), taken, arrived);
        }
        if done < count {
            for k in (0..count).filter(|k| !chunk.done[*k]) {
                let light = self.sample(tally, column(k), row);
                line.iter_mut().for_each(|line| line.add(column(k), light));
            }
        }
    }

    /// Follows the light of one sample; gives what fell on it and what of that reached the audience.
    #[inline]
    pub fn sample(&self, tally: &mut LightTally, column: i64, row: i64) -> [f64; 2] {
        let Lit { ground, relief, stage, .. } = self;
        let Some((p_mm, normal)) = ground.sample(column, row) else { return [0.0; 2] };
        let mut place_m = stage.place_m(p_mm);
        let mut i = (stage.projector_m - place_m).normalize();
        let taken = i.dot(normal);
        tally.samples += 1;
        if taken <= 0.0 || matches!(relief.end(column, row, i), End::At(..)) {
            tally.shadowed += 1;
            return [0.0; 2];
        }
        tally.incident += taken;
        let (mut left, mut n) = (taken, normal.normalize());
        let (mut column, mut row) = (column, row);
        for bounce in 0..BOUNCES {
            let way = stage.metal.scatter(i, n, i.dot(n), || draw(column, row, bounce));
            tally.absorbed += left * way.absorbed;
            tally.unresolved += left * way.masked;
            left *= way.goes_on;
            match relief.end(column, row, way.out) {
                End::Clear => {
                    let out = stage.rotation * way.out;
                    let bin = bin_of(out.x, ROOM_BINS) + ROOM_BINS * bin_of(out.y, ROOM_BINS);
                    tally.room[bin] += left;
                    if stage.silhouette.met(place_m, way.out) {
                        tally.on_audience += left;
                        tally.met[bin] += left;
                        return [taken, left];
                    }
                    tally.leak += left;
                    return [taken, 0.0];
                }
                End::Unknown => break,
                End::At(next_column, next_row) => {
                    let Some((p_mm, normal)) = ground.sample(next_column, next_row) else { break };
                    (i, n) = (-way.out, normal.normalize());
                    if i.dot(n) <= 0.0 {
                        break;
                    }
                    (column, row) = (next_column, next_row);
                    place_m = stage.place_m(p_mm);
                }
            }
        }
        tally.unresolved += left;
        [taken, 0.0]
    }
}

impl LightTally {
    /// Adds the samples of `window`, and to a map of shares on the audience if there is one; `heights` covers it with a halo of one sample or more where there is data. Rays
    /// are followed as far as `heights` reaches.
    pub fn add(
        &mut self,
        heights: &Heights,
        window: Window,
        step_mm: f64,
        pose: &Pose,
        room: &Room,
        mut map: Option<&mut Pixels>,
    ) {
        let Some(lit) = Lit::new(heights, window, step_mm, pose, room) else { return };
        let outlines = lit.outlines();
        let map_of = map.as_deref();
        let bands: Vec<Band> = bands(window)
            .into_par_iter()
            .map(|(first, end)| {
                let (mut tally, mut chunk) = (lit.tally(), Chunk::new());
                let mut light = Vec::new();
                for row in first..end {
                    let mut line = map_of.map(|map| map.line(window));
                    let sums = (&mut tally, &mut chunk);
                    lit.row(outlines.as_deref(), (row, window), sums, &mut line, |_, _| {});
                    light.extend(line);
                }
                (tally, light)
            })
            .collect();
        let mut row = window.row;
        for (tally, light) in &bands {
            self.merge(tally);
            for line in light {
                if let Some(map) = map.as_deref_mut() {
                    map.add(row, line);
                }
                row += 1;
            }
        }
    }
}
