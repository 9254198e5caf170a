//! How low a cutter may stand along a pass, certified for every point of it and not only for the
//! positions at which the cutter location is evaluated.
//!
//! A sample under a cutter asks for the height f(x) = h + s(x - sample), concave along the pass because
//! the cutter is convex. Between two positions dx apart there are two ways to bound all such f:
//!
//! * *curved*: where nothing within reach stands higher above the tip than the round part of the
//!   cutter (radius r) allows, the contact keeps Z = sqrt(r^2 - t^2) of the tip's centre above it, so
//!   |f''| <= r^2 / Z^3 and f <= chord + r^2 dx^2 / (8 Z^3). A controller that leaves its path by P in any
//!   direction costs at most P r / Z.
//! * *steep* (walls, flat cutters): a cutter widened by dx/2 + P at each end bounds the half of the interval
//!   next to it. A flat cutter needs only sqrt((R + P)^2 + (dx/2)^2): a sample that it meets anywhere in
//!   the interval it then meets at one of the ends, so the larger of both bounds the whole.

use std::ops::Range;

use rayon::prelude::*;

use super::passes::{Layout, tip_radius_mm};
use super::slant::Beside;
use super::strip::{Ceiling, Strip};
use crate::compensation::{self, Faces, Profile, RowTarget, Tables};
use crate::cutter::Shape;
use crate::tolerance::Budget;

/// A curved bound that asks for more than this share of the pitch gives way to the steep one.
const BULGE_MOST: f64 = 0.25;

/// Distances from the axis, as parts of the radius, within which the highest sample is known.
pub(super) const RINGS: [f64; 4] = [1.0, 0.93, 0.85, 0.75];

/// Intervals that are first bounded together.
const TOGETHER: usize = 16;

/// Columns of the blocks in which steep places are evaluated together.
const STEEP_BLOCK: usize = 256;

/// A cutter as the planner asks about it.
pub(super) struct Cutter {
    pub(super) exact: Tables,
    pub(super) wide: Tables,
    pub(super) radius_mm: f64,
    pub(super) tip_mm: f64,
    /// Farthest contact from the tip's centre that is still on the round part.
    round_mm: f64,
    /// Between positions, along the pass.
    pub(super) pitch_mm: f64,
    /// How far a move may pass a position between its ends.
    aside_mm: f64,
    budget: Budget,
    /// How far samples matter, in mm, with all that is added.
    pub(super) reach_mm: f64,
}

/// One pass: where the cutter is needed at all, and how low it may stand there.
pub(super) struct Envelope {
    /// Lowest height in mm at each position; -inf where nothing is in reach.
    pub(super) bound_mm: Vec<f64>,
    /// The exact cutter location, NaN where nothing is in reach.
    pub(super) cl_mm: Vec<f32>,
    /// What is known of the heights beside a line that the grid does not meet; empty for other lines.
    pub(super) beside: Vec<Beside>,
}

/// By how much a cutter is widened so that it answers for `half_mm` either way along a line.
fn allowance_mm(shape: &Shape, half_mm: f64, aside_mm: f64, path_tolerance_mm: f64) -> f64 {
    let radius = shape.radius_mm();
    match shape {
        Shape::Flat { .. } if aside_mm == 0.0 => (radius + path_tolerance_mm).hypot(half_mm) - radius,
        _ => half_mm + aside_mm + path_tolerance_mm,
    }
}

impl Cutter {
    /// For positions `pitch_mm` apart on samples `step_mm` apart, which moves pass within `aside_mm`.
    ///
    /// # Errors
    /// The cutter is smaller than a sample or spans too many.
    pub(super) fn new(
        shape: Shape,
        step_mm: f64,
        pitch_mm: f64,
        aside_mm: f64,
        budget: Budget,
    ) -> Result<Cutter, compensation::Error> {
        let allowance_mm = allowance_mm(&shape, 0.5 * pitch_mm, aside_mm, budget.path_tolerance_mm);
        let tip_mm = tip_radius_mm(&shape);
        let round_mm = match shape {
            Shape::Taper { half_angle_deg, .. } => tip_mm * half_angle_deg.to_radians().cos(),
            _ => tip_mm,
        };
        Ok(Cutter {
            exact: Tables::new(Profile::new(shape, step_mm, 0.0)?),
            wide: Tables::new(Profile::new(shape, step_mm, allowance_mm)?),
            radius_mm: shape.radius_mm(),
            tip_mm,
            round_mm,
            pitch_mm,
            aside_mm,
            budget,
            reach_mm: shape.radius_mm() + allowance_mm + pitch_mm + step_mm,
        })
    }

