use std::collections::VecDeque;

use super::blend::{Kink, join};
use super::segment::{End, Segment};
use super::{Command, Controller, Cycles, Limits, Motion, lesser};

/// The backward pass ends after more peaks than this (TP_OPTIMIZATION_CUTOFF).
const PEAKS: u32 = 4;

impl Controller {
    pub fn new(limits: Limits) -> Controller {
        Controller { limits, queue: VecDeque::with_capacity(limits.depth + 8), cycles: Cycles::default() }
    }

    pub fn take(&mut self, command: &Command) {
        let segment = match &command.motion {
            Motion::Line(line) => line.segment(),
            Motion::Arc(segment) => Segment::clone(segment),
        };
        self.push(segment, &command.kink);
    }

    /// Takes a segment in, and runs the servo cycles that pass meanwhile: the controller takes one
    /// command a cycle. Once the queue is longer than the backward pass, when more come changes
    /// nothing any more.
    fn push(&mut self, mut next: Segment, kink: &Kink) {
        if let Some(before) = self.queue.back_mut() {
            if before.rapid != next.rapid {
                before.end_with(End::Stop, &mut next);
            }
            match join(&self.limits, before, &mut next, kink) {
                Some(arc) if arc.keeps => {
                    before.settle(self.limits.period);
                    let blend = arc.segment(&self.limits, before);
                    self.queue.push_back(blend);
                }
                // Nothing is left of the line.
                Some(arc) => *before = arc.segment(&self.limits, before),
                None => before.settle(self.limits.period),
            }
        }
        self.queue.push_back(next);
        brake_backward(&mut self.queue, &self.limits);
        self.cycle();
        self.run(self.limits.depth + 4);
    }

    /// Runs until the queue is empty.
    pub fn drain(&mut self) {
        self.run(0);
    }
}

/// Finds how fast each of the last segments may end, from the back (tp.c: tpRunOptimization).
fn brake_backward(queue: &mut VecDeque<Segment>, limits: &Limits) {
    let (mut peaks, mut stops) = (0, 0);
    let mut segments = queue.iter_mut().rev();
    let Some(mut after) = segments.next() else { return };
    for before in segments.take(limits.depth + 1) {
        let this = std::mem::replace(&mut after, before);
        let before = &mut *after;
        if before.end != End::Tangent {
            stops += 1;
            if stops > 1 {
                return;
            }
            continue;
        }
        // What has run a quarter of its way can't be braked safely.
        if before.progress >= 0.25 * before.length || before.ending.is_some() || before.handing_over {
            return;
        }
        if this.settled {
            let mut limit = lesser(this.speed_max, before.speed_max);
            if let Some(kink) = before.kink_speed {
                limit = lesser(limit, kink);
            }
            let from2 = this.end_speed * this.end_speed + this.gain2;
            if from2 >= limit * limit {
                before.end_speed = limit;
                before.at_peak = true;
            } else {
                before.end_speed = from2.sqrt();
            }
            this.speed_max = lesser(this.speed_max, this.spread_speed);
        } else {
            // Half of it may still go to a blend: stop by the half.
            let triangle = (this.acceleration_along() * this.length).sqrt();
            let most = lesser(lesser(before.speed_max, triangle), this.speed_asked());
            let mut speed = lesser(most, limits.path_speed);
            if let Some(kink) = before.kink_speed {
                speed = lesser(speed, kink);
            }
            before.end_speed = speed;
            this.end_speed = 0.0;
        }
        if this.at_peak {
            peaks += 1;
        }
        if peaks > PEAKS {
            return;
        }
    }
}
