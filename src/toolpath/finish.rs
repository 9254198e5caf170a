//! Parallel passes over the cutter-location surface, each as few long moves.

use std::ops::Range;

use rayon::prelude::*;

use super::envelope::Envelope;
use super::ground::Ground;
use super::passes::{contact_radius_mm, tip_radius_mm};
use super::pen::Pen;
use super::strip::{Strip, band_length};
use super::track::Part;
use super::{
    Axis, Error, GridPoint, Layout, Progress, Rest, Site, Tilt, Toolpath, ends, funnel, link, slant, tilt,
    track,
};
use crate::cutter::Shape;
use crate::tolerance::EXCESS_MM;

/// A length is no longer than another if it is so by less than this, in mm: one controller counts in other units than the
/// next.
const SAME_MM: f64 = 1e-6;

/// How far apart passes lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spacing {
    /// mm in the XY plane.
    StepoverMm(f64),
    /// Height in mm that is left between two passes on the steepest face.
    ScallopMm(f64),
}

/// The order of passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    Zigzag,
    /// Every pass the same way, climbing with a spindle that turns clockwise (M3): the uncut material is
    /// on the right of the motion.
    OneWay,
}

/// What a finishing operation asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub shape: Shape,
    pub spacing: Spacing,
    /// 0: along X, 90: along Y; any number.
    pub direction_deg: f64,
    pub pattern: Pattern,
    /// Added to every height, in mm: above 0 it is a semi-finish.
    pub stock_to_leave_mm: f64,
    /// Retracts after this many passes of a zigzag, so that a program can start again there; 0: never.
    pub restart_passes: usize,
}

/// The stepover in mm that leaves a scallop of this height between passes of a round tip on a face
/// whose slope across the passes is `slope_across`: w = 2 sqrt(2 r h - h^2) in the face's plane, cos(beta)
/// of it in the XY plane.
pub fn stepover_mm(shape: &Shape, scallop_mm: f64, slope_across: f64) -> Result<f64, Error> {
    let tip = tip_radius_mm(shape);
    if tip <= 0.0 {
        return Err(Error::ScallopTip { cutter: shape.to_string() });
    }
    if !(scallop_mm > 0.0 && scallop_mm < tip) {
        return Err(Error::Scallop { scallop_mm, cutter: shape.to_string(), tip_radius_mm: tip });
    }
    Ok(2.0 * (2.0 * tip * scallop_mm - scallop_mm * scallop_mm).sqrt() / 1.0f64.hypot(slope_across))
}

/// Where the passes lie and where on them the cutter location is evaluated.
pub fn layout(site: &Site, params: &Params) -> Result<Layout, Error> {
    Ok(layouts(site, params)?.0)
}

/// The passes on the controller's grid and on the coarsest grid of the job, by which slanted ones are planned. Both have
/// the same positions.
fn layouts(site: &Site, params: &Params) -> Result<(Layout, Layout), Error> {
    let own = lay_out(site, params)?;
    if site.times() == 1 {
        return Ok((own.clone(), own));
    }
    let common = lay_out(&site.common(), params)?;
    Ok((common.on_finer(site.times(), site.unit_mm), common))
}

