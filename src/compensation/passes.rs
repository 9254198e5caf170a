use super::field::{Field, PAD, Sense, Targets};
use super::pairs::{OverSamples, PassRow, TargetRow, UnderPasses};
use super::stencil::Stencil;
use super::way::dilate;
use super::{Profile, Tables};
use crate::grid::{Heights, Window};
use rayon::prelude::*;
use std::sync::Arc;

/// Positions along one row of a planner's or a controller's grid: x0_mm + i step, at y_mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowTarget {
    pub x0_mm: f64,
    pub y_mm: f64,
    pub count: usize,
}

/// Positions where a cutter stood along one row: z of its lowest point at x0_mm + i step, NaN
/// where it did not stand.
#[derive(Clone, Copy, Debug)]
pub struct RowPass<'a> {
    pub x0_mm: f64,
    pub y_mm: f64,
    pub z_mm: &'a [f32],
}

/// Rows that are worked on together.
const BATCH: usize = 32;

/// Columns of samples of one tile.
const TILE_COLUMNS: usize = 2048;

/// Rows of one tile under passes, at least.
const TILE_ROWS: usize = 128;

/// Units of controllers' grids to a sample: what is left of a coordinate on one is known to the last bit.
const GRID: f64 = 1000.0;

/// A coordinate as a whole sample and what is left, in samples, within half a sample.
fn split(mm: f64, step_mm: f64) -> (i64, f64) {
    let samples = mm / step_mm - 0.5;
    let whole = samples.round();
    let left = samples - whole;
    // Positions that are meant to stand on samples, or on a controller's grid beside them, share one table.
    let meant = (left * GRID).round() / GRID;
    (whole as i64, if (left - meant).abs() < 1e-7 { meant } else { left })
}

/// Cutter locations at x0_mm + i step, y_mm for i < count: s(d) is taken at the true distances.
/// NaN where no data is in reach.
pub fn row(h: &Heights, profile: &Profile, x0_mm: f64, y_mm: f64, count: usize) -> Vec<f32> {
    rows(h, profile, &[RowTarget { x0_mm, y_mm, count }]).pop().unwrap_or_default()
}

/// [`row`] for many rows, in any order; neighbouring rows share their work, so give many.
pub fn rows(h: &Heights, profile: &Profile, targets: &[RowTarget]) -> Vec<Vec<f32>> {
    rows_by(h, &Tables::new(*profile), targets)
}

/// [`rows`] with tables that last longer than a call.
pub fn rows_by(h: &Heights, tables: &Tables, targets: &[RowTarget]) -> Vec<Vec<f32>> {
    let profile = tables.profile();
    let step_mm = profile.step_mm();
    let mut order: Vec<usize> = (0..targets.len()).collect();
    order.sort_by(|&i, &j| targets[i].y_mm.total_cmp(&targets[j].y_mm).then(i.cmp(&j)));
    let mut tasks = Vec::new();
    // Rows out of each other's reach share nothing, and what lies between would be read for nothing.
    let apart_mm = 2.0 * profile.radius_mm();
    let near = order.chunk_by(|&i, &j| targets[j].y_mm - targets[i].y_mm <= apart_mm);
    for batch in near.flat_map(|near| near.chunks(BATCH)) {
        let longest = batch.iter().map(|&i| targets[i].count).max().unwrap_or(0);
        for from in (0..longest).step_by(TILE_COLUMNS) {
            tasks.push((batch, from));
        }
    }
    let done: Vec<Vec<(usize, usize, Vec<f32>)>> = tasks
        .into_par_iter()
        .map(|(batch, from)| {
            let parts: Vec<(usize, RowTarget)> = batch
                .iter()
                .filter(|&&i| targets[i].count > from)
                .map(|&i| {
                    let t = targets[i];
                    let count = (t.count - from).min(TILE_COLUMNS);
                    (i, RowTarget { x0_mm: t.x0_mm + from as f64 * step_mm, y_mm: t.y_mm, count })
                })
                .collect();
            let z = few_rows(h, tables, &parts.iter().map(|p| p.1).collect::<Vec<_>>());
            parts.iter().zip(z).map(|((i, _), z)| (*i, from, z)).collect()
        })
        .collect();
    let mut out: Vec<Vec<f32>> = targets.iter().map(|t| vec![f32::NAN; t.count]).collect();
    for (i, from, z) in done.into_iter().flatten() {
        out[i][from..from + z.len()].copy_from_slice(&z);
    }
    out
}

