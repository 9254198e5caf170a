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
//! * *steep* (walls, flat cutters): f peaks at the sample's own foot, at most dx/2 from a position. For
//!   a cutter widened by dx/2 + P the larger of both ends bounds the whole interval. A flat cutter
//!   needs sqrt((R + P)^2 + (dx/2)^2) only.

use super::drop::{self, Profile};
use super::passes::tip_radius_mm;
use super::strip::Strip;
use crate::cutter::Shape;
use crate::tolerance::Budget;

/// A curved bound that asks for more than this share of the pitch gives way to the steep one.
const BULGE_MOST: f64 = 0.25;

/// A cutter as the planner asks about it.
pub(super) struct Cutter {
    exact: Profile,
    wide: Profile,
    radius_mm: f64,
    tip_mm: f64,
    /// Farthest contact from the tip's centre that is still on the round part.
    round_mm: f64,
    pitch_mm: f64,
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
}

/// By how much a cutter is widened so that it answers for `half_mm` either way along a line.
fn allowance_mm(shape: &Shape, half_mm: f64, path_tolerance_mm: f64) -> f64 {
    let radius = shape.radius_mm();
    match shape {
        Shape::Flat { .. } => (radius + path_tolerance_mm).hypot(half_mm) - radius,
        _ => half_mm + path_tolerance_mm,
    }
}

impl Cutter {
    pub(super) fn new(shape: Shape, step_mm: f64, pitch_mm: f64, budget: Budget) -> Cutter {
        let allowance_mm = allowance_mm(&shape, 0.5 * pitch_mm, budget.path_tolerance_mm);
        let tip_mm = tip_radius_mm(&shape);
        let round_mm = match shape {
            Shape::Taper { half_angle_deg, .. } => tip_mm * half_angle_deg.to_radians().cos(),
            _ => tip_mm,
        };
        Cutter {
            exact: Profile::new(shape, step_mm, 0.0),
            wide: Profile::new(shape, step_mm, allowance_mm),
            radius_mm: shape.radius_mm(),
            tip_mm,
            round_mm,
            pitch_mm,
            budget,
            reach_mm: shape.radius_mm() + allowance_mm + pitch_mm + step_mm,
        }
    }

    /// The bound of one pass by the better of both ways, interval by interval.
    pub(super) fn envelope(&self, strip: &Strip, start_mm: f64, across_mm: f64, count: usize) -> Envelope {
        if self.tip_mm <= 0.0 {
            let mut envelope = self.widened(strip, start_mm, across_mm, count);
            envelope.cl_mm = self.row(strip, &self.exact, start_mm, across_mm, count);
            return envelope;
        }
        let cl_mm = self.row(strip, &self.exact, start_mm, across_mm, count);
        let within_mm = self.radius_mm + self.budget.path_tolerance_mm + 0.5 * self.pitch_mm;
        let ceiling = strip.ceiling(across_mm, within_mm);
        let mut bound_mm: Vec<f64> =
            cl_mm.iter().map(|&z| if z.is_nan() { f64::NEG_INFINITY } else { f64::from(z) }).collect();
        let mut steep = vec![false; count.saturating_sub(1)];
        for i in 1..count {
            if cl_mm[i - 1].is_nan() || cl_mm[i].is_nan() {
                continue;
            }
            let (left, right) = (f64::from(cl_mm[i - 1]), f64::from(cl_mm[i]));
            let middle_mm = start_mm + (i as f64 - 0.5) * self.pitch_mm;
            match self.lift_mm(ceiling.at(middle_mm) - left.min(right)) {
                Some(lift_mm) => {
                    bound_mm[i - 1] = bound_mm[i - 1].max(left + lift_mm);
                    bound_mm[i] = bound_mm[i].max(right + lift_mm);
                }
                None => steep[i - 1] = true,
            }
        }
        let mut i = 0;
        while i < steep.len() {
            if !steep[i] {
                i += 1;
                continue;
            }
            let end = i + steep[i..].iter().take_while(|&&s| s).count();
            let wide =
                self.row(strip, &self.wide, start_mm + i as f64 * self.pitch_mm, across_mm, end - i + 1);
            for (k, pair) in wide.windows(2).enumerate() {
                let higher = f64::from(pair[0]).max(f64::from(pair[1]));
                bound_mm[i + k] = bound_mm[i + k].max(higher);
                bound_mm[i + k + 1] = bound_mm[i + k + 1].max(higher);
            }
            i = end;
        }
        Envelope { bound_mm, cl_mm }
    }

