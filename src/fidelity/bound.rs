//! How low a cutter could get at best, from the highest samples of small blocks: what a closing is good for is known
//! of most places without making it.

use crate::compensation::Marked;
use crate::cutter::Shape;
use crate::grid::{Heights, Window};

use super::offsets::{Offset, lower_over, offsets, raise_over};

/// Samples along the side of a block.
const BLOCK: i64 = 8;
/// Blocks along the side of a piece that is looked at by itself.
const PIECE: i64 = 16;

/// The highest sample of each block of a window, minus infinity where there is none.
pub struct Peaks {
    /// In blocks, counted from the part's corner.
    blocks: Window,
    z_mm: Vec<f32>,
}

impl Peaks {
    /// Looks over heights.
    pub fn of(heights: &Heights) -> Peaks {
        let window = heights.window;
        let blocks = blocks(window);
        let mut z_mm = vec![f32::NEG_INFINITY; blocks.samples()];
        for row in window.row..window.row_end() {
            let line = heights.row(row);
            let start = (row.div_euclid(BLOCK) - blocks.row) as usize * blocks.columns;
            let mut at = window.column;
            for peak in &mut z_mm[start..start + blocks.columns] {
                let end = ((at.div_euclid(BLOCK) + 1) * BLOCK).min(window.column_end());
                let part = &line[(at - window.column) as usize..(end - window.column) as usize];
                *peak = part.iter().fold(*peak, |most, z| higher(most, *z));
                at = end;
            }
        }
        Peaks { blocks, z_mm }
    }

    /// Where a cutter's closing could be lower than `lowest`, a closing of `design` in the same window. The heights
    /// looked over should reach as far around as those that the closing would be made from.
    pub fn lower_within(&self, shape: &Shape, step_mm: f64, lowest: &Heights, design: &Heights) -> Lower {
        let wanted = blocks(lowest.window);
        let reach = (shape.radius_mm() / (BLOCK as f64 * step_mm)).ceil() as i64 + 1;
        let standing = self.standing(shape, step_mm, wanted.grown(reach as usize), reach);
        let near = offsets(shape, step_mm, reach, |blocks| (blocks * BLOCK - BLOCK + 1).max(0));
        let mut least = Heights { window: wanted, z_mm: vec![f32::INFINITY; wanted.samples()] };
        lower_over(&mut least, &standing, &near);
        // The highest sample of each block that could be lower.
        let mut tops = Heights { window: wanted, z_mm: vec![f32::NEG_INFINITY; wanted.samples()] };
        let mut found = Vec::new();
        for row in (wanted.row..wanted.row_end()).step_by(PIECE as usize) {
            for column in (wanted.column..wanted.column_end()).step_by(PIECE as usize) {
                let side = PIECE as usize;
                let piece = Window { column, row, columns: side, rows: side };
                let Some(piece) = wanted.intersection(&piece) else { continue };
                found.extend(lower(&least, piece, lowest, design, &mut tops));
            }
        }
        let is_flat = matches!(shape, Shape::Flat { .. });
        let marks = (is_flat && !found.is_empty()).then(|| {
            let hopes = hopes(&tops, standing.window, reach as usize, &near);
            let could = hopes.z_mm.iter().zip(&standing.z_mm).map(|(hope, stands)| stands < hope).collect();
            let any = tops.z_mm.iter().map(|top| *top > f32::NEG_INFINITY).collect();
            [Marked::new(BLOCK as usize, standing.window, could), Marked::new(BLOCK as usize, wanted, any)]
        });
        Lower { within: together(found, (shape.radius_mm() / step_mm).ceil() as usize), marks }
    }

    /// The lowest that the cutter could stand at any sample of each block.
    fn standing(&self, shape: &Shape, step_mm: f64, out: Window, reach: i64) -> Heights {
        let mut standing = Heights { window: out, z_mm: vec![f32::NEG_INFINITY; out.samples()] };
        let offsets = offsets(shape, step_mm, reach, |blocks| blocks * BLOCK + BLOCK - 1);
        let around = out.grown(reach as usize);
        let mut z_mm = vec![f32::NEG_INFINITY; around.samples()];
        if let Some(shared) = around.intersection(&self.blocks) {
            for row in shared.row..shared.row_end() {
                let place = |window: Window| {
                    let column = (shared.column - window.column) as usize;
                    (row - window.row) as usize * window.columns + column
                };
                let (to, at) = (place(around), place(self.blocks));
                z_mm[to..to + shared.columns].copy_from_slice(&self.z_mm[at..at + shared.columns]);
            }
        }
        raise_over(&mut standing, &Heights { window: around, z_mm }, &offsets);
        standing
    }
}

