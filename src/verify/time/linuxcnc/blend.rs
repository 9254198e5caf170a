use glam::DVec3;

use super::segment::{End, Line, NORMAL, Segment, Shape, TANGENTIAL};
use super::{Limits, SAME_PLACE, greater, greatest, least, lesser};

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

/// What of a segment its kinks depend on.
#[derive(Clone, Copy)]
pub(super) struct Side {
    /// Unit tangents at start and end.
    pub first: DVec3,
    pub last: DVec3,
    pub speed_asked: f64,
    pub acceleration: f64,
    pub arc: bool,
    pub end: End,
}

/// How two segments meet, as far as it does not matter what runs meanwhile.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Kink {
    /// It nearly turns back.
    reversal: bool,
    /// The slower of the speeds asked for.
    speed: f64,
    /// Share of the acceleration that it asks of the axes.
    asks: f64,
    /// Where it may be rounded.
    corner: Corner,
}

impl Kink {
    pub(super) fn between(limits: &Limits, before: &Side, next: &Side) -> Kink {
        let (u1, u2) = (before.last, next.first);
        if (u1 + u2).length_squared() < SHARP * SHARP {
            return Kink { reversal: true, ..Kink::default() };
        }
        // What the kink asks of the axes, at the speed of the slower, within one period of the servo loop.
        let speed = lesser(before.speed_asked, next.speed_asked);
        let jump = (u2 - u1).abs() * (speed / limits.period + next.acceleration) / limits.acceleration;
        let mut asks = greatest(jump);
        if before.arc || next.arc {
            asks /= TANGENTIAL;
        }
        let rounded = before.end == End::Parabola && asks >= KINK_RATIO;
        let corner = if rounded { Corner::between(limits, u1, u2) } else { Corner::default() };
        Kink { reversal: false, speed, asks, corner }
    }
}

/// Joins a new segment to the last of the queue (tp.c: tpHandleBlendArc); gives the arc that comes between them, if any does.
pub(super) fn join(
    limits: &Limits,
    before: &mut Segment,
    next: &mut Segment,
    kink: &Kink,
) -> Option<RoundedCorner> {
    if before.progress > 0.5 * before.length || before.end == End::Stop {
        return None;
    }
    if kink.reversal {
        before.end_with(End::Stop, next);
        return None;
    }
    let &Kink { speed, asks, ref corner, .. } = kink;
    let share = lesser(asks, KINK_RATIO);
    before.kink_after = greater(before.kink_after, share);
    next.kink_before = greater(next.kink_before, share);
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
    if let Some(arc) = RoundedCorner::fit(limits, before, next, corner) {
        let fastest = arc.fastest(limits, before);
        // What a parabola could reach at most settles most corners.
        let cut = 2.0 * before.acceleration * before.tolerance;
        let most2 = if before.tolerance > 0.0 { cut / corner.cos_theta } else { f64::INFINITY };
        let clear = 4.0 * fastest * fastest > most2;
        if fastest > straight_on && (clear || fastest > 0.5 * parabola_speed(limits, before, next, corner)) {
            forget_kink(before, next);
            next.length -= arc.reach;
            if arc.keeps {
                before.length -= arc.reach;
                before.end_with(End::Tangent, next);
            }
            next.parabola_before = false;
            return Some(arc);
        }
    }
    let parabola = 0.5 * parabola_speed(limits, before, next, corner);
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
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    turn: f64,
    sin_theta: f64,
    cos_theta: f64,
    /// What the axes allow in any direction of its plane.
    acceleration: f64,
    speed: f64,
}

impl Corner {
    fn between(limits: &Limits, u1: DVec3, u2: DVec3) -> Corner {
        let cos_theta = half_jump(u1, u2);
        let across = across(u1, u2);
        Corner {
            turn: 2.0 * cos_theta.asin(),
            sin_theta: lesser(0.5 * (u2 + u1).length(), 1.0),
            cos_theta,
            acceleration: in_plane(across, limits.acceleration),
            speed: in_plane(across, limits.speed),
        }
    }
}

/// Axis of the turn.
fn across(u1: DVec3, u2: DVec3) -> DVec3 {
    u1.cross(u2).normalize_or_zero()
}

/// |u2 - u1| / 2 = sin(phi / 2), which keeps its digits at small turns.
fn half_jump(u1: DVec3, u2: DVec3) -> f64 {
    lesser(0.5 * (u2 - u1).length(), 1.0)
}

/// Speed across a parabolic blend, as far as it goes along the turn (tp.c: tpComputeBlendVelocity).
fn parabola_speed(limits: &Limits, before: &Segment, next: &Segment, corner: &Corner) -> f64 {
    let [this, after] = parabola_speeds(
        before,
        next,
        corner.cos_theta,
        lesser(before.speed_asked(), limits.path_speed),
        lesser(next.speed_asked(), limits.path_speed),
    );
    0.5 * corner.sin_theta * (this + after)
}

