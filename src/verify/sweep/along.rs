//! Moves parallel to an axis of the samples, which nearly all of a finishing pass are.
//!
//! Every line of samples beside the path is cut by a straight line, its level and where it begins and ends a
//! matter of the line's distance alone; where the path turns up, by the cutter standing at the corner as well. The
//! straight line is the lowest that the cutter could come were the move endless, so a group of samples that does
//! not stand above it is passed over.

use std::ops::Range;

use super::super::contact::Contact;
use super::above::{Above, GROUP, lanes};
use super::band::{Band, highest};
use super::bite::Watch;
use super::leg::Leg;
use super::{OVERLAP_MM, REACH_MM};

/// Lines that are worked out together.
pub(super) const LINES: usize = 64;
/// Bound on the rounding of heights as floats, in mm, and in parts of the heights.
const ROUNDED_MM: f32 = 1e-6;
const ROUNDED: f64 = 3e-7;

/// What a move leaves on the lines of samples beside it.
pub(super) struct Lines {
    /// Axis, first line and place across that `d2` and `q` are for.
    beside: Option<(usize, usize, f64)>,
    /// Squared distance from the move.
    d2: [f64; LINES],
    /// Half the chord of the cutter.
    q: [f64; LINES],
    /// Height of the straight line where the move begins.
    level: [f64; LINES],
    /// The same less its rounding, past every height for lines that are not to be cut.
    low: [f32; LINES],
    /// First and one past the last sample under the straight line, and under the cutter at the corner.
    body: [[i32; LINES]; 2],
    cap: [[i32; LINES]; 2],
    /// Rise of the straight line since the move began, by sample.
    ramp: Vec<f64>,
    ramp_low: Vec<f32>,
}

impl Lines {
    /// For a band of so many rows and columns.
    pub fn new(columns: usize, rows: usize) -> Lines {
        let along = columns.max(rows) + GROUP;
        Lines {
            beside: None,
            d2: [0.0; LINES],
            q: [0.0; LINES],
            level: [0.0; LINES],
            low: [0.0; LINES],
            body: [[0; LINES]; 2],
            cap: [[0; LINES]; 2],
            ramp: vec![0.0; along],
            ramp_low: vec![0.0; along],
        }
    }

    /// Works out `count` lines across `AXIS` from `start` on, whose places across are `at`, and gives the first and
    /// one past the last sample that any of them has under the move.
    #[inline(always)]
    fn work_out<C: Contact, const AXIS: usize>(
        &mut self,
        contact: &C,
        (leg, next): (&Leg, Option<&Leg>),
        (start, at): (usize, &[f64]),
        samples: &Samples,
    ) -> (usize, usize) {
        let n = at.len().min(LINES);
        let reach = contact.radius() + REACH_MM;
        let across_mm = leg.from[1 - AXIS];
        let (d2, q) = (&mut self.d2[..n], &mut self.q[..n]);
        if self.beside != Some((AXIS, start, across_mm)) {
            for i in 0..n {
                let d = at[i] - across_mm;
                d2[i] = d * d;
                q[i] = (reach * reach - d2[i]).max(0.0).sqrt();
            }
            self.beside = Some((AXIS, start, across_mm));
        }
        let (from, length, m) = (leg.from[AXIS], leg.length, leg.lean.m);
        let forward = leg.u[AXIS] > 0.0;
        let level = &mut self.level[..n];
        let [body_first, body_end] = &mut self.body;
        let [cap_first, cap_end] = &mut self.cap;
        let (body_first, body_end) = (&mut body_first[..n], &mut body_end[..n]);
        let (cap_first, cap_end) = (&mut cap_first[..n], &mut cap_end[..n]);
        for i in 0..n {
            let slide = contact.slide(d2[i], q[i], &leg.lean);
            level[i] = leg.from[2] + m * slide + contact.rise(d2[i] + slide * slide);
            // What the next move goes on to lower, it takes.
            let ahead = match next {
                Some(next) => -contact.slide(d2[i], q[i], &next.lean),
                None => q[i],
            };
            // Distances along the move, then coordinates along the axis, in rising order.
            let (begins, ends) = (-slide, length - slide);
            let stops = length + ahead.max(-slide);
            let (body, cap) = if forward {
                ([from + begins, from + ends], [from + ends, from + stops])
            } else {
                ([from - ends, from - begins], [from - stops, from - ends])
            };
            body_first[i] = samples.index(body[0] - OVERLAP_MM);
            body_end[i] = samples.index(body[1] + OVERLAP_MM);
            let first = samples.index(cap[0] - OVERLAP_MM);
            let end = samples.index(cap[1] + OVERLAP_MM);
            cap_first[i] = first;
            cap_end[i] = if ahead > -slide { end } else { first };
        }
        let (mut first, mut end) = (i32::MAX, 0);
        for i in 0..n {
            first = first.min(body_first[i]).min(cap_first[i]);
            end = end.max(body_end[i]).max(cap_end[i]);
        }
        (first as usize, end as usize)
    }

