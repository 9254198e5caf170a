//! How long a program runs: trapezoids of speed, the corner rule of the controller, and its
//! look-ahead, in one pass over the motions and constant memory.

use std::collections::VecDeque;

use super::reading::{Event, PathMode, Reading};

/// How a controller passes a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Corner {
    /// Grbl's junction deviation in mm: v^2 = a d s / (1 - s), s = cos(turn / 2).
    JunctionDeviation { mm: f64 },
    /// LinuxCNC's arc blends within a tolerance in mm, which G64 P in the text replaces; G61 there
    /// takes a corner only as fast as its kink allows.
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
    pub corner: Corner,
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
}

/// Times a whole reading.
pub fn time(reading: &Reading, machine: &Kinematics) -> Timing {
    let mut clock = Clock::new(machine, reading.travel_mm_min());
    reading.replay(&mut |event| clock.event(event));
    clock.finish(reading.summary.bytes)
}

/// A move before its corners are known; an arc's first and last direction differ.
#[derive(Clone, Copy, Debug)]
struct Planned {
    length: f64,
    /// mm/s.
    programmed: f64,
    limit: f64,
    acceleration: f64,
    first: [f64; 3],
    last: [f64; 3],
    rapid: bool,
}

/// An arc whose chords are still coming.
#[derive(Clone, Copy, Debug)]
struct Arc {
    left: u32,
    radius: f64,
    so_far: Option<Planned>,
}

/// A move in the controller's queue.
#[derive(Clone, Copy, Debug)]
struct Segment {
    length: f64,
    /// As the text says, and as axes and block rate leave it, in mm/s.
    programmed: f64,
    on_axes: f64,
    speed: f64,
    acceleration: f64,
    /// Largest square of the speed at its start.
    entry2: f64,
    rapid: bool,
}

/// Times a program event by event.
pub struct Clock {
    machine: Kinematics,
    travel_mm_min: Option<f32>,
    path: PathMode,
    at_mm: [f64; 3],
    /// Unit vector and length of the last move, until a stop.
    last: Option<([f64; 3], f64)>,
    last_speed: f64,
    arc: Option<Arc>,
    queue: VecDeque<Segment>,
    /// Square of the speed with which the first of the queue begins.
    speed2: f64,
    timing: Timing,
}

impl Clock {
    /// A clock at the start of a program. Feed motions at `travel_mm_min` or faster count as rapids.
    pub fn new(machine: &Kinematics, travel_mm_min: Option<f32>) -> Clock {
        Clock {
            machine: *machine,
            travel_mm_min,
            path: PathMode::Blend { tolerance_mm: None, merge_mm: None },
            at_mm: [f64::NAN; 3],
            last: None,
            last_speed: 0.0,
            arc: None,
            queue: VecDeque::with_capacity(machine.look_ahead_blocks + 2),
            speed2: 0.0,
            timing: Timing::default(),
        }
    }

    /// Takes the next event in.
    pub fn event(&mut self, event: &Event) {
        match *event {
            Event::Move(motion) => {
                let to = motion.to_mm;
                // An axis that is not known yet, or at home, moves no known way.
                let way = |axis: usize| {
                    let way = to[axis] - self.at_mm[axis];
                    if way.is_finite() { way } else { 0.0 }
                };
                let way = [way(0), way(1), way(2)];
                self.at_mm = to;
                let travel = self.travel_mm_min.is_some_and(|speed| motion.feed_mm_min >= speed);
                let feed = (!motion.rapid()).then(|| f64::from(motion.feed_mm_min) / 60.0);
                self.go(way, feed, motion.rapid() || travel);
            }
            Event::Arc { radius_mm, chords } => {
                self.arc = (chords > 0).then_some(Arc { left: chords, radius: radius_mm, so_far: None });
            }
            Event::Dwell { seconds, .. } => {
                self.stop();
                self.timing.dwell_s += seconds;
            }
            Event::Path(mode) => self.path = mode,
            Event::Pause { .. } => {
                self.stop();
                self.timing.pauses += 1;
            }
        }
    }