/// Rows in order of y.
fn few_rows(h: &Heights, tables: &Tables, targets: &[RowTarget]) -> Vec<Vec<f32>> {
    let profile = tables.profile();
    let step_mm = profile.step_mm();
    let reach = profile.reach() as i64;
    let mut stencils = Vec::new();
    let mut rows = Vec::with_capacity(targets.len());
    let (mut left, mut right) = (i64::MAX, i64::MIN);
    // Rows that start further right than others end in the field too.
    let columns = targets.iter().map(|t| t.count).max().unwrap_or(0);
    let mut at = Vec::with_capacity(targets.len());
    for target in targets {
        let (column, x) = split(target.x0_mm, step_mm);
        let (row, y) = split(target.y_mm, step_mm);
        left = left.min(column);
        right = right.max(column + columns as i64);
        at.push((column, row, x, y));
    }
    let halo = reach + 2;
    for (column, row, x, y) in at {
        // Sample less axis: the axis stands x right of and y above its sample.
        let stencil = shared_stencil(&mut stencils, tables, 0.0 - x, 0.0 - y);
        rows.push(TargetRow { stencil, row, shift: halo + column - left, y: row as f64 + y });
    }
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return Vec::new() };
    let input = Window {
        column: left - halo,
        row: first.row - halo,
        columns: (right - left + 2 * halo) as usize,
        rows: (last.row - first.row + 1 + 2 * halo) as usize,
    };
    let pairs = OverSamples {
        stencils: &stencils,
        rows: &rows,
        reach,
        input_rows: input.rows as i64,
        input_row: input.row,
        slack_mm: stencils.iter().fold(0.0, |m, s| s.slack_mm.max(m)),
    };
    let mut done = Targets::new(columns, rows.len());
    dilate(&mut Field::of(h.into(), input, Sense::Raise), &pairs, profile, &mut done);
    targets
        .iter()
        .enumerate()
        .map(|(b, t)| done.row(b)[..t.count].iter().map(|z| Sense::Raise.give(*z)).collect())
        .collect()
}

fn shared_stencil(stencils: &mut Vec<Arc<Stencil>>, tables: &Tables, fx: f64, fy: f64) -> usize {
    match stencils.iter().position(|s| s.fx == fx && s.fy == fy) {
        Some(at) => at,
        None => {
            stencils.push(tables.at(fx, fy));
            stencils.len() - 1
        }
    }
}

/// Cutter locations at single points [x, y] in mm: as [`row`], with s and the sum in f64. For few
/// points: each takes every sample under the cutter.
pub fn points(h: &Heights, profile: &Profile, points_mm: &[[f64; 2]]) -> Vec<f64> {
    let step_mm = profile.step_mm();
    let reach = profile.reach() as i64 + 1;
    points_mm
        .par_iter()
        .map(|&[x_mm, y_mm]| {
            let (column, x) = split(x_mm, step_mm);
            let (row, y) = split(y_mm, step_mm);
            let around = Window { column, row, columns: 1, rows: 1 }.grown(reach as usize);
            let Some(around) = around.intersection(&h.window) else { return f64::NAN };
            let mut best = f64::NEG_INFINITY;
            for j in around.row..around.row_end() {
                let dy_mm = ((j - row) as f64 - y) * step_mm;
                let z_mm = &h.row(j)[(around.column - h.window.column) as usize..][..around.columns];
                for (i, z_mm) in z_mm.iter().enumerate() {
                    let dx_mm = ((around.column + i as i64 - column) as f64 - x) * step_mm;
                    if !z_mm.is_finite() {
                        continue;
                    }
                    if let Some(s_mm) = profile.s_mm((dx_mm * dx_mm + dy_mm * dy_mm).sqrt()) {
                        best = best.max(*z_mm as f64 + s_mm);
                    }
                }
            }
            if best.is_finite() { best } else { f64::NAN }
        })
        .collect()
}

