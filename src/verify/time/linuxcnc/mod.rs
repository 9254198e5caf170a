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

use segment::{End, Segment};

/// Shorter is no way at all (TP_POS_EPSILON).
const SAME_PLACE: f64 = 1e-12;

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

/// The controller while a program runs.
pub(super) struct Controller {
    limits: Limits,
    end: End,
    tolerance: f64,
    merge: f64,
    chain: canon::Chain,
    queue: VecDeque<Segment>,
    pub cycles: Cycles,
}
