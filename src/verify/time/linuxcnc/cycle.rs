use super::blend::parabola_begins;
use super::segment::{End, Ending, Segment};
use super::{Controller, Limits, SAME_PLACE, greater, lesser};

/// 1 / ARC_BLEND_RAMP_FREQ as delivered: shorter segments change their speed evenly.
const RAMP_TIME: f64 = 0.01;
const NO_SPEED: f64 = 1e-8;
const NO_TIME: f64 = 1e-12;
/// Braking is even within this part of its square.
const EVEN: f64 = 1e-12;
/// Cycles that are left to be taken one by one: in the last of them the end comes into sight, and rounding has its say.
const LAST: f64 = 1.0 + 1e-6;
/// What is this part of a limit is below it, however it was rounded.
const CLEAR: f64 = 1.0 - 1e-9;
/// And what is this part of it is above it.
const OVER: f64 = 1.0 + 1e-9;

/// Cycles of speeding up that are asked about together.
const AT_ONCE: u32 = 4;

impl Controller {
    /// One cycle of the servo loop.
    pub(super) fn cycle(&mut self) {
        self.run_head(1, true);
    }

    /// Runs until no more than `longest` segments wait, cycles in which nothing changes at once.
    pub(super) fn run(&mut self, longest: usize) {
        while self.queue.len() > longest {
            self.run_head(u32::MAX, false);
        }
    }

