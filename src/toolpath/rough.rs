//! Clearing the stock by levels, row by row.
//!
//! Each row has a profile, how low the cutter may stand along it; a level cuts the row where the profile
//! is below the level above. A place is cut at a level only after the same place at the level above, so
//! the bite is at most the stepdown, whatever the cutter.

use rayon::prelude::*;

use super::envelope::{Cutter, Envelope};
use super::finish::{Pattern, backwards};
use super::levels::{self, Profile};
use super::pen::Pen;
use super::ramp::ramp;
use super::strip::{Border, Strip, band_length};
use super::{Axis, Error, Layout, Progress, Site, Toolpath, funnel};
use crate::compensation::{self, Faces, Tables};
use crate::cutter::Shape;

/// How far a roughing profile may stand above what is left for it, in mm besides a grid unit: what is
/// left varies by it, and the moves stay few. A cut that would nowhere go deeper than that, or than half a
/// stepdown, is left out: it is not worth its retract and its way down.
const SLACK_MM: f64 = 0.01;

/// Longer links, in stepovers, are travelled on the clearance plane.
const LONGEST_STEPOVERS: f64 = 8.0;

/// Part of the diameter between rows, if it is not given.
pub const STEPOVER: f64 = 0.4;

/// What a roughing operation asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub shape: Shape,
    pub stepdown_mm: f64,
    /// Between rows; 0.4 of the diameter if left out.
    pub stepover_mm: Option<f64>,
    pub stock_to_leave_mm: f64,
    /// 0: rows along X, 90: along Y.
    pub direction_deg: f64,
    /// One way: every cut climbs, and begins anew.
    pub pattern: Pattern,
    /// Fall over way at which the cutter goes down into solid metal; infinite: straight down.
    pub ramp_slope: f64,
    /// Metal around the part that later cutters need out of the way: their overrun plus their radius.
    pub clear_mm: f64,
}

/// One row: where it lies across, its profiles, and how high the surface may stand on the way to it.
struct Row {
    across: i32,
    profiles: Vec<Profile>,
    /// Bound in units of a level link from the row before, over stretches of `Plan::coarse` units.
    between: Vec<f64>,
}

struct Plan {
    layout: Layout,
    rows: Vec<Row>,
    /// Units of a stretch of `Row::between`, a whole number of positions.
    coarse: i32,
}

impl Plan {
    /// Bound in units of a level link to row `k` from the one before, at a place along them.
    fn between(&self, k: usize, u: i32) -> Option<f64> {
        let place = (u - self.layout.start) / self.coarse;
        self.rows[k].between.get(place.max(0) as usize).copied()
    }

    /// Half of what row `k` is apart from the one before.
    fn half_stepover_mm(&self, site: &Site, k: usize) -> f64 {
        0.5 * f64::from(self.rows[k].across - self.rows[k - 1].across) * site.unit_mm
    }
}

/// Plans the levels of a roughing operation. The path stays `stock_to_leave_mm` above the samples (less the
/// budget), and no more than `SLACK_MM` and a grid unit above that, twice `SLACK_MM` where a level would take no more.
pub fn rough(site: &Site, params: &Params, progress: Progress) -> Result<Toolpath, Error> {
    let (layout, stepdown) = layout(site, params)?;
    let plan = profiles(site, params, layout, progress)?;
    let lowest =
        plan.rows.iter().flat_map(|row| &row.profiles).flatten().map(|v| v[1]).min().ok_or_else(|| {
            let lattice = site.surface.lattice();
            Error::NoData { samples: lattice.columns * lattice.rows }
        })?;
    let mut pen = Pen::new(site);
    let top = pen.top();
    let mut above = top;
    while above > lowest {
        let level = above.saturating_sub(stepdown);
        cut_level(site, params, &plan, above, level, &mut pen);
        above = level;
    }
    let path = pen.finish();
    if path.moves.is_empty() {
        let above_mm = f64::from(top - lowest) * site.unit_mm;
        return Err(Error::NothingToRough { above_mm, leave_mm: params.stock_to_leave_mm });
    }
    progress(1.0);
    Ok(path)
}

/// How far the axis goes past the part along the rows and across them, in mm: until the part is out of reach, so that
/// the margin can be cut as deep as the part's border, and farther where `clear_mm` of metal around the part has
/// to go. Along the rows it goes until no fin is left between the ends of two of them: a fin as high as the
/// part is deep would stand in the way of a shank.
pub fn overrun_mm(radius_mm: f64, stepover_mm: f64, clear_mm: f64) -> [f64; 2] {
    let between_mm = (radius_mm * radius_mm - 0.25 * stepover_mm * stepover_mm).max(0.0).sqrt();
    [between_mm, radius_mm].map(|covered_mm| radius_mm.max(clear_mm - covered_mm))
}

