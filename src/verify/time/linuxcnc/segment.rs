use glam::DVec3;

use super::{greater, lesser};

/// What the tangential part of the acceleration keeps beside a blend's normal part.
pub(super) const TANGENTIAL: f64 = 0.5;

/// sqrt(1 - [`TANGENTIAL`]^2).
pub(super) const NORMAL: f64 = 0.866_025_403_784_438_6;

/// A block is spread over this many servo cycles at least (TP_MIN_SEGMENT_CYCLES).
const SHORTEST_CYCLES: f64 = 1.02;

/// How a segment hands over to the next (tc_types.h: TC_TERM_COND_*).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// At rest, whatever follows.
    Stop,
    /// At rest, unless the next begins in the same direction.
    Exact,
    /// The next begins while this one still brakes, each with half of its acceleration.
    Parabola,
    /// Without a stop.
    Tangent,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Line,
    /// An arc of the program.
    Arc,
    /// An arc that rounds a corner.
    Blend,
}

/// What a blend needs to know of an arc. Unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Circle {
    pub radius: f64,
    pub angle: f64,
    pub normal: DVec3,
    /// Towards the centre, from the first point and from the last.
    pub inward: [DVec3; 2],
    /// How far a helix climbs.
    pub climb: f64,
}

/// A straight segment as it comes to the controller. Lengths in mm, speeds in mm/s.
#[derive(Debug)]
pub(in super::super) struct Line {
    pub unit: DVec3,
    pub length: f64,
    pub requested: f64,
    pub speed_max: f64,
    pub acceleration: f64,
    pub(super) end: End,
    pub tolerance: f64,
    pub rapid: bool,
}

impl Line {
    pub(super) fn segment(&self) -> Segment {
        Segment {
            shape: Shape::Line,
            circle: None,
            rapid: self.rapid,
            end: self.end,
            parabola_before: false,
            length: self.length,
            nominal_length: self.length,
            first: self.unit,
            last: self.unit,
            requested: self.requested,
            speed_max: self.speed_max,
            acceleration: self.acceleration,
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

/// One segment of the controller's queue. Lengths in mm, speeds in mm/s.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub shape: Shape,
    /// Of an arc of the program; few programs have them, so they stand apart.
    pub circle: Option<Box<Circle>>,
    pub rapid: bool,
    pub end: End,
    /// A parabola leads into it.
    pub parabola_before: bool,
    pub length: f64,
    /// Before blends took their parts.
    pub nominal_length: f64,
    /// Unit tangents at start and end.
    pub first: DVec3,
    pub last: DVec3,
    pub requested: f64,
    pub speed_max: f64,
    pub acceleration: f64,
    /// Share of the acceleration along the path.
    pub tangential: f64,
    /// Speed that the kink at its end allows.
    pub kink_speed: Option<f64>,
    /// Share of the acceleration that the kinks at its start and end take.
    pub kink_before: f64,
    pub kink_after: f64,
    /// G64 P; 0 is none.
    pub tolerance: f64,
    /// No blend will shorten it any more.
    pub settled: bool,
    /// Of one that is settled: what its acceleration adds to the square of its speed, and the speed that spreads it over enough
    /// cycles.
    pub gain2: f64,
    pub spread_speed: f64,
    /// Speed at its end, as far as the queue can be braked from.
    pub end_speed: f64,
    pub at_peak: bool,

    // While it runs.
    pub active: bool,
    pub progress: f64,
    pub speed: f64,
    pub ramp: bool,
    /// It ends within the next cycle, after this part of it and at this speed.
    pub ending: Option<Ending>,
    pub done: bool,
    pub braking: bool,
    pub handing_over: bool,
}

/// The last, shorter step of a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ending {
    pub time: f64,
    pub speed: f64,
}

impl Segment {
    pub fn acceleration_whole(&self) -> f64 {
        let kinks = 1.0 - greater(self.kink_after, self.kink_before);
        let halved = self.parabola_before || self.end == End::Parabola;
        self.acceleration * if halved { 0.5 * kinks } else { kinks }
    }

    /// Along the path.
    pub fn acceleration_along(&self) -> f64 {
        let whole = self.acceleration_whole();
        if self.shape == Shape::Line { whole } else { whole * self.tangential }
    }

    pub fn speed_asked(&self) -> f64 {
        lesser(self.requested, self.speed_max)
    }

    /// Fixes its length: a step of the servo loop at most covers it, and an arc is as fast as its
    /// radius allows.
    pub fn settle(&mut self, period: f64) {
        if self.settled {
            return;
        }
        self.speed_max = lesser(self.speed_max, self.length / period);
        if let Some(circle) = &self.circle {
            let whole = self.acceleration_whole();
            let radius = circle.radius + circle.climb * circle.climb / circle.radius;
            let normal = self.speed_max * self.speed_max / radius;
            if normal > NORMAL * whole {
                self.speed_max = (NORMAL * whole * radius).sqrt();
                self.tangential = TANGENTIAL;
            } else {
                self.tangential = (1.0 - (normal / whole).powi(2)).sqrt();
            }
        }
        self.gain2 = 2.0 * self.acceleration_along() * self.length;
        self.spread_speed = self.length / (SHORTEST_CYCLES * period);
        self.settled = true;
    }

    /// Sets how this one ends and what that means for the next.
    pub fn end_with(&mut self, end: End, next: &mut Segment) {
        self.end = end;
        next.parabola_before = end == End::Parabola;
    }

    pub fn left(&self) -> f64 {
        self.length - self.progress
    }
}
