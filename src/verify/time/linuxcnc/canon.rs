use std::collections::VecDeque;

use glam::DVec3;

use super::super::round::Round;
use super::segment::{Circle, End, NORMAL, Segment, Shape, TANGENTIAL};
use super::{Controller, Cycles, Limits, SAME_PLACE, greatest, lesser};
use crate::verify::reading::PathMode;

/// Longest chain of blocks that are merged.
const LONGEST_CHAIN: usize = 100;
/// Less is no way for an axis (CART_FUZZ).
const NO_WAY: f64 = 1e-8;

/// Feed blocks that may still become one line (emccanon.cc: see_segment).
#[derive(Debug, Default)]
pub(super) struct Chain {
    /// Where the controller's last command ended.
    from: DVec3,
    points: Vec<DVec3>,
    feed: f64,
}

impl Controller {
    pub fn new(limits: Limits, at: DVec3, tolerance: f64) -> Controller {
        Controller {
            limits,
            end: End::Parabola,
            tolerance,
            merge: 0.0,
            chain: Chain { from: at, ..Chain::default() },
            queue: VecDeque::with_capacity(limits.depth + 8),
            cycles: Cycles::default(),
        }
    }

    /// G61, G61.1 or G64; a G64 without Q merges within P.
    pub fn path(&mut self, mode: PathMode) {
        self.flush();
        (self.end, self.tolerance, self.merge) = match mode {
            PathMode::Stop => (End::Stop, 0.0, self.merge),
            PathMode::Exact => (End::Exact, 0.0, self.merge),
            PathMode::Blend { tolerance_mm, merge_mm } => {
                let tolerance = tolerance_mm.unwrap_or(0.0);
                (End::Parabola, tolerance, merge_mm.unwrap_or(tolerance))
            }
        };
    }

    pub fn rapid(&mut self, to: DVec3) {
        self.flush();
        let speed = self.limits.speed;
        self.line(to, f64::INFINITY, speed, true);
    }

    /// `feed` in mm/s.
    pub fn feed(&mut self, to: DVec3, feed: f64) {
        if feed != self.chain.feed {
            self.flush();
            self.chain.feed = feed;
        }
        if !self.chain.points.is_empty() && !self.merges(to) {
            self.flush();
        }
        self.chain.points.push(to);
    }

    pub fn arc(&mut self, arc: &Round, feed: f64) {
        let blends = self.end == End::Parabola;
        if blends && arc.normal.z.abs() > 0.5 && arc.radius * (1.0 - (0.5 * arc.angle).cos()) < self.merge {
            self.feed(arc.middle, feed);
            self.feed(arc.to, feed);
            return;
        }
        self.flush();
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
        let segment = self.segment(Shape::Arc, arc.length, [arc.first, arc.last], false);
        self.push(Segment {
            requested: feed.min(speed),
            speed_max: speed.min(arc.length / self.limits.period),
            acceleration: arc.length / slow,
            circle: Some(Box::new(circle)),
            ..segment
        });
    }

    /// Comes to rest: what is merged so far runs, then everything in the queue.
    pub fn stop(&mut self) {
        self.flush();
        self.drain();
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

    fn flush(&mut self) {
        if let Some(to) = self.chain.points.last().copied() {
            self.chain.points.clear();
            let feed = self.limits.feed;
            self.line(to, self.chain.feed, feed, false);
        }
    }

    fn line(&mut self, to: DVec3, asked: f64, speeds: DVec3, rapid: bool) {
        let way = to - self.chain.from;
        let (time, slow) = (longest(way, speeds), longest(way, self.limits.acceleration));
        self.chain.from = to;
        let length = way.length();
        if time <= 0.0 || length < SAME_PLACE {
            return;
        }
        let speed = length / time;
        let unit = way / length;
        let segment = self.segment(Shape::Line, length, [unit, unit], rapid);
        self.push(Segment {
            requested: lesser(asked, speed),
            speed_max: lesser(speed, length / self.limits.period),
            acceleration: length / slow,
            ..segment
        });
    }

    fn segment(&self, shape: Shape, length: f64, tangents: [DVec3; 2], rapid: bool) -> Segment {
        Segment {
            shape,
            circle: None,
            rapid,
            end: self.end,
            parabola_before: false,
            length,
            nominal_length: length,
            first: tangents[0],
            last: tangents[1],
            requested: 0.0,
            speed_max: 0.0,
            acceleration: 0.0,
            tangential: TANGENTIAL,
            kink_speed: None,
            kink_before: 0.0,
            kink_after: 0.0,
            tolerance: self.tolerance,
            settled: false,
            gain2: 0.0,
            spread_speed: 0.0,
            end_speed: 0.0,
            at_peak: false,
            active: false,
            progress: 0.0,
            speed: 0.0,
            ramp: false,
            ending: None,
            done: false,
            braking: false,
            handing_over: false,
        }
    }
}

/// Time that the slowest axis needs, or the square of it, from limits per axis.
fn longest(way: DVec3, limits: DVec3) -> f64 {
    let way = way.abs();
    let times = way / limits;
    let moved = way.cmpge(DVec3::splat(NO_WAY));
    greatest(DVec3::select(moved, times, DVec3::ZERO))
}