    /// Works out the straight line's rise at samples whose places are `at_mm`, and gives the most that it is.
    #[inline(always)]
    fn slope_along(&mut self, slope: f64, from_mm: f64, at_mm: &[f64], wanted: Range<usize>) -> f64 {
        let range = wanted.start..wanted.end.min(at_mm.len());
        let (ramp, low) = (&mut self.ramp[range.clone()], &mut self.ramp_low[range.clone()]);
        let at_mm = &at_mm[range];
        for ((ramp, low), at_mm) in ramp.iter_mut().zip(low).zip(at_mm) {
            *ramp = slope * (at_mm - from_mm);
            *low = *ramp as f32;
        }
        // Straight, so the most is at an end.
        ramp.first().map_or(0.0, |r| r.abs()).max(ramp.last().map_or(0.0, |r| r.abs()))
    }
}

/// The samples along an axis.
#[derive(Clone, Copy)]
pub(super) struct Samples {
    /// Samples per mm.
    per_mm: f64,
    /// The window's first, and how many it has.
    start: f64,
    count: f64,
}

impl Samples {
    pub(super) fn new(per_mm: f64, start: i64, count: usize) -> Samples {
        Samples { per_mm, start: start as f64, count: count.min(i32::MAX as usize) as f64 }
    }

    /// The first sample of the window at `mm` or past it. Counted from the part's corner first, so that no
    /// block sees another range.
    #[inline(always)]
    pub(super) fn index(&self, mm: f64) -> i32 {
        let at = (mm * self.per_mm - 0.5).ceil() - self.start;
        let at = if at > 0.0 { at } else { 0.0 };
        let at = if at < self.count { at } else { self.count };
        // SAFETY: a number from 0 to a count that fits.
        unsafe { at.to_int_unchecked() }
    }
}