fn layout(site: &Site, params: &Params) -> Result<(Layout, i32), Error> {
    site.validate(0.0)?;
    let (along, slope) = Axis::from_deg(params.direction_deg)?;
    if slope != 0.0 {
        return Err(Error::Direction { direction_deg: params.direction_deg });
    }
    let radius = params.shape.radius_mm();
    if !(params.stock_to_leave_mm >= 0.0 && params.stock_to_leave_mm.is_finite()) {
        return Err(Error::StockToLeave { leave_mm: params.stock_to_leave_mm });
    }
    if !(params.clear_mm >= 0.0 && params.clear_mm.is_finite()) {
        return Err(Error::Number { name: "clear_mm", value: params.clear_mm, wanted: "0 or more" });
    }
    let stepdown = (params.stepdown_mm / site.unit_mm + 1e-9).floor();
    if !(stepdown >= 1.0 && params.stepdown_mm.is_finite()) {
        return Err(Error::Stepdown { stepdown_mm: params.stepdown_mm, unit_mm: site.unit_mm });
    }
    let stepover_mm = params.stepover_mm.unwrap_or(STEPOVER * 2.0 * radius);
    if !(stepover_mm > 0.0 && stepover_mm <= 2.0 * radius) {
        return Err(Error::Stepover { stepover_mm, diameter_mm: 2.0 * radius });
    }
    let stepover = (stepover_mm / site.unit_mm + 1e-9).floor();
    if stepover < 1.0 {
        let hint = "a stepover_mm of at least one unit";
        return Err(Error::StepoverUnit { stepover_mm, unit_mm: site.unit_mm, hint });
    }
    let out_mm = overrun_mm(radius, stepover_mm, params.clear_mm.min(site.margin_mm))
        .map(|mm| mm + site.surface.lattice().step_mm + site.unit_mm);
    site.validate(out_mm[0].max(out_mm[1] + stepover_mm) + 2.0 * radius)?;
    let layout = Layout::covering(site, (along, slope), stepover as i32, out_mm);
    Ok((layout, stepdown.min(f64::from(i32::MAX)) as i32))
}

fn profiles(site: &Site, params: &Params, layout: Layout, progress: Progress) -> Result<Plan, Error> {
    let lattice = site.surface.lattice();
    let size_mm = layout.along.split([lattice.width_mm, lattice.height_mm]);
    let cutter = Cutter::new(params.shape, lattice.step_mm, layout.pitch_mm(), 0.0, site.budget)?;
    let stepover_mm = match layout.passes[..] {
        [first, second, ..] => f64::from(second - first) * site.unit_mm,
        _ => 0.0,
    };
    let coarse = ((0.25 * stepover_mm / site.unit_mm) as i32 / layout.pitch).max(1) * layout.pitch;
    // At the middle between two rows, widened so that it answers for both and for the next place.
    let between_mm = (0.5 * stepover_mm).hypot(0.5 * layout.pitch_mm()) + site.budget.path_tolerance_mm;
    let between = Tables::new(compensation::Profile::new(params.shape, lattice.step_mm, between_mm)?);
    let reach_mm = cutter.reach_mm + between_mm;
    let border = Border::read(site.surface, layout.along, params.clear_mm.max(lattice.step_mm))?;
    let mut rows: Vec<Row> = Vec::with_capacity(layout.passes.len());
    let passes = layout.passes.len();
    let band_end = |first: usize| first + band_length(&layout, first, lattice.step_mm, reach_mm);
    let read = |first: usize| {
        if first >= passes {
            return Ok(None);
        }
        let (low_mm, high_mm) =
            (layout.across_mm(first) - stepover_mm, layout.across_mm(band_end(first) - 1));
        Strip::read(site.surface, &layout, low_mm, high_mm, reach_mm).map(Some)
    };
    let mut first = 0;
    let mut strip = read(first)?;
    while let Some(here) = &strip {
        let end = band_end(first);
        let band = || -> Vec<Row> {
            let (wide, faces) =
                rayon::join(|| cutter.faces(here), || Faces::new(&here.facets, between.profile()));
            let envelopes = cutter.widened(here, &wide, &layout, first..end);
            let middles = (first..end).map(|k| layout.across_mm(k) - 0.5 * stepover_mm);
            let between = cutter.rows(here, &between, &faces, &layout, middles);
            (first..end)
                .into_par_iter()
                .zip(envelopes)
                .zip(between)
                .map(|((k, envelope), between)| {
                    let across_mm = layout.across_mm(k);
                    let between = stretches(site, params, &between, (coarse / layout.pitch) as usize);
                    let floor_mm = |along_mm| border.floor_mm(along_mm, across_mm, size_mm);
                    let profiles = row_profiles(site, params, &layout, &envelope, floor_mm);
                    Row { across: layout.passes[k], profiles, between }
                })
                .collect()
        };
        // Much of reading is work for one thread, so the next band is read meanwhile.
        let (band, next) = rayon::join(band, || read(end));
        rows.extend(band);
        strip = next?;
        first = end;
        progress(first as f64 / passes as f64);
    }
    Ok(Plan { layout, rows, coarse })
}

