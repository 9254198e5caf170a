use glam::DVec3;

use super::segment::{End, NORMAL, Segment, Shape, TANGENTIAL};
use super::{Limits, SAME_PLACE};

/// ARC_BLEND_KINK_RATIO as delivered.
const KINK_RATIO: f64 = 0.1;
/// ARC_BLEND_GAP_CYCLES as delivered: a line left shorter than this becomes part of the blend.
const GAP_CYCLES: f64 = 4.0;
/// Turns that come this near to a reversal stop, in radians.
const SHARP: f64 = 2.0 * std::f64::consts::PI / 180.0;
const SMALLEST_ANGLE: f64 = 1e-6;
const SHORTEST_ARC: f64 = 1e-6;
/// Directions within this count as one line.
const SAME_DIRECTION: f64 = 1e-3;

/// An arc that comes between two segments.
pub(super) struct Between {
    pub blend: Segment,
    /// Whether anything is left of the line before it.
    pub keeps: bool,
}

/// Joins a new segment to the last of the queue (tp.c: tpHandleBlendArc).
pub(super) fn join(limits: &Limits, before: &mut Segment, next: &mut Segment) -> Option<Between> {
    if before.progress > 0.5 * before.length || before.end == End::Stop {
        return None;
    }
    let (u1, u2) = (before.last, next.first);
    if (u1 + u2).length_squared() < SHARP * SHARP {
        before.end_with(End::Stop, next);
        return None;
    }
    // What the kink asks of the axes, at the speed of the slower, within one period of the servo loop.
    let speed = before.speed_asked().min(next.speed_asked());
    let jump = (u2 - u1).abs() * (speed / limits.period + next.acceleration) / limits.acceleration;
    let mut asks = jump.max_element();
    if before.shape == Shape::Arc || next.shape == Shape::Arc {
        asks /= TANGENTIAL;
    }
    let share = asks.min(KINK_RATIO);
    before.kink_after = before.kink_after.max(share);
    next.kink_before = next.kink_before.max(share);
    if asks < KINK_RATIO {
        before.kink_speed = Some(speed);
        before.end_with(End::Tangent, next);
        return None;
    }
    before.kink_speed = Some(speed * KINK_RATIO / asks);
    if before.end != End::Parabola {
        return None;
    }
    let straight_on = speed * KINK_RATIO / asks;
    let corner = Corner::between(u1, u2);
    if let Some(arc) = RoundedCorner::fit(limits, before, next, &corner) {
        let blend = arc.segment(limits, before);
        // What a parabola could reach at most settles most corners.
        let cut = 2.0 * before.acceleration * before.tolerance;
        let most2 = if before.tolerance > 0.0 { cut / corner.cos_theta } else { f64::INFINITY };
        let clear = 4.0 * blend.speed_max * blend.speed_max > most2;
        if blend.speed_max > straight_on
            && (clear || blend.speed_max > 0.5 * parabola_speed(limits, before, next, &corner))
        {
            forget_kink(before, next);
            next.length -= arc.reach;
            if arc.keeps {
                before.length -= arc.reach;
                before.end_with(End::Tangent, next);
            }
            next.parabola_before = false;
            return Some(Between { blend, keeps: arc.keeps });
        }
    }
    let parabola = 0.5 * parabola_speed(limits, before, next, &corner);
    if straight_on > parabola {
        before.end_with(End::Tangent, next);
    } else {
        forget_kink(before, next);
        before.end_with(End::Parabola, next);
    }
    None
}

fn forget_kink(before: &mut Segment, next: &mut Segment) {
    before.kink_speed = None;
    before.kink_after = 0.0;
    next.kink_before = 0.0;
}

/// The corner between two unit vectors. With phi the turn, theta = (pi - phi) / 2.
struct Corner {
    turn: f64,
    sin_theta: f64,
    cos_theta: f64,
    across: DVec3,
}

impl Corner {
    fn between(u1: DVec3, u2: DVec3) -> Corner {
        // |u2 - u1| = 2 sin(phi / 2), which keeps its digits at small turns.
        let cos_theta = (0.5 * (u2 - u1).length()).min(1.0);
        let sin_theta = (0.5 * (u2 + u1).length()).min(1.0);
        Corner {
            turn: 2.0 * cos_theta.asin(),
            sin_theta,
            cos_theta,
            across: u1.cross(u2).normalize_or_zero(),
        }
    }
}

/// Speed across a parabolic blend, as far as it goes along the turn (tp.c: tpComputeBlendVelocity).
fn parabola_speed(limits: &Limits, before: &Segment, next: &Segment, corner: &Corner) -> f64 {
    let [this, after] = parabola_speeds(
        before,
        next,
        corner,
        before.speed_asked().min(limits.path_speed),
        next.speed_asked().min(limits.path_speed),
    );
    0.5 * corner.sin_theta * (this + after)
}

/// Speeds of the two segments at which a parabolic blend between them begins.
fn parabola_speeds(before: &Segment, next: &Segment, corner: &Corner, this: f64, after: f64) -> [f64; 2] {
    let (a1, a2) = (before.acceleration_along(), next.acceleration_along());
    let reach = |segment: &Segment, a: f64| {
        (a * if segment.settled { segment.length } else { 0.5 * segment.length }).sqrt()
    };
    let (v1, v2) = (reach(before, a1).min(this), reach(next, a2).min(after));
    let longest = (before.length / v1).min(next.length / v2);
    let time = longest.min((v1 / a1).max(v2 / a2));
    let mut speeds = [v1.min(time * a1), v2.min(time * a2)];
    if before.tolerance > 0.0 && corner.cos_theta > 1e-3 {
        let cut = 2.0 * (a1 * before.tolerance / corner.cos_theta).sqrt();
        speeds = speeds.map(|v| v.min(cut));
    }
    speeds
}