    /// The bounds of a band's passes by the better of both ways, interval by interval.
    pub(super) fn envelopes(
        &self,
        strip: &Strip,
        wide: &Faces,
        layout: &Layout,
        passes: Range<usize>,
    ) -> Vec<Envelope> {
        let across = passes.clone().map(|k| layout.across_mm(k));
        let faces = Faces::new(&strip.facets, self.exact.profile());
        let exact = self.rows(strip, &self.exact, &faces, layout, across);
        if self.tip_mm <= 0.0 {
            let mut envelopes = self.widened(strip, wide, layout, passes);
            envelopes.par_iter_mut().zip(exact).for_each(|(envelope, cl_mm)| envelope.cl_mm = cl_mm);
            return envelopes;
        }
        let curved: Vec<(Envelope, Vec<bool>)> = passes
            .clone()
            .into_par_iter()
            .zip(exact)
            .map(|(k, cl_mm)| self.curved(strip, layout, layout.across_mm(k), cl_mm))
            .collect();
        let (mut envelopes, steep): (Vec<Envelope>, Vec<Vec<bool>>) = curved.into_iter().unzip();
        let wide = self.steep_places(strip, wide, layout, passes, &steep);
        envelopes.par_iter_mut().zip(steep).zip(wide).for_each(|((envelope, steep), wide)| {
            for (i, _) in steep.iter().enumerate().filter(|s| *s.1) {
                let (left, right) = (f64::from(wide[i]), f64::from(wide[i + 1]));
                let (left, right) = self.steep_ends(left, right);
                envelope.bound_mm[i] = envelope.bound_mm[i].max(left);
                envelope.bound_mm[i + 1] = envelope.bound_mm[i + 1].max(right);
            }
        });
        envelopes
    }

    /// Bounds of one pass where its intervals are curved, and which intervals are not.
    fn curved(
        &self,
        strip: &Strip,
        layout: &Layout,
        across_mm: f64,
        cl_mm: Vec<f32>,
    ) -> (Envelope, Vec<bool>) {
        let around_mm = self.strays_mm() + 0.5 * self.pitch_mm;
        let ceilings = RINGS.map(|part| strip.ceiling(across_mm, part * self.radius_mm + around_mm));
        let mut bound_mm: Vec<f64> =
            cl_mm.iter().map(|&z| if z.is_nan() { f64::NEG_INFINITY } else { f64::from(z) }).collect();
        let mut steep = vec![false; cl_mm.len().saturating_sub(1)];
        let mut level = 0;
        for i in 1..cl_mm.len() {
            if (i - 1).is_multiple_of(TOGETHER) {
                let end = (i + TOGETHER).min(cl_mm.len());
                let first_mm = layout.start_mm() + (i as f64 - 0.5) * self.pitch_mm;
                let last_mm = layout.start_mm() + (end as f64 - 1.5) * self.pitch_mm;
                if self.is_level(&cl_mm[i - 1..end], &ceilings, first_mm, last_mm) {
                    level = end;
                }
            }
            if i < level || cl_mm[i - 1].is_nan() || cl_mm[i].is_nan() {
                continue;
            }
            let (left, right) = (f64::from(cl_mm[i - 1]), f64::from(cl_mm[i]));
            let middle_mm = layout.start_mm() + (i as f64 - 0.5) * self.pitch_mm;
            let contact = self.contact_mm(left.min(right), |ring| ceilings[ring].at(middle_mm));
            match contact.and_then(|t| self.lift_mm(t)) {
                Some(lift_mm) => {
                    bound_mm[i - 1] = bound_mm[i - 1].max(left + lift_mm);
                    bound_mm[i] = bound_mm[i].max(right + lift_mm);
                }
                None => steep[i - 1] = true,
            }
        }
        (Envelope { bound_mm, cl_mm, beside: Vec::new() }, steep)
    }