/// The highest of each `length` positions and the one that follows, in units.
fn stretches(site: &Site, params: &Params, cl_mm: &[f32], length: usize) -> Vec<f64> {
    (0..cl_mm.len())
        .step_by(length)
        .map(|from| {
            let known = cl_mm[from..(from + length + 1).min(cl_mm.len())].iter().filter(|z| !z.is_nan());
            site.units(
                known.fold(f64::NEG_INFINITY, |high, &z| high.max(f64::from(z))) + params.stock_to_leave_mm,
            )
        })
        .collect()
}

/// The profiles of one row: over the part what is to be left, around it down to the border's depth.
fn row_profiles(
    site: &Site,
    params: &Params,
    layout: &Layout,
    envelope: &Envelope,
    floor_mm: impl Fn(f64) -> Option<f64>,
) -> Vec<Profile> {
    let wanted: Vec<f64> = envelope
        .bound_mm
        .iter()
        .enumerate()
        .map(|(i, &bound_mm)| {
            let left_mm = bound_mm + params.stock_to_leave_mm;
            let along_mm = layout.start_mm() + i as f64 * layout.pitch_mm();
            site.units(left_mm.max(floor_mm(along_mm).unwrap_or(f64::NEG_INFINITY)))
        })
        .collect();
    let simplify = site.budget.simplify_mm / site.unit_mm;
    let slack = 1.0 + SLACK_MM / site.unit_mm;
    let mut out = Vec::new();
    let mut i = 0;
    while i < wanted.len() {
        if !wanted[i].is_finite() {
            i += 1;
            continue;
        }
        let end = i + wanted[i..].iter().take_while(|z| z.is_finite()).count();
        if end - i >= 2 {
            let wanted = &wanted[i..end];
            let low: Vec<f64> = wanted.iter().map(|w| w - simplify).collect();
            let high: Vec<f64> = wanted.iter().map(|w| w + slack).collect();
            let vertices = funnel::simplify(&low, &high, wanted);
            out.push(vertices.into_iter().map(|(at, z)| [layout.at(i + at), z]).collect());
        }
        i = end;
    }
    out
}

/// Cuts one level. A cut is followed by one of the next row that it can be linked to, so that each
/// pocket and each side of the margin is cleared in one go where it can be.
fn cut_level(site: &Site, params: &Params, plan: &Plan, above: i32, level: i32, pen: &mut Pen) {
    let point = |u, v, z| plan.layout.along.point(u, v, z);
    // What is left out here is no deeper than half a stepdown, so no later level cuts there either.
    let crumb = ((SLACK_MM / site.unit_mm) as i32).min((above - level) / 2);
    let worth = |cut: &Profile| cut.iter().any(|vertex| above - vertex[1] > crumb);
    let mut rows: Vec<Vec<Option<Profile>>> = plan
        .rows
        .iter()
        .map(|row| {
            row.profiles.iter().flat_map(|p| levels::cuts(p, above, level)).filter(worth).map(Some).collect()
        })
        .collect();
    for first in 0..rows.len() {
        for nth in 0..rows[first].len() {
            let Some(mut cut) = rows[first][nth].take() else { continue };
            let mut k = first;
            let climbs = params.pattern == Pattern::OneWay;
            if climbs && backwards(params.pattern, plan.layout.along, k) {
                cut.reverse();
            }
            let entry = |z| point(cut[0][0], plan.rows[k].across, z);
            let down = ramp(&cut, above, params.ramp_slope);
            pen.begin(entry(if down.len() > 1 { above } else { cut[0][1] }), above);
            for &[u, z] in &down {
                pen.cut(point(u, plan.rows[k].across, z));
            }
            loop {
                for &[u, z] in &cut[1..] {
                    pen.cut(point(u, plan.rows[k].across, z));
                }
                if climbs {
                    break;
                }
                let Some((at, next)) = follow(site, params, plan, k + 1, &cut, &mut rows, above) else {
                    break;
                };
                let over =
                    crossing_height(params, plan, k + 1, (&cut, &next), at).map_or(above, |z| z.min(above));
                let (from, to) = (plan.rows[k].across, plan.rows[k + 1].across);
                pen.cut(point(cut[cut.len() - 1][0], from, over));
                pen.cut(point(at, from, over));
                pen.cut(point(at, to, over));
                pen.cut(point(next[0][0], to, over));
                for [u, z] in ramp(&next, over, params.ramp_slope) {
                    pen.cut(point(u, to, z));
                }
                (k, cut) = (k + 1, next);
            }
        }
    }
}