/// The speed of `before` below which a parabola takes over, with the speeds asked for now.
pub(super) fn parabola_begins(before: &Segment, next: &Segment, this: f64, after: f64) -> f64 {
    parabola_speeds(before, next, &Corner::between(before.last, next.first), this, after)[0]
}

/// An arc that rounds a corner (blendmath.c: blendComputeParameters).
struct RoundedCorner {
    radius: f64,
    turn: f64,
    /// What it takes of the segment before and of the next.
    reach: f64,
    speed: f64,
    asked: f64,
    acceleration: f64,
    /// What is left of the line before it is long enough to stay.
    keeps: bool,
}

impl RoundedCorner {
    fn fit(limits: &Limits, before: &Segment, next: &Segment, corner: &Corner) -> Option<RoundedCorner> {
        let Corner { mut turn, mut sin_theta, mut cos_theta, across } = *corner;
        if 0.5 * turn < SMALLEST_ANGLE || sin_theta < SMALLEST_ANGLE {
            return None;
        }
        let theta = 0.5 * (std::f64::consts::PI - turn);
        let mut less = 0.0;
        let mut side = |segment: &Segment, at: usize, share: f64, length: f64, towards: f64, other: DVec3| {
            let Some(circle) = &segment.circle else { return Some(length) };
            if across.cross(circle.normal).length() > SAME_DIRECTION {
                return None;
            }
            // Only a part of an arc may go, less where the corner points into it.
            let convex = towards * circle.inward[at].dot(other) > 0.0;
            let most = (circle.angle * share).min(if convex { theta } else { std::f64::consts::FRAC_PI_2 });
            if convex {
                less += 0.25 * most;
                return Some((0.25 * most).sin() * circle.radius);
            }
            Some(most * circle.radius)
        };
        let half = 0.5 * before.nominal_length;
        let l1 = side(before, 1, 2.0 / 3.0, before.length.min(half), 1.0, next.first)?;
        let l2 = side(next, 0, 1.0 / 3.0, 0.5 * next.length, -1.0, before.last)?;
        if less > 0.0 {
            let theta = (theta - less).max(SMALLEST_ANGLE);
            (turn, sin_theta, cos_theta) = (std::f64::consts::PI - 2.0 * theta, theta.sin(), theta.cos());
        }
        let tolerance = |segment: &Segment| {
            let quarter = 0.25 * segment.nominal_length;
            if segment.tolerance == 0.0 { quarter } else { segment.tolerance.min(quarter) }
        };
        let tolerance = tolerance(before).min(tolerance(next));
        let acceleration = in_plane(across, limits.acceleration);
        let normal = NORMAL * acceleration;
        let asked = before.speed_asked().max(next.speed_asked());
        let plane = in_plane(across, limits.speed);
        let goal = if asked <= plane { asked } else { asked.min(plane.max(altitude(before, next, turn))) };

        let tan_theta = sin_theta / cos_theta;
        // h = P / (1 - sin theta), d = h cos theta; 1 - sin = cos^2 / (1 + sin).
        let d = (tolerance * (1.0 + sin_theta) / cos_theta).min(l1).min(l2);
        let radius_most = tan_theta * d;
        let speed = (normal * radius_most).sqrt().min(goal);
        // A parabola's way at half of the acceleration tells how much of the segments is worth taking.
        let slow = 0.5 * acceleration;
        let way = (2.0 * slow * d).sqrt().min(speed) / slow * speed;
        let radius = (speed * speed / normal).max((way / turn).min(radius_most));
        if radius < SAME_PLACE || radius * turn < SHORTEST_ARC {
            return None;
        }
        let reach = radius / tan_theta;
        let keeps = before.shape != Shape::Line
            || before.parabola_before
            || (before.length - reach) / speed >= GAP_CYCLES * limits.period;
        Some(RoundedCorner { radius, turn, reach, speed, asked, acceleration, keeps })
    }

    fn segment(&self, limits: &Limits, before: &Segment) -> Segment {
        let rest = if self.keeps { 0.0 } else { before.length - self.reach };
        let length = self.radius * self.turn + rest;
        let mut blend = Segment {
            shape: Shape::Blend,
            circle: None,
            end: End::Tangent,
            parabola_before: false,
            length,
            nominal_length: length,
            requested: self.asked,
            speed_max: self.speed,
            acceleration: self.acceleration,
            tangential: TANGENTIAL,
            kink_speed: None,
            kink_before: 0.0,
            kink_after: 0.0,
            settled: false,
            end_speed: 0.0,
            at_peak: false,
            active: false,
            progress: 0.0,
            speed: 0.0,
            ramp: false,
            ending: None,
            period: limits.period,
            done: false,
            braking: false,
            handing_over: false,
            ..*before
        };
        blend.settle(limits.period);
        blend
    }
}

/// The largest of a vector in any direction of a plane, from limits per axis.
fn in_plane(normal: DVec3, limits: DVec3) -> f64 {
    let along = (DVec3::ONE - normal * normal).max(DVec3::splat(SAME_PLACE * SAME_PLACE));
    (limits * limits / along).min_element().sqrt()
}

/// The least speed on the line between the speed vectors of two lines; 0 beside an arc.
fn altitude(before: &Segment, next: &Segment, turn: f64) -> f64 {
    if before.shape != Shape::Line || next.shape != Shape::Line {
        return 0.0;
    }
    let (m1, m2) = (before.speed_max, next.speed_max);
    let turn_cos = turn.min(0.49 * std::f64::consts::PI).cos();
    let (v1, v2) = (m1.min(m2 / turn_cos), m2.min(m1 / turn_cos));
    v1 * v2 * turn.sin() / (next.first * v2 - before.last * v1).length()
}