/// Speeds of the two segments at which a parabolic blend between them begins.
fn parabola_speeds(before: &Segment, next: &Segment, cos_theta: f64, this: f64, after: f64) -> [f64; 2] {
    let (a1, a2) = (before.acceleration_along(), next.acceleration_along());
    let reach = |segment: &Segment, a: f64| {
        (a * if segment.settled { segment.length } else { 0.5 * segment.length }).sqrt()
    };
    let (v1, v2) = (lesser(reach(before, a1), this), lesser(reach(next, a2), after));
    let longest = lesser(before.length / v1, next.length / v2);
    let time = lesser(longest, greater(v1 / a1, v2 / a2));
    let mut speeds = [lesser(v1, time * a1), lesser(v2, time * a2)];
    if before.tolerance > 0.0 && cos_theta > 1e-3 {
        let cut = 2.0 * (a1 * before.tolerance / cos_theta).sqrt();
        speeds = speeds.map(|v| lesser(v, cut));
    }
    speeds
}

/// The speed of `before` below which a parabola takes over, with the speeds asked for now.
pub(super) fn parabola_begins(before: &Segment, next: &Segment, this: f64, after: f64) -> f64 {
    parabola_speeds(before, next, half_jump(before.last, next.first), this, after)[0]
}

/// An arc that rounds a corner (blendmath.c: blendComputeParameters).
pub(super) struct RoundedCorner {
    radius: f64,
    turn: f64,
    /// What it takes of the segment before and of the next.
    reach: f64,
    speed: f64,
    asked: f64,
    acceleration: f64,
    /// What is left of the line before it is long enough to stay.
    pub keeps: bool,
}

impl RoundedCorner {
    fn fit(limits: &Limits, before: &Segment, next: &Segment, corner: &Corner) -> Option<RoundedCorner> {
        let Corner { mut turn, mut sin_theta, mut cos_theta, acceleration, speed: plane } = *corner;
        if 0.5 * turn < SMALLEST_ANGLE || sin_theta < SMALLEST_ANGLE {
            return None;
        }
        let theta = 0.5 * (std::f64::consts::PI - turn);
        let mut less = 0.0;
        let mut side = |segment: &Segment, at: usize, share: f64, length: f64, towards: f64, other: DVec3| {
            let Some(circle) = &segment.circle else { return Some(length) };
            let across = across(before.last, next.first);
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
        let l1 = side(before, 1, 2.0 / 3.0, lesser(before.length, half), 1.0, next.first)?;
        let l2 = side(next, 0, 1.0 / 3.0, 0.5 * next.length, -1.0, before.last)?;
        if less > 0.0 {
            let theta = (theta - less).max(SMALLEST_ANGLE);
            (turn, sin_theta, cos_theta) = (std::f64::consts::PI - 2.0 * theta, theta.sin(), theta.cos());
        }
        let tolerance = |segment: &Segment| {
            let quarter = 0.25 * segment.nominal_length;
            if segment.tolerance == 0.0 { quarter } else { lesser(segment.tolerance, quarter) }
        };
        let tolerance = lesser(tolerance(before), tolerance(next));
        let normal = NORMAL * acceleration;
        let asked = greater(before.speed_asked(), next.speed_asked());
        let goal = if asked <= plane { asked } else { asked.min(plane.max(altitude(before, next, turn))) };

        let tan_theta = sin_theta / cos_theta;
        // h = P / (1 - sin theta), d = h cos theta; 1 - sin = cos^2 / (1 + sin).
        let d = lesser(lesser(tolerance * (1.0 + sin_theta) / cos_theta, l1), l2);
        let radius_most = tan_theta * d;
        let speed = lesser((normal * radius_most).sqrt(), goal);
        // A parabola's way at half of the acceleration tells how much of the segments is worth taking.
        let slow = 0.5 * acceleration;
        let way = lesser((2.0 * slow * d).sqrt(), speed) / slow * speed;
        let radius = greater(speed * speed / normal, lesser(way / turn, radius_most));
        if radius < SAME_PLACE || radius * turn < SHORTEST_ARC {
            return None;
        }
        let reach = radius / tan_theta;
        let keeps = before.shape != Shape::Line
            || before.parabola_before
            || (before.length - reach) / speed >= GAP_CYCLES * limits.period;
        Some(RoundedCorner { radius, turn, reach, speed, asked, acceleration, keeps })
    }

    fn length(&self, before: &Segment) -> f64 {
        let rest = if self.keeps { 0.0 } else { before.length - self.reach };
        self.radius * self.turn + rest
    }

    /// The speed that its segment is settled to.
    fn fastest(&self, limits: &Limits, before: &Segment) -> f64 {
        lesser(self.speed, self.length(before) / limits.period)
    }

    /// The segment that comes between the one before, which gives it what it took, and the next.
    pub fn segment(&self, limits: &Limits, before: &Segment) -> Segment {
        let length = self.length(before);
        let along = Line {
            unit: before.last,
            length,
            requested: self.asked,
            speed_max: self.speed,
            acceleration: self.acceleration,
            end: End::Tangent,
            tolerance: before.tolerance,
            rapid: before.rapid,
        };
        let mut blend = Segment { shape: Shape::Blend, first: before.first, ..along.segment() };
        blend.settle(limits.period);
        blend
    }
}

/// The largest of a vector in any direction of a plane, from limits per axis.
fn in_plane(normal: DVec3, limits: DVec3) -> f64 {
    let along = (DVec3::ONE - normal * normal).max(DVec3::splat(SAME_PLACE * SAME_PLACE));
    least(limits * limits / along).sqrt()
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
