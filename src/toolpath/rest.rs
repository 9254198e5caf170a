//! Rest machining: where earlier cutters left more than they should.
//!
//! What a cutter cannot reach is its closing less the design. A finer cutter has to pass wherever it touches such a
//! place, which is within its radius.

use rayon::prelude::*;

use super::passes::Layout;
use super::{Error, Progress};
use crate::compensation::{self, Closings, Profile, Tables};
use crate::grid::Window;
use crate::surface::Surface;

/// Where a place is the same on grids of which one counts to it in other units, in mm.
const SAME_MM: f64 = 1e-6;

/// Samples along each side of a block that is worked out at once.
const BLOCK: usize = 1024;

/// Places within a cutter's radius of what earlier cutters left, as stretches of X in mm, tile frame, for each row of
/// samples.
#[derive(Debug)]
pub struct Rest {
    step_mm: f64,
    first_row: i64,
    rows: Vec<Vec<[f64; 2]>>,
}

impl Rest {
    /// Finds what all of the cutters `before` leave higher than `over_mm` above the samples, and the places from which
    /// a cutter of `radius_mm` touches it.
    pub fn find(
        surface: &dyn Surface,
        before: &[Profile],
        over_mm: f64,
        radius_mm: f64,
        progress: Progress,
    ) -> Result<Rest, Error> {
        let lattice = surface.lattice();
        let step_mm = lattice.step_mm;
        let left = left(surface, before, over_mm, progress)?;
        let reach_mm = radius_mm + step_mm;
        let reach = (reach_mm / step_mm).floor() as i64;
        let rows: Vec<Vec<[f64; 2]>> = (-reach..lattice.rows as i64 + reach)
            .into_par_iter()
            .map(|row| {
                let mut near: Vec<[f64; 2]> = (-reach..=reach)
                    .filter_map(|off| Some((off, left.get(usize::try_from(row + off).ok()?)?)))
                    .flat_map(|(off, runs)| {
                        let away_mm = off as f64 * step_mm;
                        let chord_mm = (reach_mm * reach_mm - away_mm * away_mm).max(0.0).sqrt();
                        runs.iter().map(move |[first, last]| {
                            let x_mm = |column: &usize| (*column as f64 + 0.5) * step_mm;
                            [x_mm(first) - chord_mm, x_mm(last) + chord_mm]
                        })
                    })
                    .collect();
                near.sort_by(|a, b| a[0].total_cmp(&b[0]));
                let mut joined: Vec<[f64; 2]> = Vec::new();
                for stretch in near {
                    match joined.last_mut() {
                        Some(last) if stretch[0] <= last[1] => last[1] = last[1].max(stretch[1]),
                        _ => joined.push(stretch),
                    }
                }
                joined
            })
            .collect();
        Ok(Rest { step_mm, first_row: -reach, rows })
    }

    /// Whether a cutter at a place of the tile's frame touches what was left.
    pub fn near(&self, place_mm: [f64; 2]) -> bool {
        let row = ((place_mm[1] + SAME_MM) / self.step_mm).floor() as i64 - self.first_row;
        let Some(stretches) = usize::try_from(row).ok().and_then(|row| self.rows.get(row)) else {
            return false;
        };
        let after = stretches.partition_point(|stretch| stretch[0] - SAME_MM <= place_mm[0]);
        after > 0 && place_mm[0] <= stretches[after - 1][1] + SAME_MM
    }

    /// Which positions of a pass are cut: those that are near, and gaps of up to `stay_mm` between them, over which the
    /// cutter stays down.
    pub(super) fn kept(&self, layout: &Layout, pass: usize, stay_mm: f64) -> Vec<bool> {
        let stay = (stay_mm / layout.length_mm()) as usize;
        let mut kept = vec![false; layout.count];
        let mut last: Option<usize> = None;
        for i in 0..layout.count {
            if !self.near(layout.place_mm(pass, i)) {
                continue;
            }
            // What lies between this and the last one that is kept.
            let from = last.map_or(i, |last| last + 1);
            kept[if i - from > stay { i } else { from }..=i].fill(true);
            last = Some(i);
        }
        kept
    }
}

/// Runs of columns in each row where the lowest of the closings stands higher than `over_mm` above the samples.
fn left(
    surface: &dyn Surface,
    before: &[Profile],
    over_mm: f64,
    progress: Progress,
) -> Result<Vec<Vec<[usize; 2]>>, Error> {
    let lattice = surface.lattice();
    let reach = before.iter().map(Profile::reach).max().unwrap_or(0);
    let starts: Vec<usize> = (0..lattice.rows).step_by(BLOCK).collect();
    let mut rows: Vec<Vec<[usize; 2]>> = vec![Vec::new(); lattice.rows];
    let tables: Vec<Tables> = before.iter().map(|profile| Tables::new(*profile)).collect();
    for &row in &starts {
        let height = BLOCK.min(lattice.rows - row);
        let columns: Vec<usize> = (0..lattice.columns).step_by(BLOCK).collect();
        let blocks: Vec<Vec<Vec<[usize; 2]>>> = columns
            .par_iter()
            .map_init(Closings::new, |closings, &column| {
                let width = BLOCK.min(lattice.columns - column);
                let window = Window { column: column as i64, row: row as i64, columns: width, rows: height };
                let around = surface.heights(window.grown(2 * reach), surface.top_mm())?;
                let mut over = vec![true; window.samples()];
                for tables in &tables {
                    let left = compensation::residual(closings.of(&around, tables, window), &around);
                    // False for no data, too.
                    over.iter_mut().zip(&left.z_mm).for_each(|(over, &z)| *over &= f64::from(z) > over_mm);
                }
                Ok(over.chunks_exact(width).map(|row| runs(row, column)).collect())
            })
            .collect::<Result<_, Error>>()?;
        for block in blocks {
            for (offset, runs) in block.into_iter().enumerate() {
                rows[row + offset].extend(runs);
            }
        }
        progress((row + height) as f64 / lattice.rows as f64);
    }
    Ok(rows)
}

/// First and last column of each run.
fn runs(row: &[bool], column: usize) -> Vec<[usize; 2]> {
    let mut at = column;
    let mut out = Vec::new();
    for run in row.chunk_by(|a, b| a == b) {
        if run[0] {
            out.push([at, at + run.len() - 1]);
        }
        at += run.len();
    }
    out
}
