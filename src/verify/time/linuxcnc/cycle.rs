use super::blend::parabola_begins;
use super::segment::{End, Ending, Segment};
use super::{Controller, Limits, SAME_PLACE};

/// 1 / ARC_BLEND_RAMP_FREQ as delivered: shorter segments change their speed evenly.
const RAMP_TIME: f64 = 0.01;
const NO_SPEED: f64 = 1e-8;
const NO_TIME: f64 = 1e-12;

impl Controller {
    /// One cycle of the servo loop, or up to `most` at once while nothing changes.
    pub(super) fn cycle(&mut self, most: u64) {
        let limits = self.limits;
        let queue = self.queue.make_contiguous();
        let Some((head, rest)) = queue.split_first_mut() else { return };
        activate(head, &limits);
        let mut cycles = 1;
        if head.ending.is_some() {
            hand_over(head, rest, &limits);
        } else {
            head.period = limits.period;
            cycles += cruise(head, rest.first(), &limits, most - 1);
            step(head, rest.first(), &limits);
            parabola(head, rest, &limits);
        }
        if head.rapid {
            self.cycles.rapid += cycles;
        } else {
            self.cycles.cutting += cycles;
        }
        if head.done {
            self.queue.pop_front();
        }
    }
}

fn activate(head: &mut Segment, limits: &Limits) {
    if head.active {
        return;
    }
    head.active = true;
    let length = head.left();
    let time = 2.0 * length / (head.speed + head.end_speed.min(target(head, limits)));
    head.ramp = time < RAMP_TIME && !head.rapid && head.end == End::Tangent && length != 0.0;
    head.handing_over = false;
    head.braking = false;
}

fn target(segment: &Segment, limits: &Limits) -> f64 {
    segment.speed_asked().min(limits.path_speed)
}

fn end_speed(segment: &Segment, next: Option<&Segment>, limits: &Limits) -> f64 {
    match next {
        Some(next) if segment.end == End::Tangent => {
            segment.end_speed.min(target(segment, limits)).min(target(next, limits))
        }
        _ => 0.0,
    }
}

/// Runs whole cycles at an even speed, as long as braking is not due: it begins
/// (v^2 - end^2) / 2a + v T before the end.
fn cruise(head: &mut Segment, next: Option<&Segment>, limits: &Limits, most: u64) -> u64 {
    let speed = head.speed;
    if most == 0 || head.handing_over || speed <= 0.0 {
        return 0;
    }
    let end = end_speed(head, next, limits);
    let step = speed * limits.period;
    let left = head.left();
    let cycles = if even(head, end, left, limits) {
        left / step - 1.0
    } else if !head.ramp && speed == target(head, limits) {
        (left - (speed * speed - end * end).max(0.0) / (2.0 * head.acceleration_along())) / step - 2.0
    } else {
        return 0;
    };
    if cycles < 1.0 {
        return 0;
    }
    let cycles = (cycles as u64).min(most);
    head.progress += cycles as f64 * step;
    cycles
}

/// One step of a segment over its period.
fn step(segment: &mut Segment, next: Option<&Segment>, limits: &Limits) {
    let end = end_speed(segment, next, limits);
    let left = segment.left();
    if even(segment, end, left, limits) {
        return coast(segment, limits);
    }
    let along = segment.acceleration_along();
    let (acceleration, desired) = if segment.ramp && segment.end == End::Tangent && end >= NO_SPEED {
        let mean = 0.5 * (segment.speed + end);
        let time = if mean > NO_SPEED { (left / mean).max(1e-16) } else { 1e-16 };
        (((end - segment.speed) / time).clamp(-along, along), end)
    } else {
        trapezoid(segment, end, along, left, limits)
    };
    let speed = segment.speed + acceleration * segment.period;
    if speed < 0.0 {
        if left < segment.speed * segment.period {
            segment.progress = segment.length;
        }
        segment.speed = 0.0;
    } else {
        let way = 0.5 * (speed + segment.speed) * segment.period;
        segment.progress = (segment.progress + way).min(segment.length);
        segment.speed = speed;
    }
    segment.braking = (desired - segment.speed).abs() < NO_SPEED && acceleration < 0.0;
    look_for_end(segment, end, along, limits);
}