    /// The bound of one pass by the steep way alone; it holds beyond the part, too.
    pub(super) fn widened(&self, strip: &Strip, start_mm: f64, across_mm: f64, count: usize) -> Envelope {
        let cl_mm = self.row(strip, &self.wide, start_mm, across_mm, count);
        let mut bound_mm = vec![f64::NEG_INFINITY; count];
        for i in 0..count {
            for &z in &cl_mm[i.saturating_sub(1)..(i + 2).min(count)] {
                if !z.is_nan() {
                    bound_mm[i] = bound_mm[i].max(f64::from(z));
                }
            }
        }
        Envelope { bound_mm, cl_mm }
    }

    /// Lowest height in mm at which the cutter may go straight from one place to another (along,
    /// across); None where nothing is in reach, so that nothing is known of what stands there.
    pub(super) fn straight(&self, strip: &Strip, from_mm: [f64; 2], to_mm: [f64; 2]) -> Option<f64> {
        let (du, dv) = (to_mm[0] - from_mm[0], to_mm[1] - from_mm[1]);
        let steps = (du.hypot(dv) / self.pitch_mm).ceil().max(1.0);
        let places: Vec<[f64; 2]> = (0..=steps as usize)
            .map(|i| {
                let t = i as f64 / steps;
                [from_mm[0] + t * du, from_mm[1] + t * dv]
            })
            .collect();
        let drops = drop::points(&strip.heights, strip.step_mm, &self.wide, &places);
        if drops.iter().any(|z| z.is_nan()) {
            return None;
        }
        Some(drops.into_iter().fold(f64::NEG_INFINITY, f64::max))
    }

    fn row(&self, strip: &Strip, profile: &Profile, start_mm: f64, across_mm: f64, count: usize) -> Vec<f32> {
        if (self.pitch_mm - strip.step_mm).abs() < 1e-9 {
            return drop::row(&strip.heights, strip.step_mm, profile, start_mm, across_mm, count);
        }
        let places: Vec<[f64; 2]> =
            (0..count).map(|i| [start_mm + i as f64 * self.pitch_mm, across_mm]).collect();
        drop::points(&strip.heights, strip.step_mm, profile, &places).into_iter().map(|z| z as f32).collect()
    }

    /// What must be added to the chord where the surface stands up to `over_mm` above the tip: what
    /// bulge and controller take beyond their shares of the budget. None where only the steep way holds.
    fn lift_mm(&self, over_mm: f64) -> Option<f64> {
        let tip = self.tip_mm;
        let centre = tip - over_mm.max(0.0);
        if centre <= 0.0 {
            return None;
        }
        let contact = (tip * tip - centre * centre).max(0.0).sqrt() + self.pitch_mm;
        let strayed = contact + self.budget.path_tolerance_mm;
        if strayed >= 0.99 * self.round_mm {
            return None;
        }
        let above = (tip * tip - contact * contact).sqrt();
        let bulge_mm = tip * tip * self.pitch_mm * self.pitch_mm / (8.0 * above * above * above);
        if bulge_mm > BULGE_MOST * self.pitch_mm {
            return None;
        }
        let controller_mm = self.budget.path_tolerance_mm * tip / (tip * tip - strayed * strayed).sqrt();
        Some(
            (bulge_mm - self.budget.raster_mm).max(0.0)
                + (controller_mm - self.budget.controller_mm).max(0.0),
        )
    }
}