fn lay_out(site: &Site, params: &Params) -> Result<Layout, Error> {
    site.validate(0.0)?;
    let (along, slope) = Axis::from_deg(params.direction_deg)?;
    if !(params.stock_to_leave_mm >= 0.0 && params.stock_to_leave_mm.is_finite()) {
        return Err(Error::StockToLeave { leave_mm: params.stock_to_leave_mm });
    }
    let (slope_along, slope_across) = along.split(site.surface.steepest());
    let length = slope.hypot(1.0);
    let diameter_mm = 2.0 * params.shape.radius_mm();
    let (spacing_mm, hint) = match params.spacing {
        Spacing::StepoverMm(stepover_mm) => (stepover_mm, "a stepover_mm of at least one unit"),
        Spacing::ScallopMm(scallop_mm) => {
            let steepest = (slope.abs() * slope_along + slope_across) / length;
            let wide = stepover_mm(&params.shape, scallop_mm, steepest)?;
            (
                wide.min(diameter_mm),
                "give stepover_mm, or a larger scallop_mm: the steepest face sets this one",
            )
        }
    };
    if !(spacing_mm > 0.0 && spacing_mm <= diameter_mm) {
        return Err(Error::Stepover { stepover_mm: spacing_mm, diameter_mm });
    }
    let apart = (spacing_mm * length / site.apart_mm + 1e-9).floor();
    // Moves of neighbouring slanted passes come up to a unit closer or farther than the passes.
    let kept = slope != 0.0 && matches!(params.spacing, Spacing::ScallopMm(_));
    let apart = if kept { apart - 1.0 } else { apart };
    if apart < 1.0 {
        return Err(Error::StepoverUnit { stepover_mm: spacing_mm, unit_mm: site.apart_mm, hint });
    }
    let stepover = apart * (site.apart_mm / site.unit_mm).round();
    // Past an open edge as far as the cutter can touch the border's steepest face; past a neighbour's as far as it
    // reaches at all, since a step of the neighbour can keep it that far out.
    let past = 2.0 * site.surface.lattice().step_mm;
    let reach_mm = |slope: f64| match site.neighbours {
        true => params.shape.radius_mm(),
        false => contact_radius_mm(&params.shape, slope),
    };
    let overrun_mm = [slope_along, slope_across].map(|slope| reach_mm(slope) + past);
    let lattice = site.surface.lattice();
    let risen_mm = slope.abs() * lattice.width_mm.max(lattice.height_mm);
    site.validate(overrun_mm[0].max(overrun_mm[1]) + spacing_mm + diameter_mm + risen_mm)?;
    Ok(Layout::covering(site, (along, slope), stepover as i32, overrun_mm))
}

/// A cut without a break: along the passes, across and up, in units.
type Run = Vec<GridPoint>;

/// Plans the passes of a finishing or semi-finishing operation, band by band.
///
/// The swept cutter stays at or above the samples plus `stock_to_leave_mm`, less the budget; every vertex is on
/// the controller's grid. The same path whatever the number of threads.
pub fn finish(site: &Site, params: &Params, progress: Progress) -> Result<Toolpath, Error> {
    let path = passes(site, params, None, progress)?;
    if path.moves.is_empty() {
        let lattice = site.surface.lattice();
        return Err(Error::NoData { samples: lattice.columns * lattice.rows });
    }
    Ok(path)
}

/// The passes of [`finish`] only where something was left; over gaps of up to `stay_mm` the cutter stays down. Without
/// any move where nothing was left.
pub fn rest(
    site: &Site,
    params: &Params,
    rest: &Rest,
    stay_mm: f64,
    progress: Progress,
) -> Result<Toolpath, Error> {
    passes(site, params, Some((rest, stay_mm)), progress)
}