/// The surface that exactly these passes leave at the samples of `out` of a stock without top:
/// min over positions in reach of z - s(d). NaN where none is in reach. Positions are points; what
/// is cut between two of them is not counted.
pub fn machined_by_rows(passes: &[RowPass], profile: &Profile, out: Window) -> Heights {
    let step_mm = profile.step_mm();
    let reach = profile.reach() as i64;
    let mut done = Heights::empty(out);
    if out.columns == 0 || out.rows == 0 {
        return done;
    }
    let tables = Tables::new(*profile);
    let mut order: Vec<&RowPass> = passes.iter().collect();
    order.sort_by(|p, q| p.y_mm.total_cmp(&q.y_mm));
    let tile_rows = TILE_ROWS.max(2 * reach as usize);
    let columns = out.columns;
    done.z_mm.par_chunks_mut(tile_rows * columns).enumerate().for_each(|(band, z_mm)| {
        let row = out.row + (band * tile_rows) as i64;
        let rows = z_mm.len() / columns;
        let near = (row - reach - 1) as f64 * step_mm..(row + rows as i64 + reach + 2) as f64 * step_mm;
        let low = order.partition_point(|p| p.y_mm < near.start);
        let high = order.partition_point(|p| p.y_mm < near.end).max(low);
        for column in (0..columns).step_by(TILE_COLUMNS) {
            let width = TILE_COLUMNS.min(columns - column);
            let tile = Window { column: out.column + column as i64, row, columns: width, rows };
            let targets = tile_under_passes(&order[low..high], &tables, tile);
            for row in 0..rows {
                let to = &mut z_mm[row * columns + column..][..width];
                for (to, z) in to.iter_mut().zip(targets.row(row)) {
                    *to = Sense::Lower.give(*z);
                }
            }
        }
    });
    done
}

fn tile_under_passes(passes: &[&RowPass], tables: &Tables, tile: Window) -> Targets {
    let profile = tables.profile();
    let step_mm = profile.step_mm();
    let reach = profile.reach() as i64;
    let halo = reach + 2;
    let columns = tile.columns + 2 * halo as usize;
    let mut field = Field::empty(columns, passes.len());
    let mut stencils = Vec::new();
    let mut rows = Vec::with_capacity(passes.len());
    for (a, pass) in passes.iter().enumerate() {
        let (column, x) = split(pass.x0_mm, step_mm);
        let (row, y) = split(pass.y_mm, step_mm);
        rows.push(PassRow { stencil: shared_stencil(&mut stencils, tables, x, y), row });
        let to = field.row_mut(a);
        let offset = column - (tile.column - halo);
        let skip = (-offset).max(0) as usize;
        for (i, z_mm) in pass.z_mm.iter().enumerate().skip(skip) {
            let Some(to) = to[PAD..PAD + columns].get_mut((offset + i as i64) as usize) else { break };
            *to = Sense::Lower.take(*z_mm);
        }
    }
    let pairs = UnderPasses {
        stencils: &stencils,
        passes: &rows,
        reach,
        target_row: tile.row,
        target_rows: tile.rows,
        slack_mm: stencils.iter().fold(0.0, |m, s| s.slack_mm.max(m)),
        shift: halo,
    };
    let mut targets = Targets::new(tile.columns, tile.rows);
    dilate(&mut field, &pairs, profile, &mut targets);
    targets
}