    /// Ends the program, whose text has this many bytes.
    pub fn finish(mut self, bytes: u64) -> Timing {
        self.stop();
        let mut timing = self.timing;
        let moving = timing.cutting_s + timing.rapid_s + timing.dwell_s;
        if let Some(rate) = self.machine.bytes_per_s.filter(|rate| *rate > 0.0) {
            timing.waiting_s = (bytes as f64 / rate - moving).max(0.0);
        }
        timing.total_s = moving + timing.waiting_s;
        timing
    }

    fn go(&mut self, way: [f64; 3], feed: Option<f64>, rapid: bool) {
        let length = (way[0] * way[0] + way[1] * way[1] + way[2] * way[2]).sqrt();
        if length == 0.0 {
            self.arc =
                self.arc.take().filter(|arc| arc.left > 1).map(|arc| Arc { left: arc.left - 1, ..arc });
            return;
        }
        let machine = &self.machine;
        let unit = way.map(|w| w / length);
        let along = |limits: &[f64; 3]| {
            (0..3).fold(f64::INFINITY, |least: f64, axis| {
                if unit[axis] == 0.0 { least } else { least.min(limits[axis] / unit[axis].abs()) }
            })
        };
        let acceleration = along(&machine.acceleration_mm_s2);
        let limit = along(if rapid { &machine.rapid_mm_min } else { &machine.feed_max_mm_min }) / 60.0;
        let Some(arc) = &mut self.arc else {
            let speed = feed.unwrap_or(limit);
            return self.plan(Planned {
                length,
                programmed: speed,
                limit,
                acceleration,
                first: unit,
                last: unit,
                rapid,
            });
        };
        // The chords of an arc are one move to the controller.
        let whole = arc.so_far.get_or_insert(Planned {
            length: 0.0,
            programmed: feed.unwrap_or(limit),
            limit,
            acceleration,
            first: unit,
            last: unit,
            rapid,
        });
        whole.length += length;
        whole.last = unit;
        whole.limit = whole.limit.min(limit);
        whole.acceleration = whole.acceleration.min(acceleration);
        arc.left -= 1;
        if arc.left == 0 {
            // Turning takes 0.866 of the acceleration at most, which leaves half of it along the path.
            let mut whole = *whole;
            whole.limit = whole.limit.min((0.866 * whole.acceleration * arc.radius).sqrt());
            whole.acceleration *= 0.5;
            self.arc = None;
            self.plan(whole);
        }
    }

    fn plan(&mut self, this: Planned) {
        let Planned { length, programmed, limit, acceleration, first, last, rapid } = this;
        let on_axes = programmed.min(limit);
        let least_s = self.machine.block_s.max(1.02 * self.machine.servo_period_s);
        let speed = if least_s > 0.0 { on_axes.min(length / least_s) } else { on_axes };
        let entry2 = match self.last {
            None => 0.0,
            Some((before, before_length)) => self.corner2(before, first, before_length, length, speed),
        };
        let before = self.queue.back().map_or(self.last_speed, |s| s.speed);
        let entry2 = entry2.min(speed * speed).min(before * before);
        self.last = Some((last, length));
        self.last_speed = speed;
        self.queue.push_back(Segment { length, programmed, on_axes, speed, acceleration, entry2, rapid });
        // The block that runs is one of those the controller holds.
        if self.queue.len() >= self.machine.look_ahead_blocks.max(1) {
            self.release();
        }
    }