    /// Whether no interval between these locations asks for more than its chord: the farthest contact that any of them
    /// can have, from the lowest location and the highest ceilings, does not.
    fn is_level(&self, cl_mm: &[f32], ceilings: &[Ceiling], first_mm: f64, last_mm: f64) -> bool {
        let known = cl_mm.iter().filter(|z| !z.is_nan());
        let lowest = known.fold(f32::INFINITY, |low, &z| if z < low { z } else { low });
        let contact = self.contact_mm(f64::from(lowest), |ring| ceilings[ring].highest(first_mm, last_mm));
        contact.and_then(|t| self.lift_mm(t)) == Some(0.0)
    }

    /// How far from its line the cutter may be, sideways and by the controller.
    pub(super) fn strays_mm(&self) -> f64 {
        self.budget.path_tolerance_mm + self.aside_mm
    }

    /// Ends of a line over a steep interval. Each half of it must stand above its own end's location: on
    /// a slope both ends are raised by half their difference, at a wall both stand at the higher one.
    pub(super) fn steep_ends(&self, left_mm: f64, right_mm: f64) -> (f64, f64) {
        let apart_mm = (left_mm - right_mm).abs();
        if apart_mm <= self.pitch_mm {
            (left_mm + 0.5 * apart_mm, right_mm + 0.5 * apart_mm)
        } else {
            (left_mm.max(right_mm), left_mm.max(right_mm))
        }
    }

    /// The wide cutter's locations at both ends of the steep intervals, block by block of columns.
    fn steep_places(
        &self,
        strip: &Strip,
        wide: &Faces,
        layout: &Layout,
        passes: Range<usize>,
        steep: &[Vec<bool>],
    ) -> Vec<Vec<f32>> {
        let starts: Vec<usize> = (0..layout.count).step_by(STEEP_BLOCK).collect();
        let blocks: Vec<Vec<(usize, usize, Vec<f32>)>> = starts
            .into_par_iter()
            .map(|from| {
                let to = (from + STEEP_BLOCK).min(layout.count);
                let mut found = Vec::new();
                for (pass, steep) in steep.iter().enumerate() {
                    // A place is asked for by the interval before it and the one after it.
                    let wanted =
                        |i: &usize| (*i > 0 && steep[i - 1]) || steep.get(*i).copied().unwrap_or(false);
                    if let Some(first) = (from..to).find(wanted) {
                        let last = (first..to).rev().find(wanted).unwrap_or(first);
                        found.push((pass, first, last + 1 - first));
                    }
                }
                let targets: Vec<RowTarget> = found
                    .iter()
                    .map(|&(pass, first, count)| RowTarget {
                        x0_mm: layout.start_mm() + first as f64 * self.pitch_mm,
                        y_mm: layout.across_mm(passes.start + pass),
                        count,
                    })
                    .collect();
                let heights = self.targets(strip, &self.wide, wide, &targets);
                found.into_iter().zip(heights).map(|((pass, first, _), z)| (pass, first, z)).collect()
            })
            .collect();
        let mut out: Vec<Vec<f32>> = steep.iter().map(|_| vec![f32::NAN; layout.count]).collect();
        for (pass, first, z) in blocks.into_iter().flatten() {
            out[pass][first..first + z.len()].copy_from_slice(&z);
        }
        out
    }

    /// The bounds of a band's passes by the steep way alone; they hold beyond the part, too.
    pub(super) fn widened(
        &self,
        strip: &Strip,
        wide: &Faces,
        layout: &Layout,
        passes: Range<usize>,
    ) -> Vec<Envelope> {
        let wide = self.rows(strip, &self.wide, wide, layout, passes.map(|k| layout.across_mm(k)));
        wide.into_par_iter()
            .map(|cl_mm| {
                let bound_mm = (0..cl_mm.len())
                    .map(|i| {
                        let near = &cl_mm[i.saturating_sub(1)..(i + 2).min(cl_mm.len())];
                        let known = near.iter().filter(|z| !z.is_nan());
                        known.fold(f64::NEG_INFINITY, |high, &z| high.max(f64::from(z)))
                    })
                    .collect();
                Envelope { bound_mm, cl_mm, beside: Vec::new() }
            })
            .collect()
    }