impl Band<'_> {
    /// Cuts a move parallel to `AXIS`.
    #[inline(always)]
    pub(super) fn along<C: Contact, V: Above, const AXIS: usize>(
        &mut self,
        lines: &mut Lines,
        contact: &C,
        (leg, next): (&Leg, Option<&Leg>),
        motion: usize,
        watch: &mut Watch,
    ) {
        let across = 1 - AXIS;
        let next = next.filter(|n| {
            n.class == leg.class && n.lie == leg.lie && n.u[AXIS].signum() == leg.u[AXIS].signum()
        });
        let reach = contact.radius() + REACH_MM;
        let (first, end) = self.range(across, leg.from[across] - reach, leg.from[across] + reach);
        let samples = self.samples(AXIS);
        let mut line = first;
        while line < end {
            let count = (end - line).min(LINES);
            // Groups of lines along a row must lie in the window; those before the first that is meant are left alone.
            let start = if AXIS == 0 { line } else { line.min(self.window.columns - GROUP) };
            let meant = line - start..line - start + count;
            let at = if AXIS == 0 { &self.y_mm[start..] } else { &self.x_mm[start..] };
            let at = &at[..meant.end.next_multiple_of(GROUP)];
            let range = lines.work_out::<C, AXIS>(contact, (leg, next), (start, at), &samples);
            if range.0 < range.1 {
                if AXIS == 0 && C::FLAT && leg.lean.m == 0.0 {
                    self.level(lines, leg, start, meant, motion, watch);
                } else if AXIS == 0 {
                    self.along_x::<C, V>(lines, contact, leg, (start, meant, range), motion, watch);
                } else {
                    self.along_y::<C, V>(lines, contact, leg, (start, meant, range), motion, watch);
                }
            }
            line += count;
        }
    }

    /// A flat on a level move, lines being rows: all that it covers is cut to one height.
    #[inline(always)]
    fn level(
        &mut self,
        lines: &Lines,
        leg: &Leg,
        start: usize,
        meant: Range<usize>,
        motion: usize,
        watch: &mut Watch,
    ) {
        let new = leg.from[2] as f32;
        for i in meant {
            let first = lines.body[0][i].min(lines.cap[0][i]) as usize;
            let end = lines.body[1][i].max(lines.cap[1][i]) as usize;
            if first >= end {
                continue;
            }
            let row = start + i;
            let z_mm = &mut self.z_mm[row * self.window.columns..][first..end];
            let highest = highest(z_mm);
            if highest <= new {
                continue;
            }
            // The first of those from which the deepest layer of this row is taken.
            let depth = highest - new;
            if watch.wants(depth, motion)
                && let Some(at) = z_mm.iter().position(|z| z - new == depth)
            {
                watch.see(z_mm[at], new, motion, row, first + at);
            }
            for z in z_mm {
                *z = if new < *z { new } else { *z };
            }
        }
    }

    /// Lines are rows, looked at in groups along them.
    #[inline(always)]
    fn along_x<C: Contact, V: Above>(
        &mut self,
        lines: &mut Lines,
        contact: &C,
        leg: &Leg,
        (start, meant, (first, end)): (usize, Range<usize>, (usize, usize)),
        motion: usize,
        watch: &mut Watch,
    ) {
        let columns = self.window.columns;
        let last = columns - GROUP;
        let slope = leg.lean.m * leg.u[0].signum();
        let most = lines.slope_along(slope, leg.from[0], &self.x_mm[..columns], first.min(last)..end + GROUP);
        for i in meant {
            let [body, cap] = [&lines.body, &lines.cap].map(|[first, end]| first[i]..end[i]);
            let (first, end) = (body.start.min(cap.start) as usize, body.end.max(cap.end) as usize);
            if first >= end {
                continue;
            }
            let level = lines.level[i];
            let over = (level - ROUNDED * (level.abs() + most)) as f32 - ROUNDED_MM;
            let row = start + i;
            let z_mm = &mut self.z_mm[row * columns..][..columns];
            let mut at = first;
            while at < end {
                let column = at.min(last);
                at += GROUP;
                let Some(z) = z_mm[column..].first_chunk_mut::<GROUP>() else { break };
                let Some(low) = lines.ramp_low[column..].first_chunk::<GROUP>() else { break };
                if V::above(z, low, over) == 0 {
                    continue;
                }
                let Some(ramp) = lines.ramp[column..].first_chunk::<GROUP>() else { break };
                let Some(x_mm) = self.x_mm[column..].first_chunk::<GROUP>() else { break };
                let before = *z;
                let here = column as i32;
                V::lower(z, &V::line(level, ramp), lanes(body.start, body.end, here));
                let corner = lanes(cap.start, cap.end, here);
                if corner != 0 {
                    let mut new = [0.0; GROUP];
                    for k in 0..GROUP {
                        let w = x_mm[k] - leg.to[0];
                        new[k] = (leg.to[2] + contact.rise(lines.d2[i] + w * w)) as f32;
                    }
                    V::lower(z, &new, corner);
                }
                watch.group::<V>(&before, z, motion, (row, column), true);
            }
        }
    }

    /// Lines are columns, looked at in groups across them.
    #[inline(always)]
    fn along_y<C: Contact, V: Above>(
        &mut self,
        lines: &mut Lines,
        contact: &C,
        leg: &Leg,
        (start, meant, (first, end)): (usize, Range<usize>, (usize, usize)),
        motion: usize,
        watch: &mut Watch,
    ) {
        let columns = self.window.columns;
        let last = columns - GROUP;
        let slope = leg.lean.m * leg.u[1].signum();
        let most = lines.slope_along(slope, leg.from[1], &self.y_mm[..self.window.rows], first..end);
        for i in 0..meant.end.next_multiple_of(GROUP) {
            let level = lines.level[i];
            let low = (level - ROUNDED * (level.abs() + most)) as f32 - ROUNDED_MM;
            lines.low[i] = if meant.contains(&i) { low } else { f32::INFINITY };
        }
        for row in first..end {
            let (ramp, w) = (lines.ramp[row], self.y_mm[row] - leg.to[1]);
            let over = lines.ramp_low[row];
            let here = row as i32;
            for group in (0..meant.end).step_by(GROUP) {
                let column = (start + group).min(last);
                let at = column - start;
                let Some(z) = self.z_mm[row * columns + column..].first_chunk_mut::<GROUP>() else { break };
                let Some(low) = lines.low[at..].first_chunk::<GROUP>() else { break };
                if V::above(z, low, over) == 0 {
                    continue;
                }
                let meant = lanes(meant.start as i32, meant.end as i32, at as i32);
                let before = *z;
                let cut = |[first, end]: &[[i32; LINES]; 2]| -> u16 {
                    let ranges = (first[at..].first_chunk::<GROUP>(), end[at..].first_chunk::<GROUP>());
                    let (Some(first), Some(end)) = ranges else { return 0 };
                    V::holding(first, end, here) & meant
                };
                let Some(level) = lines.level[at..].first_chunk::<GROUP>() else { break };
                V::lower(z, &V::line(ramp, level), cut(&lines.body));
                let corner = cut(&lines.cap);
                if corner != 0 {
                    let mut new = [0.0; GROUP];
                    for (new, d2) in new.iter_mut().zip(&lines.d2[at..]) {
                        *new = (leg.to[2] + contact.rise(d2 + w * w)) as f32;
                    }
                    V::lower(z, &new, corner);
                }
                watch.group::<V>(&before, z, motion, (row, column), false);
            }
        }
    }
}
