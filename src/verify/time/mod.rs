//! How long a program runs on its controller, in one pass over the motions and constant memory:
//! Grbl's planner or LinuxCNC's, with the limits of the machine.

mod junction;
mod kinematics;
mod linuxcnc;
mod round;

use glam::DVec3;

use super::reading::{Event, Reading};
use super::travel::Travel;
use linuxcnc::{Controller, Limits};
use round::{Chords, Round};

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

enum Planner {
    Junction(Box<junction::Planner>),
    Controller(Box<Controller>),
}

/// Times a program event by event.
pub struct Clock {
    machine: Kinematics,
    travel: Travel,
    last_mm: [f64; 3],
    at_mm: DVec3,
    arc: Option<Chords>,
    planner: Planner,
    timing: Timing,
}

impl Clock {
    /// A clock at the start of a program, with the machine at its zero; travels count as rapids.
    pub fn new(machine: &Kinematics, travel: Travel) -> Clock {
        let planner = match machine.corner {
            Corner::Blend { mm } => {
                Planner::Controller(Box::new(Controller::new(limits(machine), DVec3::ZERO, mm)))
            }
            _ => Planner::Junction(Box::new(junction::Planner::new(machine))),
        };
        Clock {
            machine: *machine,
            travel,
            last_mm: [f64::NAN; 3],
            at_mm: DVec3::ZERO,
            arc: None,
            planner,
            timing: Timing::default(),
        }
    }

    /// Takes the next event in.
    pub fn event(&mut self, event: &Event) {
        match *event {
            Event::Move(motion) => {
                // An axis that is not known yet, or stands at home, is where it was.
                let to: DVec3 = DVec3::from_array(motion.to_mm);
                let to = DVec3::select(to.is_finite_mask(), to, self.at_mm);
                let travel = self.travel.holds(self.last_mm, &motion);
                self.last_mm = motion.to_mm;
                let feed = (!motion.rapid()).then(|| f64::from(motion.feed_mm_min) / 60.0);
                self.go(to, feed, travel);
            }
            Event::Arc { radius_mm, chords } => {
                self.arc = (chords > 1).then(|| Chords::new(self.at_mm, radius_mm, chords));
            }
            Event::Dwell { seconds, .. } => {
                self.stop();
                self.timing.dwell_s += seconds;
            }
            Event::Path(mode) => {
                if let Planner::Controller(controller) = &mut self.planner {
                    controller.path(mode);
                }
            }
            Event::Pause { .. } => {
                self.stop();
                self.timing.pauses += 1;
            }
        }
    }

    /// Ends the program, whose text has this many bytes.
    pub fn finish(mut self, bytes: u64) -> Timing {
        self.stop();
        if let Planner::Controller(controller) = &self.planner {
            let period = self.machine.servo_period_s;
            self.timing.settle(controller.cycles.cutting as f64 * period);
            self.timing.rapid_s = controller.cycles.rapid as f64 * period;
        }
        let mut timing = self.timing;
        let moving = timing.cutting_s + timing.rapid_s + timing.dwell_s;
        if let Some(rate) = self.machine.bytes_per_s.filter(|rate| *rate > 0.0) {
            timing.waiting_s = (bytes as f64 / rate - moving).max(0.0);
        }
        timing.total_s = moving + timing.waiting_s;
        timing
    }

    fn go(&mut self, to: DVec3, feed: Option<f64>, travel: bool) {
        let from = std::mem::replace(&mut self.at_mm, to);
        if let Some(arc) = &mut self.arc {
            if !arc.add(to) {
                return;
            }
            let round = arc.round();
            self.arc = None;
            if let Some(round) = round {
                return self.turn(&round, feed.unwrap_or(f64::INFINITY));
            }
        }
        let way = to - from;
        match &mut self.planner {
            Planner::Junction(planner) => planner.line(way, feed, travel, &mut self.timing),
            Planner::Controller(controller) => match feed {
                None => controller.rapid(to),
                Some(feed) => {
                    self.timing.plan(way, way.length(), feed, &self.machine);
                    controller.feed(to, feed);
                }
            },
        }
    }

    fn turn(&mut self, round: &Round, feed: f64) {
        match &mut self.planner {
            Planner::Junction(planner) => {
                let chords = match self.machine.corner {
                    Corner::Stop => 1,
                    _ => round.grbl_chords(self.machine.arc_mm),
                };
                let mut from = round.point(0.0);
                for chord in 1..=chords {
                    let to = round.point(f64::from(chord) / f64::from(chords));
                    planner.line(to - from, Some(feed), false, &mut self.timing);
                    from = to;
                }
            }
            Planner::Controller(controller) => {
                self.timing.plan(round.first, round.length, feed, &self.machine);
                controller.arc(round, feed);
            }
        }
    }

    /// Comes to rest.
    fn stop(&mut self) {
        match &mut self.planner {
            Planner::Junction(planner) => planner.stop(&mut self.timing),
            Planner::Controller(controller) => controller.stop(),
        }
    }
}

fn limits(machine: &Kinematics) -> Limits {
    Limits {
        speed: DVec3::from_array(machine.rapid_mm_min) / 60.0,
        feed: DVec3::from_array(machine.feed_max_mm_min) / 60.0,
        acceleration: DVec3::from_array(machine.acceleration_mm_s2),
        path_speed: machine.path_max_mm_min / 60.0,
        period: machine.servo_period_s,
        depth: machine.look_ahead_blocks,
    }
}