/// Whether nothing changes the speed from here to the end.
fn even(segment: &Segment, end: f64, left: f64, limits: &Limits) -> bool {
    segment.speed == end
        && end > NO_SPEED
        && (segment.ramp || segment.speed == target(segment, limits) && left >= end * segment.period)
}

/// What [`step`] comes to at an even speed.
fn coast(segment: &mut Segment, limits: &Limits) {
    let speed = segment.speed;
    segment.progress = (segment.progress + speed * segment.period).min(segment.length);
    segment.braking = false;
    segment.period = limits.period;
    let left = segment.left();
    if left <= SAME_PLACE {
        segment.progress = segment.length;
        segment.ending = Some(Ending { time: 0.0, speed });
    } else if left < speed * limits.period {
        segment.ending = Some(Ending { time: left / speed, speed });
    }
}

/// Acceleration of a step, and the speed from which the end can just be braked for.
fn trapezoid(segment: &Segment, end: f64, along: f64, left: f64, limits: &Limits) -> (f64, f64) {
    let half = 0.5 * along * segment.period;
    let root = end * end + along * (2.0 * left - segment.speed * segment.period) + half * half;
    let most = if root > half * half { root.sqrt() - half } else { -half };
    let asked = target(segment, limits);
    let speed = most.clamp(-asked, asked);
    let period = segment.period.max(NO_TIME);
    (((speed - segment.speed) / period).clamp(-along, along), most)
}

/// Whether the segment ends before the next cycle does, and when (tp.c: tpCheckEndCondition).
fn look_for_end(segment: &mut Segment, end: f64, along: f64, limits: &Limits) {
    segment.period = limits.period;
    let left = segment.left();
    let stops = matches!(segment.end, End::Stop | End::Exact);
    if left <= SAME_PLACE {
        segment.progress = segment.length;
        segment.ending = Some(Ending { time: 0.0, speed: segment.speed });
        segment.done = stops;
        return;
    }
    if stops {
        return;
    }
    let mean = 0.5 * (segment.speed + end);
    if mean <= NO_SPEED {
        return;
    }
    let mut time = (left / mean).max(0.5 * NO_TIME);
    let mut speed = end;
    let needed = (end - segment.speed) / time;
    if needed.abs() > along {
        let a = along.copysign(needed);
        let root = (segment.speed / a).powi(2) + 2.0 / a * left;
        if root < 0.0 {
            return;
        }
        let root = if root < NO_TIME * NO_TIME { 0.0 } else { root.sqrt() };
        time = -segment.speed / a + root.copysign(a);
        speed = segment.speed + time * a;
    }
    if time < NO_TIME {
        segment.progress = segment.length;
        segment.ending = Some(Ending { time: 0.0, speed });
    } else if time < limits.period {
        segment.ending = Some(Ending { time, speed });
    }
}

/// The cycle in which one segment ends and the next begins.
fn hand_over(head: &mut Segment, rest: &mut [Segment], limits: &Limits) {
    if head.done {
        return;
    }
    let Some(ending) = head.ending else { return };
    head.progress = head.length;
    head.done = true;
    let Some((next, after)) = rest.split_first_mut() else { return };
    if head.end == End::Tangent {
        next.period = limits.period - ending.time;
        next.speed = ending.speed;
    }
    step(next, after.first(), limits);
}

/// Begins the next segment while this one brakes.
fn parabola(head: &mut Segment, rest: &mut [Segment], limits: &Limits) {
    if head.end != End::Parabola {
        return;
    }
    let Some(next) = rest.first_mut() else { return };
    if !head.handing_over && head.braking {
        let begins = parabola_begins(head, next, target(head, limits), target(next, limits));
        head.handing_over = head.speed < begins;
    }
    if head.handing_over {
        step(next, None, limits);
    }
}