    /// Largest square of the speed through a corner between unit vectors `a` and `b`.
    fn corner2(&self, a: [f64; 3], b: [f64; 3], a_length: f64, b_length: f64, speed: f64) -> f64 {
        let turn: [f64; 3] = std::array::from_fn(|axis| b[axis] - a[axis]);
        let turned = (turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]).sqrt();
        // |b - a| = 2 sin(turn / 2), which keeps its digits at small turns.
        let sine = 0.5 * turned;
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        let limits = &self.machine.acceleration_mm_s2;
        let acceleration = (0..3).fold(f64::INFINITY, |least: f64, axis| {
            if turn[axis] == 0.0 { least } else { least.min(limits[axis] * turned / turn[axis].abs()) }
        });
        // cos(turn) = 1 - 2 sin^2(turn / 2); Grbl calls within 1e-6 straight, or a reversal.
        let straight = 2.0 * sine * sine < 1e-6;
        let reversal = 2.0 * cosine * cosine < 1e-6;
        let deviation = match (self.machine.corner, self.path) {
            (Corner::Stop, _) | (_, PathMode::Stop) => return 0.0,
            (Corner::JunctionDeviation { mm }, _) => {
                if straight {
                    return f64::INFINITY;
                }
                if reversal {
                    return 0.0;
                }
                // 1 - cos = sin^2 / (1 + cos).
                return acceleration * mm * cosine * (1.0 + cosine) / (sine * sine);
            }
            (Corner::Blend { .. }, PathMode::Exact) => 0.0,
            (Corner::Blend { .. }, PathMode::Blend { tolerance_mm: Some(mm), .. }) => mm,
            (Corner::Blend { mm }, PathMode::Blend { tolerance_mm: None, .. }) => mm,
        };
        // LinuxCNC: what a kink asks of an axis within one servo period may be a tenth of what it has.
        let period = self.machine.servo_period_s;
        let kink = if period > 0.0 && turned > 0.0 {
            let least = limits.iter().copied().fold(f64::INFINITY, f64::min);
            let asks = (0..3).fold(0.0f64, |most, axis| {
                most.max(turn[axis].abs() * (speed / period + least) / limits[axis])
            });
            if asks < 0.1 { f64::INFINITY } else { speed * 0.1 / asks }
        } else if straight {
            f64::INFINITY
        } else {
            0.0
        };
        // Turns of more than 178 degrees stop.
        if cosine < 0.0175 {
            return 0.0;
        }
        // blendmath.c: d = min(halves, h cos theta), R = d tan theta, theta = (pi - turn) / 2.
        let blend = if deviation > 0.0 && sine > 0.0 {
            let reach = deviation * (1.0 + cosine) / sine;
            let d = reach.min(0.5 * a_length).min(0.5 * b_length);
            0.866 * acceleration * d * cosine / sine
        } else {
            0.0
        };
        blend.max(kink * kink)
    }

    /// Comes to rest.
    fn stop(&mut self) {
        while !self.queue.is_empty() {
            self.release();
        }
        self.speed2 = 0.0;
        self.last = None;
    }

    /// Times the first of the queue: it ends as fast as the rest of the queue can still brake from.
    fn release(&mut self) {
        let Some(first) = self.queue.pop_front() else { return };
        let mut end2 = f64::INFINITY;
        let mut braking2 = 0.0;
        let mut stops = true;
        for segment in &self.queue {
            end2 = end2.min(braking2 + segment.entry2);
            if braking2 >= end2 {
                stops = false;
                break;
            }
            braking2 += 2.0 * segment.acceleration * segment.length;
        }
        if stops {
            end2 = end2.min(braking2);
        }
        let reach2 = 2.0 * first.acceleration * first.length;
        let end2 = end2.min(self.speed2 + reach2);
        let seconds = trapezoid(first.length, self.speed2, end2, first.speed, first.acceleration);
        self.speed2 = end2;
        if first.rapid {
            self.timing.rapid_s += seconds;
            return;
        }
        let [programmed, on_axes, planned] =
            [first.programmed, first.on_axes, first.speed].map(|v| first.length / v);
        self.timing.cutting_s += seconds;
        self.timing.at_feed_s += programmed;
        self.timing.at_axis_limit_s += on_axes - programmed;
        self.timing.at_block_rate_s += planned - on_axes;
        self.timing.in_corners_s += seconds - planned;
    }
}

/// Time of a move from the square of one speed to another, at most `speed`.
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