fn passes(
    site: &Site,
    params: &Params,
    rest: Option<(&Rest, f64)>,
    progress: Progress,
) -> Result<Toolpath, Error> {
    let (layout, common) = layouts(site, params)?;
    let lattice = site.surface.lattice();
    let cutter = slant::cutter(params.shape, &common, site)?;
    let stepover_mm = layout.stepover_mm().unwrap_or(2.0 * params.shape.radius_mm());
    let slanted = layout.slope != 0.0;
    let longest_mm = link::LONGEST_STEPOVERS * stepover_mm;
    let passes = layout.passes.len();
    let mut pen = Pen::new(site);
    let mut before: Option<(usize, GridPoint)> = None;
    let mut since_retract = 0;
    let mut tilt = Tilt::default();
    let band_at = |first: usize| match slanted {
        true => first..first + slant::band_length(&layout, first),
        false => first..first + band_length(&layout, first, lattice.step_mm, cutter.reach_mm),
    };
    let read = |first: usize| {
        if slanted || first >= passes {
            return Ok(None);
        }
        // The link from the band before is judged in this band.
        let (low_mm, last) = (layout.across_mm(first) - longest_mm, band_at(first).end - 1);
        Strip::read(site.surface, &layout, low_mm, layout.across_mm(last), cutter.reach_mm).map(Some)
    };
    let mut first = 0;
    let mut strip = read(first)?;
    while first < passes {
        let Range { end, .. } = band_at(first);
        let cut = || -> Result<(), Error> {
            let ground = strip.as_ref().map(|strip| Ground::new(strip, &cutter));
            let kept = |(rest, stay_mm): (&Rest, f64)| -> Vec<Vec<bool>> {
                (first..end).into_par_iter().map(|k| rest.kept(&common, k, stay_mm)).collect()
            };
            let kept = rest.map(kept);
            let envelopes = match &ground {
                Some(ground) => cutter.envelopes(ground.strip, &ground.wide, &layout, first..end),
                None => slant::envelopes(site, &params.shape, &cutter, &common, first..end, kept.as_deref())?,
            };
            let planned: Vec<(Vec<Run>, Tilt)> = (first..end)
                .into_par_iter()
                .zip(envelopes)
                .map(|(k, mut envelope)| {
                    if let Some(kept) = &kept {
                        let places = envelope.cl_mm.iter_mut().zip(&kept[k - first]);
                        places.filter(|(_, kept)| !**kept).for_each(|(cl_mm, _)| *cl_mm = f32::NAN);
                    }
                    let layouts = [&layout, &common];
                    let (mut runs, tilt) = pass(site, params, layouts, k, stepover_mm, &envelope);
                    if backwards(params.pattern, layout.along, k) {
                        runs.reverse();
                        runs.iter_mut().for_each(|run| run.reverse());
                    }
                    (runs, tilt)
                })
                .collect();
            planned.iter().for_each(|(_, turned)| tilt.merge(turned));
            let band: Vec<Vec<Run>> = planned.into_iter().map(|(runs, _)| runs).collect();
            let joints = joints(&layout, first, &band, before);
            let links: Vec<Option<i32>> = joints
                .par_iter()
                .map(|&(from, to, apart_mm)| match &ground {
                    _ if params.pattern == Pattern::OneWay || apart_mm > longest_mm + SAME_MM => Ok(None),
                    Some(ground) => {
                        let leave_mm = params.stock_to_leave_mm;
                        Ok(link::level(site, &cutter, ground, from, to, leave_mm))
                    }
                    None => {
                        let leave_mm = params.stock_to_leave_mm;
                        link::elsewhere(site, &cutter, layout.along, from, to, leave_mm)
                    }
                })
                .collect::<Result<_, Error>>()?;
            let mut links = links.into_iter();
            for (offset, runs) in band.iter().enumerate() {
                let k = first + offset;
                for (nth, run) in runs.iter().enumerate() {
                    let start = run[0];
                    let linked = match before {
                        Some((_, from)) if nth == 0 => links.next().flatten().map(|z| (from, z)),
                        _ => None,
                    };
                    let forced = params.restart_passes > 0 && since_retract >= params.restart_passes;
                    match linked.filter(|_| !forced) {
                        Some((from, z)) => {
                            pen.cut(layout.along.point(from[0], from[1], z));
                            pen.cut(layout.along.point(start[0], start[1], z));
                            pen.cut(layout.along.point(start[0], start[1], start[2]));
                        }
                        None => {
                            let top = pen.top();
                            pen.begin(layout.along.point(start[0], start[1], start[2]), top);
                            since_retract = 0;
                        }
                    }
                    for &[u, v, z] in &run[1..] {
                        pen.cut(layout.along.point(u, v, z));
                    }
                    before = Some((k, run[run.len() - 1]));
                }
                since_retract += 1;
            }
            Ok(())
        };
        // Much of reading is work for one thread, so the next band is read meanwhile.
        let (done, next) = rayon::join(cut, || read(end));
        done?;
        strip = next?;
        first = end;
        progress(first as f64 / passes as f64);
    }
    let mut path = pen.finish();
    // Beside a line that the grid does not meet heights are known where its passes are laid there.
    let known = layout.on_grid() || tip_radius_mm(&params.shape) > 0.0;
    path.tilt = (params.stock_to_leave_mm == 0.0 && known).then_some(tilt);
    Ok(path)
}

/// Whether a pass runs towards lower coordinates. Passes follow each other towards higher ones, so the
/// uncut side of a pass along X is on the right when it runs to -X, of one along Y when it runs to +Y.
pub(super) fn backwards(pattern: Pattern, along: Axis, k: usize) -> bool {
    match pattern {
        Pattern::Zigzag => k % 2 == 1,
        Pattern::OneWay => along == Axis::X,
    }
}

/// From the end of each pass to the begin of the next one that cuts, and how far apart their lines are there in mm: the
/// same for all controllers, wherever on their grids they stand.
fn joints(
    layout: &Layout,
    first: usize,
    band: &[Vec<Run>],
    before: Option<(usize, GridPoint)>,
) -> Vec<(GridPoint, GridPoint, f64)> {
    let mut end = before;
    let mut out = Vec::new();
    for (offset, runs) in band.iter().enumerate() {
        let (Some(head), Some(tail)) = (runs.first(), runs.last()) else { continue };
        let k = first + offset;
        if let Some((before, from)) = end {
            let [a, b] = [(before, from), (k, head[0])].map(|(k, at)| layout.line_mm(k, at[0]));
            out.push((from, head[0], (b[0] - a[0]).hypot(b[1] - a[1])));
        }
        end = Some((k, tail[tail.len() - 1]));
    }
    out
}