/// Where a cutter's closing could be lower than another one.
pub struct Lower {
    /// Windows that hold all such samples, as few as are together less work to close.
    pub within: Vec<Window>,
    /// Of a flat, where it could have to stand for that, and the samples by themselves.
    pub marks: Option<[Marked; 2]>,
}

/// For every block in which a cutter could stand, the highest of those near it that it could lower.
fn hopes(tops: &Heights, out: Window, reach: usize, near: &[Offset]) -> Heights {
    let around = out.grown(reach);
    let mut known = Heights { window: around, z_mm: vec![f32::NEG_INFINITY; around.samples()] };
    for row in tops.window.row..tops.window.row_end() {
        let column = (tops.window.column - around.column) as usize;
        let start = (row - around.row) as usize * around.columns + column;
        known.z_mm[start..start + tops.window.columns].copy_from_slice(tops.row(row));
    }
    let mut hopes = Heights { window: out, z_mm: vec![f32::NEG_INFINITY; out.samples()] };
    raise_over(&mut hopes, &known, near);
    hopes
}

/// Windows that cover these, in which closing takes less work: each is closed with `reach` samples around it.
fn together(mut windows: Vec<Window>, reach: usize) -> Vec<Window> {
    let work = |window: &Window| window.grown(reach).samples();
    let mut at = 0;
    while at < windows.len() {
        let one = windows[at];
        let other = (0..windows.len())
            .find(|&k| k != at && work(&one.hull(&windows[k])) <= work(&one) + work(&windows[k]));
        match other {
            Some(other) => {
                windows[at] = one.hull(&windows[other]);
                windows.remove(other);
                at = 0;
            }
            None => at += 1,
        }
    }
    windows
}

/// The samples of some blocks at which `lowest` stands above both the design and the least of its block; the highest
/// of them in each block goes to `tops`.
fn lower(
    least: &Heights,
    blocks: Window,
    lowest: &Heights,
    design: &Heights,
    tops: &mut Heights,
) -> Option<Window> {
    let mut found: Option<[i64; 4]> = None;
    for row in blocks.row..blocks.row_end() {
        for column in blocks.column..blocks.column_end() {
            let side = BLOCK as usize;
            let block = Window { column: column * BLOCK, row: row * BLOCK, columns: side, rows: side };
            let Some(part) = lowest.window.intersection(&block) else { continue };
            let bound = least.row(row)[(column - least.window.column) as usize];
            let from = (part.column - lowest.window.column) as usize;
            let cut = |heights: &'_ Heights, row| -> [f32; BLOCK as usize] {
                let row = &heights.row(row)[from..from + part.columns];
                row.first_chunk().copied().unwrap_or_else(|| {
                    let mut line = [f32::NEG_INFINITY; BLOCK as usize];
                    line[..part.columns].copy_from_slice(row);
                    line
                })
            };
            let mut top = f32::NEG_INFINITY;
            for row in part.row..part.row_end() {
                let (lowest, design) = (cut(lowest, row), cut(design, row));
                // Without branches, so that all of them are looked at together.
                top = lowest.iter().zip(&design).fold(top, |top, (z, design)| {
                    if (z > design) & (*z > bound) & (*z > top) { *z } else { top }
                });
            }
            if top > f32::NEG_INFINITY {
                let at = (row - tops.window.row) as usize * tops.window.columns;
                tops.z_mm[at + (column - tops.window.column) as usize] = top;
                let ends = [part.column, part.row, part.column_end(), part.row_end()];
                let all = |f: [i64; 4]| {
                    [f[0].min(ends[0]), f[1].min(ends[1]), f[2].max(ends[2]), f[3].max(ends[3])]
                };
                found = Some(found.map_or(ends, all));
            }
        }
    }
    found.map(|[column, row, column_end, row_end]| Window {
        column,
        row,
        columns: (column_end - column) as usize,
        rows: (row_end - row) as usize,
    })
}

/// The blocks that a window touches.
fn blocks(window: Window) -> Window {
    let (column, row) = (window.column.div_euclid(BLOCK), window.row.div_euclid(BLOCK));
    Window {
        column,
        row,
        columns: ((window.column_end() - 1).div_euclid(BLOCK) + 1 - column).max(0) as usize,
        rows: ((window.row_end() - 1).div_euclid(BLOCK) + 1 - row).max(0) as usize,
    }
}

