//! LinuxCNC's motion controller, cycle by cycle of its servo loop: naive-cam merging as blocks come
//! in, arcs that round the corners of G64 P, kinks taken straight, parabolas where no arc fits, the
//! backward pass over the queue, and the steps of the trajectory planner. The equations are those of
//! LinuxCNC 2.9's emccanon.cc, tp.c, tc.c and blendmath.c with the `ARC_BLEND_*` settings as delivered; it is
//! their timing that is modelled, so no point of the path is kept.

mod blend;
mod canon;
mod cycle;
mod queue;
mod segment;

use std::collections::VecDeque;

use glam::DVec3;

use blend::Kink;
pub(super) use canon::Canon;
use segment::{Line, Segment};

/// Shorter is no way at all (TP_POS_EPSILON).
const SAME_PLACE: f64 = 1e-12;

/// The lesser of two numbers; [`f64::min`] minds what is no number too, which a step of the servo loop has no time for.
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers.
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The least of a vector.
fn least(vector: DVec3) -> f64 {
    lesser(vector.x, lesser(vector.y, vector.z))
}

/// The greatest of a vector.
fn greatest(vector: DVec3) -> f64 {
    greater(vector.x, greater(vector.y, vector.z))
}

/// What of a machine the controller knows, in mm and s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Largest speed of each axis.
    pub speed: DVec3,
    pub feed: DVec3,
    pub acceleration: DVec3,
    /// \[TRAJ\] MAX_LINEAR_VELOCITY.
    pub path_speed: f64,
    /// Period of the servo loop.
    pub period: f64,
    /// ARC_BLEND_OPTIMIZATION_DEPTH.
    pub depth: usize,
}

/// Servo cycles spent.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cycles {
    pub cutting: u64,
    pub rapid: u64,
}

/// What comes to the controller: a segment, and how it meets the one before.
pub(super) struct Command {
    motion: Motion,
    kink: Kink,
}

enum Motion {
    Line(Line),
    Arc(Box<Segment>),
}

/// The controller while a program runs.
pub(super) struct Controller {
    limits: Limits,
    queue: VecDeque<Segment>,
    pub cycles: Cycles,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::verify::reading::PathMode;

    const LIMITS: Limits = Limits {
        speed: DVec3::new(80.0, 80.0, 50.0),
        feed: DVec3::new(80.0, 80.0, 50.0),
        acceleration: DVec3::new(500.0, 500.0, 300.0),
        path_speed: 80.0,
        period: 0.001,
        depth: 50,
    };

    proptest! {
        #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn cycles_at_once_are_cycles_one_by_one(
            ways in proptest::collection::vec((-0.3..0.3f64, -0.3..0.3f64, -0.05..0.05f64), 2..40),
            scale in prop_oneof![Just(0.1), Just(1.0), Just(20.0)],
            feed in 2.0..80.0f64,
            mode in prop_oneof![
                Just(PathMode::Exact),
                Just(PathMode::Stop),
                Just(PathMode::Blend { tolerance_mm: Some(0.002), merge_mm: Some(0.0) }),
                Just(PathMode::Blend { tolerance_mm: None, merge_mm: None }),
            ],
        ) {
            let full = || {
                let mut controller = Controller::new(LIMITS);
                let mut canon = Canon::new(LIMITS, DVec3::ZERO, 0.0);
                let give = &mut |command: Command| controller.take(&command);
                canon.path(mode, give);
                let mut at = DVec3::ZERO;
                for &(x, y, z) in &ways {
                    at += scale * DVec3::new(x, y, z);
                    canon.feed(at, feed, give);
                }
                // Two more come than the chain holds back.
                canon.feed(at + DVec3::X, feed, give);
                canon.rapid(DVec3::ZERO, give);
                controller
            };
            let (mut at_once, mut one_by_one) = (full(), full());
            at_once.drain();
            while !one_by_one.queue.is_empty() {
                one_by_one.cycle();
            }
            let [a, b] = [at_once, one_by_one].map(|c| (c.cycles.cutting, c.cycles.rapid));
            // A segment that ends with its cycle may be rounded to end with the next.
            prop_assert!(a.0.abs_diff(b.0) <= 1 && a.1.abs_diff(b.1) <= 1, "{:?} and {:?}", a, b);
        }
    }
}