/// Takes the cut of row `k` that is the shortest way from the end of `last`, turned to begin there, and
/// where to cross over to it.
fn follow(
    site: &Site,
    params: &Params,
    plan: &Plan,
    k: usize,
    last: &[[i32; 2]],
    rows: &mut [Vec<Option<Profile>>],
    above: i32,
) -> Option<(i32, Profile)> {
    let end = last[last.len() - 1][0];
    let mut best: Option<(i64, usize, i32)> = None;
    for (nth, cut) in rows.get(k)?.iter().enumerate() {
        let Some(cut) = cut else { continue };
        let (head, tail) = (cut[0][0], cut[cut.len() - 1][0]);
        let near = if (end - head).abs() <= (end - tail).abs() { head } else { tail };
        let Some(at) = crossing(site, params, plan, k, last, cut, near, above) else { continue };
        let way = i64::from((end - at).abs()) + i64::from((near - at).abs());
        if best.is_none_or(|(least, ..)| way < least) {
            best = Some((way, nth, at));
        }
    }
    let (_, nth, at) = best?;
    let mut cut = rows[k][nth].take()?;
    if (end - cut[0][0]).abs() > (end - cut[cut.len() - 1][0]).abs() {
        cut.reverse();
    }
    Some((at, cut))
}

/// How high to cross over at `at` from one row's cut to the next row's: as low as what was cut in both rows and the
/// surface between them, so that the cutter enters the next row from the side and not from above.
fn crossing_height(
    params: &Params,
    plan: &Plan,
    k: usize,
    (last, next): (&[[i32; 2]], &[[i32; 2]]),
    at: i32,
) -> Option<i32> {
    // Any other bottom left cusps at the level above, which from here would be past the stepdown.
    if !matches!(params.shape, Shape::Flat { .. }) {
        return None;
    }
    let rows = levels::highest(last, last[last.len() - 1][0], at).max(levels::highest(next, next[0][0], at));
    let between = plan.between(k, at)?.ceil();
    (between <= f64::from(i32::MAX)).then(|| rows.max(between as i32))
}

/// Where to cross over from the end of one row's cut to the end `to` of the next row's, at the height of
/// the level above: both rows have been cut at that height a little to both sides, so what stands
/// between them is at most a cusp, and the surface between them is lower.
#[allow(clippy::too_many_arguments)]
fn crossing(
    site: &Site,
    params: &Params,
    plan: &Plan,
    k: usize,
    last: &[[i32; 2]],
    next: &[[i32; 2]],
    to: i32,
    above: i32,
) -> Option<i32> {
    let ends = |cut: &[[i32; 2]]| {
        let (a, b) = (cut[0][0], cut[cut.len() - 1][0]);
        (a.min(b), a.max(b))
    };
    let (a, b) = (ends(last), ends(next));
    let apart_mm = plan.half_stepover_mm(site, k);
    let radius = params.shape.radius_mm();
    let inside_mm = radius - (radius * radius - apart_mm * apart_mm).max(0.0).sqrt();
    let inside = (inside_mm / site.unit_mm).ceil() as i32 + 1;
    let (low, high) = (a.0.max(b.0) + inside, a.1.min(b.1) - inside);
    if low > high {
        return None;
    }
    let from = last[last.len() - 1][0];
    let free = |u: i32| plan.between(k, u).is_some_and(|z| z <= f64::from(above));
    let longest = (LONGEST_STEPOVERS * 2.0 * apart_mm / site.unit_mm) as i64;
    let length = |u: i32| i64::from(from - u).abs() + i64::from(to - u).abs();
    let start = to.clamp(low, high);
    let inwards = if start - low < high - start { plan.coarse } else { -plan.coarse };
    (0..)
        .map(|i| start + i * inwards)
        .take_while(|&u| u >= low && u <= high && length(u) <= longest)
        .find(|&u| free(u))
}
