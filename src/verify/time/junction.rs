use std::collections::VecDeque;

use glam::DVec3;

use super::{Corner, Kinematics, Timing};

/// Grbl's planner: trapezoids, a junction speed per corner, and a window of blocks (planner.c of
/// Grbl 1.1, grblHAL and FluidNC). A machine that stops at every block is the same with junction
/// speeds of 0.
pub(super) struct Planner {
    machine: Kinematics,
    /// Direction of the last block, until a stop.
    last: Option<DVec3>,
    last_speed: f64,
    queue: VecDeque<Block>,
    /// Square of the speed with which the first of the queue begins.
    speed2: f64,
}

/// A block in the queue. Speeds in mm/s.
#[derive(Clone, Copy, Debug)]
struct Block {
    length: f64,
    /// As the text says, and as axes and block rate leave it.
    programmed: f64,
    on_axes: f64,
    speed: f64,
    acceleration: f64,
    /// Largest square of the speed at its start.
    entry2: f64,
    rapid: bool,
}

impl Planner {
    pub fn new(machine: &Kinematics) -> Planner {
        Planner {
            machine: *machine,
            last: None,
            last_speed: 0.0,
            queue: VecDeque::with_capacity(machine.look_ahead_blocks.min(4096) + 2),
            speed2: 0.0,
        }
    }

    /// A straight block; `feed` in mm/s, None for a rapid.
    pub fn line(&mut self, way: DVec3, feed: Option<f64>, travel: bool, timing: &mut Timing) {
        let length = way.length();
        if length == 0.0 {
            return;
        }
        let (machine, unit) = (&self.machine, way / length);
        let acceleration = along(unit, &machine.acceleration_mm_s2);
        let limits = if travel { &machine.rapid_mm_min } else { &machine.feed_max_mm_min };
        let limit = along(unit, limits) / 60.0;
        let programmed = feed.unwrap_or(limit);
        let on_axes = programmed.min(limit);
        let least_s = machine.block_s.max(machine.servo_period_s);
        let speed = if least_s > 0.0 { on_axes.min(length / least_s) } else { on_axes };
        let entry2 = self.last.map_or(0.0, |last| self.junction2(last, unit));
        let before = self.queue.back().map_or(self.last_speed, |block| block.speed);
        let entry2 = entry2.min(speed * speed).min(before * before);
        self.last = Some(unit);
        self.last_speed = speed;
        self.queue.push_back(Block {
            length,
            programmed,
            on_axes,
            speed,
            acceleration,
            entry2,
            rapid: travel,
        });
        // The block that runs is one of those the controller holds.
        if self.queue.len() >= self.machine.look_ahead_blocks.max(1) {
            self.release(timing);
        }
    }

    /// Largest square of the speed through the corner between two unit vectors:
    /// v^2 = a d s / (1 - s), s = cos(turn / 2), with the axes' acceleration along the change of direction.
    fn junction2(&self, before: DVec3, after: DVec3) -> f64 {
        let Corner::JunctionDeviation { mm } = self.machine.corner else { return 0.0 };
        let turn = after - before;
        let turned = turn.length();
        // |b - a| = 2 sin(turn / 2), which keeps its digits at small turns.
        let sine = (0.5 * turned).min(1.0);
        let cosine = (1.0 - sine * sine).sqrt();
        // cos(turn) = 1 - 2 sin^2(turn / 2); within 1e-6 Grbl calls it straight, or a reversal.
        if 2.0 * sine * sine < 1e-6 {
            return f64::INFINITY;
        }
        if 2.0 * cosine * cosine < 1e-6 {
            return 0.0;
        }
        let acceleration = along(turn / turned, &self.machine.acceleration_mm_s2);
        // 1 - cos = sin^2 / (1 + cos).
        acceleration * mm * cosine * (1.0 + cosine) / (sine * sine)
    }

    /// Comes to rest.
    pub fn stop(&mut self, timing: &mut Timing) {
        while !self.queue.is_empty() {
            self.release(timing);
        }
        self.speed2 = 0.0;
        self.last = None;
    }

    /// Times the first of the queue: it ends as fast as the rest of the queue can still brake from.
    fn release(&mut self, timing: &mut Timing) {
        let Some(first) = self.queue.pop_front() else { return };
        let (mut end2, mut braking2, mut stops) = (f64::INFINITY, 0.0, true);
        for block in &self.queue {
            end2 = end2.min(braking2 + block.entry2);
            if braking2 >= end2 {
                stops = false;
                break;
            }
            braking2 += 2.0 * block.acceleration * block.length;
        }
        if stops {
            end2 = end2.min(braking2);
        }
        let reach2 = 2.0 * first.acceleration * first.length;
        let end2 = end2.min(self.speed2 + reach2);
        let seconds = trapezoid(first.length, self.speed2, end2, first.speed, first.acceleration);
        self.speed2 = end2;
        if first.rapid {
            timing.rapid_s += seconds;
            return;
        }
        let [programmed, on_axes, planned] =
            [first.programmed, first.on_axes, first.speed].map(|v| first.length / v);
        timing.cutting_s += seconds;
        timing.at_feed_s += programmed;
        timing.at_axis_limit_s += on_axes - programmed;
        timing.at_block_rate_s += planned - on_axes;
        timing.in_corners_s += seconds - planned;
    }
}

/// The largest of a vector along a unit vector, from limits per axis.
fn along(unit: DVec3, limits: &[f64; 3]) -> f64 {
    // An axis that stands still divides by zero, and infinity is no limit.
    (DVec3::from_array(*limits) / unit.abs()).min_element()
}

/// Time of a block from the square of one speed to another, at most `speed`.
fn trapezoid(length: f64, from2: f64, to2: f64, speed: f64, acceleration: f64) -> f64 {
    let peak2 = 0.5 * (2.0 * acceleration * length + from2 + to2);
    let (from, to) = (from2.sqrt(), to2.sqrt());
    if peak2 >= speed * speed {
        let ramps = (2.0 * speed * speed - from2 - to2) / (2.0 * acceleration);
        (2.0 * speed - from - to) / acceleration + (length - ramps) / speed
    } else {
        let peak = peak2.sqrt();
        // Ends that only just can be reached leave less than nothing, by rounding.
        ((peak - from) / acceleration + (peak - to) / acceleration).max(0.0)
    }
}