    /// Runs up to `most` cycles of the first segment at once, all that it has or `once`.
    #[inline(always)]
    fn run_head(&mut self, most: u32, once: bool) {
        let limits = self.limits;
        let mut segments = self.queue.iter_mut();
        let Some(head) = segments.next() else { return };
        let (mut next, after) = (segments.next(), segments.next());
        activate(head, &limits);
        let bounds = Bounds::of(head, next.as_deref(), &limits);
        let mut cycles = 0;
        loop {
            if head.ending.is_some() {
                hand_over(head, next.as_deref_mut(), after.as_deref(), &limits);
                cycles += 1;
            } else {
                cycles += u64::from(advance(head, next.as_deref_mut(), &bounds, &limits, most));
            }
            if head.done || once {
                break;
            }
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

/// One cycle, or up to `most` while nothing changes.
#[inline(always)]
fn advance(
    head: &mut Segment,
    mut next: Option<&mut Segment>,
    bounds: &Bounds,
    limits: &Limits,
    most: u32,
) -> u32 {
    let mut cycles = 1 + cruise(head, bounds, limits, most - 1);
    if head.ramp {
        cycles += change_evenly(head, bounds, limits, most - cycles);
    } else {
        cycles += speed_up(head, bounds, limits, most - cycles);
        cycles += slow_down(head, next.as_deref_mut(), bounds, limits, most - cycles);
    }
    step(head, bounds, limits, limits.period);
    if let (End::Parabola, Some(next)) = (head.end, next) {
        parabola(head, next, limits);
    }
    cycles
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
    lesser(segment.speed_asked(), limits.path_speed)
}

/// What holds of a segment while it runs and nothing more comes in.
struct Bounds {
    /// Speed that it may end at.
    end: f64,
    /// Speed asked for.
    asked: f64,
    /// Acceleration along the path.
    along: f64,
}

impl Bounds {
    fn of(segment: &Segment, next: Option<&Segment>, limits: &Limits) -> Bounds {
        let asked = target(segment, limits);
        let end = match next {
            Some(next) if segment.end == End::Tangent => {
                lesser(lesser(segment.end_speed, asked), target(next, limits))
            }
            _ => 0.0,
        };
        Bounds { end, asked, along: segment.acceleration_along() }
    }
}

/// Runs whole cycles at an even speed, as long as braking is not due: it begins
/// (v^2 - end^2) / 2a + v T before the end.
fn cruise(head: &mut Segment, bounds: &Bounds, limits: &Limits, most: u32) -> u32 {
    let speed = head.speed;
    if most == 0 || head.handing_over || speed <= 0.0 {
        return 0;
    }
    let end = bounds.end;
    let step = speed * limits.period;
    let left = head.left();
    let cycles = if even(head, bounds, left, limits.period) {
        left / step - 1.0
    } else if !head.ramp && speed == bounds.asked {
        (left - (speed * speed - end * end).max(0.0) / (2.0 * bounds.along)) / step - 2.0
    } else {
        return 0;
    };
    if cycles < 1.0 {
        return 0;
    }
    let cycles = (cycles as u32).min(most);
    head.progress += f64::from(cycles) * step;
    cycles
}

/// Runs whole cycles of [`step`] at full acceleration, bit by bit what they come to, as long as they are clear of what
/// ends that by more than rounding: the speed asked for, braking and the end.
fn speed_up(head: &mut Segment, bounds: &Bounds, limits: &Limits, most: u32) -> u32 {
    if head.handing_over {
        return 0;
    }
    let &Bounds { end, along, .. } = bounds;
    let asked = bounds.asked * CLEAR;
    let gain = along * limits.period;
    let clear = |before: f64, speed: f64, at: f64, progress: f64| {
        let root = end * end + along * (2.0 * (head.length - at) - before * limits.period);
        speed < asked
            && speed * (speed + gain) < root * CLEAR
            && far_from_end(head.length - progress, speed, end, gain, limits)
    };
    let (mut speed, mut progress) = (head.speed, head.progress);
    let mut cycles = 0;
    // The last of some cycles is the nearest to all limits.
    for at_once in [AT_ONCE, 1] {
        while most - cycles >= at_once {
            let (mut faster, mut farther) = (speed, progress);
            let (mut before, mut at) = (speed, progress);
            for _ in 0..at_once {
                (before, at) = (faster, farther);
                faster += gain;
                farther += 0.5 * (faster + before) * limits.period;
            }
            if !clear(before, faster, at, farther) {
                break;
            }
            (speed, progress) = (faster, farther);
            cycles += at_once;
        }
    }
    if cycles > 0 {
        (head.speed, head.progress, head.braking) = (speed, progress, false);
    }
    cycles
}

/// Runs whole cycles of braking evenly. Each takes `gain` off the speed: with h half of it, (v' + h)^2 = e^2 + a (2 l - v T) + h^2
/// and l' = l - (v + v') T / 2 give (v'' + h)^2 = (v' - h)^2. While a parabola hands over, only as long as the next segment
/// speeds up, which takes part.
fn slow_down(
    head: &mut Segment,
    next: Option<&mut Segment>,
    bounds: &Bounds,
    limits: &Limits,
    most: u32,
) -> u32 {
    let &Bounds { end, asked, along } = bounds;
    let gain = along * limits.period;
    let half = 0.5 * gain;
    let root = end * end + along * (2.0 * head.left() - head.speed * limits.period) + half * half;
    let needed = (head.speed - half) * (head.speed - half);
    if (root - needed).abs() > EVEN * needed || head.speed - gain > asked {
        return 0;
    }
    let mut lowest = end;
    if head.end == End::Parabola && !head.handing_over {
        let Some(next) = &next else { return 0 };
        lowest = lowest.max(parabola_begins(head, next, asked, target(next, limits)));
    }
    let cycles = (head.speed - lowest) / gain - LAST;
    if !(1.0..1e9).contains(&cycles) {
        return 0;
    }
    let mut cycles = (cycles as u32).min(most);
    if head.handing_over {
        let Some(next) = next else { return 0 };
        cycles = speed_up(next, &Bounds::of(next, None, limits), limits, cycles);
    }
    head.progress += f64::from(cycles) * limits.period * (head.speed - half * f64::from(cycles));
    head.speed -= f64::from(cycles) * gain;
    head.braking |= cycles > 0;
    cycles
}

/// Runs whole cycles of a short segment that goes from its speed to the one at its end with one acceleration.
fn change_evenly(head: &mut Segment, bounds: &Bounds, limits: &Limits, most: u32) -> u32 {
    let &Bounds { end, along, .. } = bounds;
    if most == 0 || head.end != End::Tangent || end < NO_SPEED {
        return 0;
    }
    let time = 2.0 * head.left() / (head.speed + end);
    let gain = (end - head.speed) / time * limits.period;
    let cycles = time / limits.period - LAST;
    if !(1.0..1e9).contains(&cycles) || gain.abs() > along * limits.period * CLEAR {
        return 0;
    }
    let cycles = (cycles as u32).min(most);
    let speed = head.speed + f64::from(cycles) * gain;
    head.progress += 0.5 * (head.speed + speed) * f64::from(cycles) * limits.period;
    head.speed = speed;
    head.braking = false;
    cycles
}

/// Whether a cycle of no more than full acceleration cannot come to the end.
fn far_from_end(left: f64, speed: f64, end: f64, gain: f64, limits: &Limits) -> bool {
    left * CLEAR > (greater(speed, end) + gain) * limits.period
}

/// One step of a segment over its period.
fn step(segment: &mut Segment, bounds: &Bounds, limits: &Limits, period: f64) {
    let &Bounds { end, along, .. } = bounds;
    let left = segment.left();
    if even(segment, bounds, left, period) {
        return coast(segment, limits, period);
    }
    let (acceleration, desired) = if segment.ramp && segment.end == End::Tangent && end >= NO_SPEED {
        let mean = 0.5 * (segment.speed + end);
        let time = if mean > NO_SPEED { (left / mean).max(1e-16) } else { 1e-16 };
        (within((end - segment.speed) / time, along), end)
    } else {
        trapezoid(segment, bounds, left, period)
    };
    let speed = segment.speed + acceleration * period;
    if speed < 0.0 {
        if left < segment.speed * period {
            segment.progress = segment.length;
        }
        segment.speed = 0.0;
    } else {
        let way = 0.5 * (speed + segment.speed) * period;
        segment.progress = lesser(segment.progress + way, segment.length);
        segment.speed = speed;
    }
    segment.braking = (desired - segment.speed).abs() < NO_SPEED && acceleration < 0.0;
    look_for_end(segment, end, along, limits);
}

/// Whether nothing changes the speed from here to the end.
fn even(segment: &Segment, bounds: &Bounds, left: f64, period: f64) -> bool {
    let end = bounds.end;
    segment.speed == end
        && end > NO_SPEED
        && (segment.ramp || segment.speed == bounds.asked && left >= end * period)
}

/// What [`step`] comes to at an even speed.
fn coast(segment: &mut Segment, limits: &Limits, period: f64) {
    let speed = segment.speed;
    segment.progress = lesser(segment.progress + speed * period, segment.length);
    segment.braking = false;
    let left = segment.left();
    if left <= SAME_PLACE {
        segment.progress = segment.length;
        segment.ending = Some(Ending { time: 0.0, speed });
    } else if left < speed * limits.period {
        segment.ending = Some(Ending { time: left / speed, speed });
    }
}

/// Acceleration of a step, and the speed from which the end can just be braked for.
fn trapezoid(segment: &Segment, bounds: &Bounds, left: f64, period: f64) -> (f64, f64) {
    let &Bounds { end, asked, along } = bounds;
    let half = 0.5 * along * period;
    let root = end * end + along * (2.0 * left - segment.speed * period) + half * half;
    // What is clear of its limits does not wait for a root and a division; while it speeds up, no one asks for the second.
    let period = greater(period, NO_TIME);
    let gain = along * period * OVER;
    let reach = (segment.speed + gain) * OVER;
    if reach < asked && (reach + half) * (reach + half) * OVER < root {
        return (along, asked);
    }
    let most = if root > half * half { root.sqrt() - half } else { -half };
    let change = within(most, asked) - segment.speed;
    let acceleration = if change > gain {
        along
    } else if change < -gain {
        -along
    } else {
        within(change / period, along)
    };
    (acceleration, most)
}

/// Whether the segment ends before the next cycle does, and when (tp.c: tpCheckEndCondition).
fn look_for_end(segment: &mut Segment, end: f64, along: f64, limits: &Limits) {
    let left = segment.left();
    let stops = matches!(segment.end, End::Stop | End::Exact);
    if left <= SAME_PLACE {
        segment.progress = segment.length;
        segment.ending = Some(Ending { time: 0.0, speed: segment.speed });
        segment.done = stops;
        return;
    }
    if stops || far_from_end(left, segment.speed, end, along * limits.period, limits) {
        return;
    }
    let mean = 0.5 * (segment.speed + end);
    if mean <= NO_SPEED {
        return;
    }
    let mut time = (left / mean).max(0.5 * NO_TIME);
    let mut speed = end;
    if needs_more(end - segment.speed, mean, left, time, along) {
        let a = along.copysign(end - segment.speed);
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

/// Whether a change of speed in this time, `left / mean`, needs more acceleration than there is.
fn needs_more(change: f64, mean: f64, left: f64, time: f64, along: f64) -> bool {
    // Both sides times the way: what is clear does not wait for divisions.
    let (needed, most) = (change.abs() * mean, along * left);
    if needed < most * CLEAR {
        return false;
    }
    if needed > most * OVER && left > NO_TIME * mean {
        return true;
    }
    (change / time).abs() > along
}

/// The cycle in which one segment ends and the next begins.
fn hand_over(head: &mut Segment, next: Option<&mut Segment>, after: Option<&Segment>, limits: &Limits) {
    if head.done {
        return;
    }
    let Some(ending) = head.ending else { return };
    head.progress = head.length;
    head.done = true;
    let Some(next) = next else { return };
    let mut period = limits.period;
    if head.end == End::Tangent {
        period -= ending.time;
        next.speed = ending.speed;
    }
    step(next, &Bounds::of(next, after, limits), limits, period);
}

/// Begins the next segment while this one brakes.
fn parabola(head: &mut Segment, next: &mut Segment, limits: &Limits) {
    if !head.handing_over && head.braking {
        let begins = parabola_begins(head, next, target(head, limits), target(next, limits));
        head.handing_over = head.speed < begins;
    }
    if head.handing_over {
        step(next, &Bounds::of(next, None, limits), limits, limits.period);
    }
}

/// The number between -most and most that is nearest.
fn within(number: f64, most: f64) -> f64 {
    lesser(greater(number, -most), most)
}
