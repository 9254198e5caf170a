use glam::DVec3;

use super::super::reading::Event;
use super::super::travel::Travel;
use super::linuxcnc::{self, Canon, Controller, Limits};
use super::round::{Chords, Round};
use super::{Corner, Kinematics, Timing, junction};

/// Times a program event by event. Its halves may run on two threads: one makes commands of the events, as an interpreter
/// does, the other runs them, as a controller does.
pub struct Clock {
    pub interpreter: Interpreter,
    pub planner: Planner,
}

impl Clock {
    /// A clock at the start of a program, with the machine at its zero; travels count as rapids.
    pub fn new(machine: &Kinematics, travel: Travel) -> Clock {
        let limits = limits(machine);
        let (canon, planner) = match machine.corner {
            Corner::Blend { mm } => (
                Some(Canon::new(limits, DVec3::ZERO, mm)),
                Kind::Controller(Box::new(Controller::new(limits))),
            ),
            _ => (None, Kind::Junction(Box::new(junction::Planner::new(machine)), Timing::default())),
        };
        Clock {
            interpreter: Interpreter {
                machine: *machine,
                travel,
                last_mm: [f64::NAN; 3],
                at_mm: DVec3::ZERO,
                arc: None,
                canon,
                timing: Timing::default(),
            },
            planner: Planner { machine: *machine, kind: planner },
        }
    }

    /// Takes the next event in.
    pub fn event(&mut self, event: &Event) {
        self.interpreter.event(event, &mut |command| self.planner.take(&command));
    }

    /// Ends the program, whose text has this many bytes.
    pub fn finish(mut self, bytes: u64) -> Timing {
        self.interpreter.stop(&mut |command| self.planner.take(&command));
        let mut timing = self.interpreter.timing;
        match self.planner.kind {
            Kind::Junction(_, moving) => {
                timing = Timing { dwell_s: timing.dwell_s, pauses: timing.pauses, ..moving };
            }
            Kind::Controller(controller) => {
                let period = self.planner.machine.servo_period_s;
                timing.settle(controller.cycles.cutting as f64 * period);
                timing.rapid_s = controller.cycles.rapid as f64 * period;
            }
        }
        let moving = timing.cutting_s + timing.rapid_s + timing.dwell_s;
        if let Some(rate) = self.planner.machine.bytes_per_s.filter(|rate| *rate > 0.0) {
            timing.waiting_s = (bytes as f64 / rate - moving).max(0.0);
        }
        timing.total_s = moving + timing.waiting_s;
        timing
    }
}

/// What the planner is to do next.
pub struct Command(Order);

enum Order {
    /// A straight block for Grbl; its feed in mm/s, None for a rapid.
    Block {
        way: DVec3,
        feed: Option<f64>,
        travel: bool,
    },
    Arc {
        round: Box<Round>,
        feed: f64,
    },
    Controller(linuxcnc::Command),
    /// Come to rest.
    Stop,
}

/// The first half of a clock: makes commands of events, and keeps what needs no planning.
pub struct Interpreter {
    machine: Kinematics,
    travel: Travel,
    last_mm: [f64; 3],
    at_mm: DVec3,
    arc: Option<Chords>,
    /// For LinuxCNC's controller.
    canon: Option<Canon>,
    timing: Timing,
}

impl Interpreter {
    /// Takes the next event in and gives what the planner has to do for it.
    pub fn event(&mut self, event: &Event, give: &mut impl FnMut(Command)) {
        match *event {
            Event::Move(motion) => {
                // An axis that is not known yet, or stands at home, is where it was.
                let to: DVec3 = DVec3::from_array(motion.to_mm);
                let to = DVec3::select(to.is_finite_mask(), to, self.at_mm);
                let travel = self.travel.holds(self.last_mm, &motion);
                self.last_mm = motion.to_mm;
                let feed = (!motion.rapid()).then(|| f64::from(motion.feed_mm_min) / 60.0);
                self.go(to, feed, travel, give);
            }
            Event::Arc { radius_mm, chords } => {
                self.arc = (chords > 1).then(|| Chords::new(self.at_mm, radius_mm, chords));
            }
            Event::Dwell { seconds, .. } => {
                self.stop(give);
                self.timing.dwell_s += seconds;
            }
            Event::Path(mode) => {
                if let Some(canon) = &mut self.canon {
                    canon.path(mode, &mut |command| give(Command(Order::Controller(command))));
                }
            }
            Event::Pause { .. } => {
                self.stop(give);
                self.timing.pauses += 1;
            }
        }
    }

    fn go(&mut self, to: DVec3, feed: Option<f64>, travel: bool, give: &mut impl FnMut(Command)) {
        let from = std::mem::replace(&mut self.at_mm, to);
        if let Some(arc) = &mut self.arc {
            if !arc.add(to) {
                return;
            }
            let round = arc.round();
            self.arc = None;
            if let Some(round) = round {
                return self.turn(&round, feed.unwrap_or(f64::INFINITY), give);
            }
        }
        let way = to - from;
        let Some(canon) = &mut self.canon else {
            return give(Command(Order::Block { way, feed, travel }));
        };
        let give = &mut |command| give(Command(Order::Controller(command)));
        match feed {
            None => canon.rapid(to, give),
            Some(feed) => {
                self.timing.plan(way, way.length(), feed, &self.machine);
                canon.feed(to, feed, give);
            }
        }
    }

    fn turn(&mut self, round: &Round, feed: f64, give: &mut impl FnMut(Command)) {
        match &mut self.canon {
            None => give(Command(Order::Arc { round: Box::new(*round), feed })),
            Some(canon) => {
                self.timing.plan(round.first, round.length, feed, &self.machine);
                canon.arc(round, feed, &mut |command| give(Command(Order::Controller(command))));
            }
        }
    }

    /// Comes to rest.
    fn stop(&mut self, give: &mut impl FnMut(Command)) {
        if let Some(canon) = &mut self.canon {
            canon.flush(&mut |command| give(Command(Order::Controller(command))));
        }
        give(Command(Order::Stop));
    }
}

/// The second half of a clock: runs commands as the controller of its machine does.
pub struct Planner {
    machine: Kinematics,
    kind: Kind,
}

enum Kind {
    Junction(Box<junction::Planner>, Timing),
    Controller(Box<Controller>),
}

impl Planner {
    /// Takes the next command of the [`Interpreter`] beside it.
    pub fn take(&mut self, command: &Command) {
        match &mut self.kind {
            Kind::Junction(planner, timing) => match &command.0 {
                Order::Block { way, feed, travel } => planner.line(*way, *feed, *travel, timing),
                Order::Arc { round, feed } => {
                    let chords = match self.machine.corner {
                        Corner::Stop => 1,
                        _ => round.grbl_chords(self.machine.arc_mm),
                    };
                    let mut from = round.point(0.0);
                    for chord in 1..=chords {
                        let to = round.point(f64::from(chord) / f64::from(chords));
                        planner.line(to - from, Some(*feed), false, timing);
                        from = to;
                    }
                }
                Order::Stop => planner.stop(timing),
                // The interpreter beside it gives none.
                Order::Controller(_) => {}
            },
            Kind::Controller(controller) => match &command.0 {
                Order::Controller(command) => controller.take(command),
                Order::Stop => controller.drain(),
                // The interpreter beside it gives none.
                Order::Block { .. } | Order::Arc { .. } => {}
            },
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