    /// The faces of a strip as the widened cutter meets them.
    pub(super) fn faces<'a>(&self, strip: &'a Strip) -> Faces<'a> {
        Faces::new(&strip.facets, self.wide.profile())
    }

    /// Locations along rows like those of the layout, at other places across; never below the drop on the
    /// `faces` of the same cutter.
    pub(super) fn rows(
        &self,
        strip: &Strip,
        tables: &Tables,
        faces: &Faces,
        layout: &Layout,
        across_mm: impl Iterator<Item = f64>,
    ) -> Vec<Vec<f32>> {
        let targets: Vec<RowTarget> =
            across_mm.map(|y_mm| RowTarget { x0_mm: layout.start_mm(), y_mm, count: layout.count }).collect();
        self.targets(strip, tables, faces, &targets)
    }

    fn targets(&self, strip: &Strip, tables: &Tables, faces: &Faces, targets: &[RowTarget]) -> Vec<Vec<f32>> {
        let mut rows = self.sampled(strip, tables, targets);
        if !faces.is_empty() {
            rows.par_iter_mut()
                .zip(targets)
                .for_each(|(z_mm, target)| faces.lift_row(target, self.pitch_mm, z_mm));
        }
        rows
    }

    fn sampled(&self, strip: &Strip, tables: &Tables, targets: &[RowTarget]) -> Vec<Vec<f32>> {
        let profile = tables.profile();
        if (self.pitch_mm - profile.step_mm()).abs() < 1e-9 {
            return compensation::rows_by(&strip.heights, tables, targets);
        }
        let place = |t: &RowTarget, i: usize| [t.x0_mm + i as f64 * self.pitch_mm, t.y_mm];
        targets
            .iter()
            .map(|t| {
                let places: Vec<[f64; 2]> = (0..t.count).map(|i| place(t, i)).collect();
                let drops = compensation::points(&strip.heights, profile, &places);
                drops.into_iter().map(|z| z as f32).collect()
            })
            .collect()
    }

    /// How far from the tip's centre a contact that asks for more than `z_mm` can lie; None if it may lie
    /// past the round part. A sample asks for h - r + Z, so Z > r + z - h; and only samples within that
    /// contact's distance count, which may stand lower than the highest of all.
    /// `ceiling` tells the highest point within each of [`RINGS`].
    pub(super) fn contact_mm(&self, z_mm: f64, mut ceiling: impl FnMut(usize) -> f64) -> Option<f64> {
        let tip = self.tip_mm;
        // From the axis; a bull's round part begins where its flat ends.
        let inner = if self.round_mm < tip { 0.0 } else { (self.radius_mm - tip).max(0.0) };
        let mut farthest = f64::INFINITY;
        for (ring, part) in RINGS.into_iter().enumerate() {
            if part < 1.0 && inner + farthest > part * self.radius_mm {
                break;
            }
            let centre = tip - (ceiling(ring) - z_mm).max(0.0);
            if centre <= 0.0 {
                return None;
            }
            farthest = (tip * tip - centre * centre).max(0.0).sqrt();
        }
        Some(farthest)
    }

    /// What must be added to the chord for contacts up to `contact_mm` from the tip's centre: what bulge
    /// and controller take beyond their shares of the budget. None where only the steep way holds.
    pub(super) fn lift_mm(&self, contact_mm: f64) -> Option<f64> {
        self.curved_lift_mm(contact_mm, BULGE_MOST * self.pitch_mm)
    }

    /// The same with the bulge up to which the steep way is not asked for.
    pub(super) fn curved_lift_mm(&self, contact_mm: f64, most_mm: f64) -> Option<f64> {
        let tip = self.tip_mm;
        let contact = contact_mm + self.pitch_mm;
        let strayed = contact + self.strays_mm();
        if strayed >= 0.99 * self.round_mm {
            return None;
        }
        let above = (tip * tip - contact * contact).sqrt();
        // From one position to the next it may be farther than along the line.
        let pitch_mm = self.pitch_mm + self.aside_mm;
        let centre = (tip * tip - strayed * strayed).sqrt();
        // Sideways a concave height rises by no more than its slope.
        let sideways_mm = self.aside_mm * strayed / centre;
        let bulge_mm = tip * tip * pitch_mm * pitch_mm / (8.0 * above * above * above);
        // The steep way takes no less sideways.
        if bulge_mm > most_mm {
            return None;
        }
        let controller_mm = self.budget.path_tolerance_mm * tip / centre;
        let bulge_lift_mm = (bulge_mm + sideways_mm - self.budget.raster_mm).max(0.0);
        Some(bulge_lift_mm + (controller_mm - self.budget.controller_mm).max(0.0))
    }
}
