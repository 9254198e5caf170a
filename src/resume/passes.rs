use std::collections::BTreeMap;

use crate::verify::{Reading, lines};

/// Heights closer than this are one plane, in mm.
const SAME_MM: f64 = 1e-6;

/// A place where a program can begin again: just before the cutter leaves the plane of its travels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pass {
    pub number: u64,
    /// Line of the descent.
    pub line: u32,
    /// Index of the first motion of that line.
    pub motion: usize,
    /// Where the cutter stands before that line.
    pub before_mm: [f64; 3],
}

/// The passes of a text in order.
pub(super) fn passes(text: &[u8], reading: &Reading) -> Vec<Pass> {
    let motions = &reading.motions;
    let Some(plane_mm) = plane_mm(reading) else { return Vec::new() };
    let mut descents = Vec::new();
    for (index, pair) in motions.windows(2).enumerate() {
        let (from, to) = (&pair[0], &pair[1]);
        let down = from.known() && to.known() && from.to_mm[2] >= plane_mm - SAME_MM;
        if down && to.to_mm[2] < plane_mm - SAME_MM {
            let motion = (0..=index + 1).rev().take_while(|&i| motions[i].line == to.line).last();
            let motion = motion.unwrap_or(index + 1);
            let before_mm = motion.checked_sub(1).map_or([f64::NAN; 3], |i| motions[i].to_mm);
            descents.push(Pass { number: descents.len() as u64 + 1, line: to.line, motion, before_mm });
        }
    }
    let marks = marks(text);
    if marks.is_empty() {
        return descents;
    }
    let ends = marks.iter().skip(1).map(|mark| mark.1).chain([u32::MAX]);
    let marked = marks.iter().zip(ends).filter_map(|(&(number, line), end)| {
        let inside = |pass: &&Pass| pass.line > line && pass.line < end;
        descents.iter().find(inside).map(|pass| Pass { number, ..*pass })
    });
    marked.collect()
}

/// The highest plane on which the program travels more than once; the only one if there is but one.
fn plane_mm(reading: &Reading) -> Option<f64> {
    let travel = reading.travel();
    let mut planes: BTreeMap<i64, (f64, usize)> = BTreeMap::new();
    for pair in reading.motions.windows(2) {
        let (from, to) = (pair[0].to_mm, pair[1].to_mm);
        let lateral = from[0] != to[0] || from[1] != to[1];
        if pair[0].known()
            && pair[1].known()
            && lateral
            && travel.holds(from, &pair[1])
            && (from[2] - to[2]).abs() < SAME_MM
        {
            planes.entry((to[2] / SAME_MM).round() as i64).or_insert((to[2], 0)).1 += 1;
        }
    }
    let often = planes.values().rev().find(|plane| plane.1 > 1).or(planes.values().next_back());
    let first = || reading.motions.iter().find(|motion| motion.known()).map(|motion| motion.to_mm[2]);
    often.map(|plane| plane.0).or_else(first)
}

/// Numbers and lines of the comments that mark passes.
fn marks(text: &[u8]) -> Vec<(u64, u32)> {
    let mut marks = Vec::new();
    for (index, line) in lines(text).into_iter().enumerate() {
        let line = line.trim_ascii();
        let inner = line.strip_prefix(b"(").and_then(|rest| rest.strip_suffix(b")"));
        let Some(inner) = inner.or(line.strip_prefix(b";")) else { continue };
        let words: Vec<&[u8]> = inner.trim_ascii().split(|byte| *byte == b' ').collect();
        if let [pass, number] = words[..]
            && pass.eq_ignore_ascii_case(b"pass")
            && let Ok(number) = String::from_utf8_lossy(number).parse()
        {
            marks.push((number, index as u32 + 1));
        }
    }
    marks
}

/// Whether a text marks its passes.
pub(super) fn marked(text: &[u8]) -> bool {
    !marks(text).is_empty()
}