/// The higher of two; no data is not.
fn higher(most: f32, z: f32) -> f32 {
    if z > most { z } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compensation::{Closings, Profile, Tables, closing};

    const STEP_MM: f64 = 0.02;

    /// Ridges and a pit with a floor, with a hole in it.
    fn relief(window: Window) -> Heights {
        let mut heights = Heights::empty(window);
        for (index, z) in heights.z_mm.iter_mut().enumerate() {
            let (c, r) = ((index % window.columns) as f32, (index / window.columns) as f32);
            let pit = (60.0..190.0).contains(&c) && (70.0..150.0).contains(&r);
            let ridges = -0.4 + 0.3 * (0.11 * c).sin() * (0.07 * r).cos();
            *z = if pit { -1.5 } else { ridges };
            if (c - 120.0).hypot(r - 100.0) < 9.0 {
                *z = f32::NAN;
            }
        }
        heights
    }

    #[test]
    fn where_it_says_that_a_cutter_gets_no_lower_it_does_not() {
        let around = relief(Window { column: -37, row: 11, columns: 460, rows: 400 });
        let peaks = Peaks::of(&around);
        let mut spared = 0;
        for (name, other) in [
            ("flat:2", "ball:0.4"),
            ("ball:1.6", "flat:0.6"),
            ("bull:1:0.2", "ball:0.4"),
            // Its corner lies between the places that blocks are looked at.
            ("bull:1.1:0.002", "ball:0.4"),
            ("vee:90:0.1:1", "ball:0.8"),
        ] {
            let shapes = [name, other].map(|text| text.parse::<Shape>().expect("a cutter"));
            let [tried, known] = shapes.map(|shape| Profile::new(shape, STEP_MM, 0.0).expect("a profile"));
            let reach = tried.reach().max(known.reach()) as i64;
            let inner = around.window;
            let inner = Window {
                column: inner.column + 2 * reach,
                row: inner.row + 2 * reach,
                columns: inner.columns - 4 * reach as usize,
                rows: inner.rows - 4 * reach as usize,
            };
            let (lowest, closed) = (closing(&around, &known, inner), closing(&around, &tried, inner));
            let design = around.crop(inner);
            let Lower { within, marks } = peaks.lower_within(&shapes[0], STEP_MM, &lowest, &design);
            let tables = Tables::new(tried);
            let mut closings = Closings::new();
            let marked = marks
                .as_ref()
                .map(|[stands, marks]| closings.of_flat_at(&around, &tables, inner, [stands, marks]));
            assert_eq!(marked.is_some(), name.starts_with("flat"));
            for row in inner.row..inner.row_end() {
                let lines = closed.row(row).iter().zip(lowest.row(row)).zip(design.row(row));
                for (column, ((a, b), z)) in (inner.column..).zip(lines) {
                    let marked = marked.map(|closed| closed.row(row)[(column - inner.column) as usize]);
                    if let Some(marked) = marked {
                        assert!(
                            marked.min(*b).max(*z) == a.min(*b).max(*z),
                            "{name} at {column}, {row}: {marked}, {a}"
                        );
                    }
                    let inside = within.iter().any(|w| {
                        (w.column..w.column_end()).contains(&column) && (w.row..w.row_end()).contains(&row)
                    });
                    let lower = a < b && b > z;
                    assert!(inside || !lower, "{name} at {column}, {row}: {a} under {b}, design {z}");
                    spared += u32::from(!inside);
                }
            }
        }
        assert!(spared > 10_000, "the bound is good for something: {spared}");
    }

    #[test]
    fn a_floor_that_a_ball_reaches_is_not_tried_with_a_flat() {
        let window = Window { column: 0, row: 0, columns: 400, rows: 400 };
        let floor = Heights { window, z_mm: vec![-1.0; window.samples()] };
        let inner = Window { column: 150, row: 150, columns: 100, rows: 100 };
        let flat = "flat:2".parse().expect("a cutter");
        let mut lowest = floor.crop(inner);
        let design = lowest.clone();
        let peaks = Peaks::of(&floor);
        assert!(peaks.lower_within(&flat, STEP_MM, &lowest, &design).within.is_empty());
        // Nor where something else stands in the way, but where the other cutter leaves more than this one would.
        lowest.z_mm[50 * 100 + 50] = -0.9;
        let within = peaks.lower_within(&flat, STEP_MM, &lowest, &design).within;
        let one = Window { column: 200, row: 200, columns: 8, rows: 8 };
        assert_eq!(within, [one]);
    }
}
