//! How long a program runs on its controller, in one pass over the motions and constant memory:
//! Grbl's planner or LinuxCNC's, with the limits of the machine.

mod clock;
mod junction;
mod kinematics;
mod linuxcnc;
mod round;

use glam::DVec3;

use super::reading::Reading;

pub use clock::{Clock, Command, Interpreter, Planner};

/// How a controller passes a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Corner {
    /// Grbl's junction deviation in mm: v^2 = a d s / (1 - s), s = cos(turn / 2).
    JunctionDeviation { mm: f64 },
    /// LinuxCNC's trajectory planner; its tolerance in mm holds until the text's own G61 or G64.
    Blend { mm: f64 },
    /// Every block ends in a stop.
    Stop,
}

/// What of a machine sets the time. Axes are X, Y, Z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    pub feed_max_mm_min: [f64; 3],
    pub rapid_mm_min: [f64; 3],
    pub acceleration_mm_s2: [f64; 3],
    /// Largest speed along the path, whatever its direction (LinuxCNC's \[TRAJ\] MAX_LINEAR_VELOCITY).
    pub path_max_mm_min: f64,
    pub corner: Corner,
    /// How far a chord of an arc may stand off it (Grbl's $12).
    pub arc_mm: f64,
    pub look_ahead_blocks: usize,
    /// A block takes this long at least.
    pub block_s: f64,
    /// Period of the servo loop, 0 for none: a block is spread over one at least.
    pub servo_period_s: f64,
    /// What the line to the controller carries; None is no limit.
    pub bytes_per_s: Option<f64>,
}

/// The time of one program, and what it goes to. The parts of the motion add up:
/// `total_s` = `at_feed_s` + `at_axis_limit_s` + `at_block_rate_s` + `in_corners_s` + `rapid_s` + `dwell_s` + `waiting_s`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timing {
    pub total_s: f64,
    /// Feed motions, with what corners and limits add.
    pub cutting_s: f64,
    pub rapid_s: f64,
    pub dwell_s: f64,
    /// What the feed motions would take at the feeds of the text.
    pub at_feed_s: f64,
    /// What the axes' largest feeds add.
    pub at_axis_limit_s: f64,
    /// What the time of a block adds.
    pub at_block_rate_s: f64,
    /// What braking and speeding up add.
    pub in_corners_s: f64,
    /// Waiting for the text over a slow line.
    pub waiting_s: f64,
    /// Stops for the operator or a tool change; their time is not known.
    pub pauses: u64,
}

impl Timing {
    /// What takes the most time, largest first, as name and seconds; parts of nothing are left out.
    pub fn limits(&self) -> Vec<(&'static str, f64)> {
        let mut parts = vec![
            ("feed", self.at_feed_s),
            ("axis limits", self.at_axis_limit_s),
            ("block rate", self.at_block_rate_s),
            ("corners", self.in_corners_s),
            ("rapids", self.rapid_s),
            ("dwell", self.dwell_s),
            ("transfer", self.waiting_s),
        ];
        parts.retain(|p| p.1 > 0.0);
        parts.sort_by(|a, b| b.1.total_cmp(&a.1));
        parts
    }

    /// Adds what a feed motion would take without corners.
    fn plan(&mut self, way: DVec3, length: f64, feed: f64, machine: &Kinematics) {
        if length == 0.0 {
            return;
        }
        let slowest = (way.abs() / DVec3::from_array(machine.feed_max_mm_min)).max_element() * 60.0;
        let limit = (way.length() / slowest).min(machine.path_max_mm_min / 60.0);
        let on_axes = length / feed.min(limit);
        self.at_feed_s += length / feed;
        self.at_axis_limit_s += on_axes - length / feed;
        self.at_block_rate_s += (machine.servo_period_s.max(machine.block_s) - on_axes).max(0.0);
    }

    /// Takes the time of all feed motions in, which may be less than their blocks' where the controller
    /// merged them or cut their corners.
    fn settle(&mut self, cutting_s: f64) {
        self.cutting_s = cutting_s;
        let mut rest = cutting_s - self.at_feed_s - self.at_axis_limit_s - self.at_block_rate_s;
        for part in [&mut self.at_block_rate_s, &mut self.at_axis_limit_s, &mut self.at_feed_s] {
            let given = (-rest).clamp(0.0, *part);
            *part -= given;
            rest += given;
        }
        self.in_corners_s = rest.max(0.0);
    }
}

/// Times a whole reading.
pub fn time(reading: &Reading, machine: &Kinematics) -> Timing {
    let mut clock = Clock::new(machine, reading.travel());
    reading.replay(&mut |event| clock.event(event));
    clock.finish(reading.summary.bytes)
}
