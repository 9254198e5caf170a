use glam::DVec3;

use super::super::round::Round;
use super::blend::{Kink, Side};
use super::segment::{Circle, End, Line, NORMAL, Segment, Shape};
use super::{Command, Limits, Motion, SAME_PLACE, greatest, lesser};
use crate::verify::reading::PathMode;

/// Longest chain of blocks that are merged.
const LONGEST_CHAIN: usize = 100;
/// Less is no way for an axis (CART_FUZZ).
const NO_WAY: f64 = 1e-8;

/// Makes the controller's commands of the motions of a program, one by one.
pub(in super::super) struct Canon {
    limits: Limits,
    end: End,
    tolerance: f64,
    merge: f64,
    chain: Chain,
    /// What came last.
    last: Option<Side>,
}

/// Feed blocks that may still become one line (emccanon.cc: see_segment).
#[derive(Debug, Default)]
struct Chain {
    /// Where the controller's last command ended.
    from: DVec3,
    points: Vec<DVec3>,
    feed: f64,
}

impl Canon {
    pub fn new(limits: Limits, at: DVec3, tolerance: f64) -> Canon {
        let chain = Chain { from: at, ..Chain::default() };
        Canon { limits, end: End::Parabola, tolerance, merge: 0.0, chain, last: None }
    }

    /// G61, G61.1 or G64; a G64 without Q merges within P.
    pub fn path(&mut self, mode: PathMode, give: &mut impl FnMut(Command)) {
        self.flush(give);
        (self.end, self.tolerance, self.merge) = match mode {
            PathMode::Stop => (End::Stop, 0.0, self.merge),
            PathMode::Exact => (End::Exact, 0.0, self.merge),
            PathMode::Blend { tolerance_mm, merge_mm } => {
                let tolerance = tolerance_mm.unwrap_or(0.0);
                (End::Parabola, tolerance, merge_mm.unwrap_or(tolerance))
            }
        };
    }

    pub fn rapid(&mut self, to: DVec3, give: &mut impl FnMut(Command)) {
        self.flush(give);
        let speed = self.limits.speed;
        self.line(to, f64::INFINITY, speed, true, give);
    }

    /// `feed` in mm/s.
    pub fn feed(&mut self, to: DVec3, feed: f64, give: &mut impl FnMut(Command)) {
        if feed != self.chain.feed {
            self.flush(give);
            self.chain.feed = feed;
        }
        if !self.chain.points.is_empty() && !self.merges(to) {
            self.flush(give);
        }
        self.chain.points.push(to);
    }

    pub fn arc(&mut self, arc: &Round, feed: f64, give: &mut impl FnMut(Command)) {
        let blends = self.end == End::Parabola;
        if blends && arc.normal.z.abs() > 0.5 && arc.radius * (1.0 - (0.5 * arc.angle).cos()) < self.merge {
            self.feed(arc.middle, feed, give);
            self.feed(arc.to, feed, give);
            return;
        }
        self.flush(give);
        self.chain.feed = feed;
        let axis = arc.normal.abs().to_array();
        let upright = (0..3).max_by(|a, b| axis[*a].total_cmp(&axis[*b])).unwrap_or(2);
        let in_plane = |limits: DVec3| {
            let limits = limits.to_array();
            (0..3).filter(|a| *a != upright).fold(f64::INFINITY, |least: f64, a| least.min(limits[a]))
        };
        let planar = (arc.length * arc.length - arc.climb * arc.climb).max(0.0).sqrt();
        let turning = (NORMAL * in_plane(self.limits.acceleration) * arc.radius).sqrt();
        let way = arc.to - self.chain.from;
        let time = (planar / turning.min(in_plane(self.limits.feed))).max(longest(way, self.limits.feed));
        let slow = (planar / in_plane(self.limits.acceleration)).max(longest(way, self.limits.acceleration));
        self.chain.from = arc.to;
        if arc.length < SAME_PLACE {
            return;
        }
        let circle = Circle {
            radius: arc.radius,
            angle: arc.angle,
            normal: arc.normal,
            inward: arc.inward,
            climb: arc.climb,
        };
        let speed = arc.length / time;
        let line = Line {
            unit: arc.first,
            length: arc.length,
            requested: feed.min(speed),
            speed_max: speed.min(arc.length / self.limits.period),
            acceleration: arc.length / slow,
            end: self.end,
            tolerance: self.tolerance,
            rapid: false,
        };
        let segment =
            Segment { shape: Shape::Arc, last: arc.last, circle: Some(Box::new(circle)), ..line.segment() };
        let kink = self.kink(Side {
            first: arc.first,
            last: arc.last,
            speed_asked: segment.speed_asked(),
            acceleration: segment.acceleration,
            arc: true,
            end: self.end,
        });
        give(Command { motion: Motion::Arc(Box::new(segment)), kink });
    }

    /// How the last segment meets the next.
    fn kink(&mut self, next: Side) -> Kink {
        let before = self.last.replace(next);
        before.map_or(Kink::default(), |before| Kink::between(&self.limits, &before, &next))
    }

    /// Whether all blocks of the chain stay near the line from its start to `to`.
    fn merges(&self, to: DVec3) -> bool {
        let Chain { from, points, .. } = &self.chain;
        if self.end != End::Parabola || self.merge == 0.0 || points.len() > LONGEST_CHAIN || to == *from {
            return false;
        }
        let way = to - *from;
        let per = 1.0 / way.length_squared();
        // The newest is the likeliest to be off.
        points.iter().rev().all(|point| {
            let there = *point - *from;
            let share = (way.dot(there) * per).clamp(0.0, 1.0);
            (there - way * share).length_squared() <= self.merge * self.merge
        })
    }

    /// What is merged so far runs.
    pub fn flush(&mut self, give: &mut impl FnMut(Command)) {
        if let Some(to) = self.chain.points.last().copied() {
            self.chain.points.clear();
            let feed = self.limits.feed;
            self.line(to, self.chain.feed, feed, false, give);
        }
    }

    fn line(&mut self, to: DVec3, asked: f64, speeds: DVec3, rapid: bool, give: &mut impl FnMut(Command)) {
        let way = to - self.chain.from;
        let (time, slow) = (longest(way, speeds), longest(way, self.limits.acceleration));
        self.chain.from = to;
        let length = way.length();
        if time <= 0.0 || length < SAME_PLACE {
            return;
        }
        let speed = length / time;
        let unit = way / length;
        let line = Line {
            unit,
            length,
            requested: lesser(asked, speed),
            speed_max: lesser(speed, length / self.limits.period),
            acceleration: length / slow,
            end: self.end,
            tolerance: self.tolerance,
            rapid,
        };
        let kink = self.kink(Side {
            first: unit,
            last: unit,
            speed_asked: lesser(line.requested, line.speed_max),
            acceleration: line.acceleration,
            arc: false,
            end: self.end,
        });
        give(Command { motion: Motion::Line(line), kink });
    }
}

/// Time that the slowest axis needs, or the square of it, from limits per axis.
fn longest(way: DVec3, limits: DVec3) -> f64 {
    let way = way.abs();
    let times = way / limits;
    let moved = way.cmpge(DVec3::splat(NO_WAY));
    greatest(DVec3::select(moved, times, DVec3::ZERO))
}