/// The cuts of one pass, towards higher coordinates.
fn pass(
    site: &Site,
    params: &Params,
    [layout, common]: [&Layout; 2],
    k: usize,
    stepover_mm: f64,
    envelope: &Envelope,
) -> (Vec<Run>, Tilt) {
    // On a fine grid any end will do, and what is left for a finer cutter needs no slope.
    let coarse = site.unit_mm > site.budget.simplify_mm + EXCESS_MM && params.stock_to_leave_mm == 0.0;
    let measure = ends::Measure {
        unit_mm: site.unit_mm,
        pitch_mm: layout.length_mm(),
        stepover_mm,
        tip_mm: tip_radius_mm(&params.shape),
    };
    let simplify = site.budget.simplify_mm / site.unit_mm;
    // With what simplification may take below, a whole unit always lies between the bounds.
    let excess = (1.0 - simplify).max(0.0) + EXCESS_MM / site.unit_mm;
    // Half a unit beside its line the cutter has less room to stand higher.
    let excess = match layout.on_grid() {
        true => excess,
        false => excess.min((1.0 - simplify).max(((1.0 + simplify).powi(2) - 0.25).sqrt())),
    };
    let mut out = Vec::new();
    let mut tilt = Tilt::default();
    let mut i = 0;
    while i < layout.count {
        if envelope.cl_mm[i].is_nan() {
            i += 1;
            continue;
        }
        let end = i + envelope.cl_mm[i..].iter().take_while(|z| !z.is_nan()).count();
        // A single position covers no length.
        if end - i >= 2 {
            let leave_mm = params.stock_to_leave_mm;
            let exact: Vec<f64> =
                envelope.cl_mm[i..end].iter().map(|&z| site.units(f64::from(z) + leave_mm)).collect();
            let (points, kept, above) = if envelope.beside.is_empty() {
                let wanted: Vec<f64> =
                    envelope.bound_mm[i..end].iter().map(|&z| site.units(z + leave_mm)).collect();
                let low: Vec<f64> = wanted.iter().map(|w| w - simplify).collect();
                let high: Vec<f64> = wanted.iter().map(|w| w + excess).collect();
                let lay = |part: Range<usize>| match coarse {
                    true => ends::lay(&low[part.clone()], &high[part.clone()], &exact[part], &measure),
                    false => funnel::simplify(&low[part.clone()], &high[part.clone()], &wanted[part]),
                };
                // A finer grid ends beside its line, where the coarsest does, and goes along it from the next position on.
                let last = end - i - 1;
                let cuts = match layout.slope != 0.0 && site.times() > 1 && last > 1 {
                    true => vec![0, 1, last, last + 1],
                    false => vec![0, last + 1],
                };
                let parts = cuts.windows(2).map(|cut| (cut[0], lay(cut[0]..cut[1])));
                let vertices: Vec<(usize, i32)> = parts
                    .flat_map(|(first, vertices)| vertices.into_iter().map(move |(at, z)| (first + at, z)))
                    .collect();
                let point = |&(at, z): &(usize, i32)| {
                    let along = layout.at(i + at);
                    // Runs end at places of the coarsest grid, so that all controllers of a job link the same ones.
                    let across = match at {
                        _ if layout.slope == 0.0 => layout.across(k, along),
                        at if at == 0 || i + at + 1 == end => {
                            common.across(k, common.at(i + at)) * site.times()
                        }
                        _ => layout.across(k, along),
                    };
                    [along, across, z]
                };
                let above = tilt::above(&exact, &vertices);
                (vertices.iter().map(point).collect(), wanted, above)
            } else {
                let cl_mm = &envelope.cl_mm[i..end];
                let part = Part { pass: k, first: i, cl_mm, beside: &envelope.beside[i..end], leave_mm };
                track::lay(site, [layout, common], &part, &measure)
            };
            let run = tilt::Run { exact: &exact, kept: &kept, above: &above };
            tilt.add(&run, &measure, |at| layout.place_mm(k, i + at));
            out.push(points);
        }
        i = end;
    }
    (out, tilt)
}
