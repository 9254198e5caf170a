//! An operation as several programs, where a cutter wears out or a controller's memory ends.

use std::borrow::Cow;

use super::writer::pass_bytes;
use super::{Dialect, Error, Program, Section};
use crate::machine::Machine;
use crate::toolpath::{Kind, Toolpath};

/// What the header of a section, and the first motion that names everything, add to its passes.
const SLACK_BYTES: u64 = 400;

/// A section and its own path.
pub type Piece<'a> = (Option<Section>, Cow<'a, Toolpath>);

/// Cuts an operation at pass starts, so that no program cuts longer than the tool's life or needs more
/// memory than the machine has. One run of passes is never cut: what alone is too long stays so.
///
/// Each section is a toolpath of its own, from the clearance plane to the clearance plane. A single one
/// has no [`Section`].
pub fn sections<'a>(
    program: &Program<'a>,
    dialect: &Dialect,
    machine: &Machine,
) -> Result<Vec<Piece<'a>>, Error> {
    let path = program.path;
    let life_mm = program.tool.tool_life_m.map(|life_m| 1e3 * life_m);
    let starts = &path.pass_starts;
    let lengths = pass_lengths(path);
    let total_mm: f64 = lengths.iter().sum();
    let memory = machine.transfer.memory_bytes;
    if starts.len() < 2 || (memory.is_none() && life_mm.is_none_or(|life_mm| total_mm <= life_mm)) {
        return Ok(vec![(None, Cow::Borrowed(path))]);
    }
    let (bytes, room) = match memory {
        None => (vec![0; starts.len()], u64::MAX),
        Some(memory) => {
            let (bytes, around) = pass_bytes(program, dialect, machine)?;
            (bytes, memory.saturating_sub(around + SLACK_BYTES))
        }
    };
    // (first pass, whether with a fresh cutter)
    let mut cuts = vec![(0, true)];
    let (mut worn_mm, mut used) = (0.0, 0);
    for (pass, length_mm) in lengths.iter().enumerate() {
        let begun = cuts.last().is_some_and(|cut| cut.0 < pass);
        let worn = worn_mm > 0.0 && life_mm.is_some_and(|life_mm| worn_mm + length_mm > life_mm);
        if begun && (worn || used + bytes[pass] > room) {
            cuts.push((pass, worn));
            used = 0;
            if worn {
                worn_mm = 0.0;
            }
        }
        worn_mm += length_mm;
        used += bytes[pass];
    }
    if cuts.len() == 1 {
        return Ok(vec![(None, Cow::Borrowed(path))]);
    }
    let count = cuts.len() as u32;
    let ends = cuts.iter().skip(1).map(|cut| cut.0).chain([starts.len()]);
    let section = |(index, (&(first, fresh_cutter), end)): (usize, (&(usize, bool), usize))| {
        let from = if index == 0 { 0 } else { starts[first] };
        let to = starts.get(end).copied().unwrap_or(path.moves.len());
        let part = Toolpath {
            unit_mm: path.unit_mm,
            moves: path.moves[from..to].to_vec(),
            pass_starts: starts[first..end].iter().map(|start| start - from).collect(),
            // Of the whole operation: said once.
            tilt: path.tilt.filter(|_| index == 0),
        };
        (Some(Section { index: index as u32 + 1, count, fresh_cutter }), Cow::Owned(part))
    };
    Ok(cuts.iter().zip(ends).enumerate().map(section).collect())
}

/// How far the cutter cuts from each pass start to the next, in mm.
fn pass_lengths(path: &Toolpath) -> Vec<f64> {
    let mut lengths = vec![0.0; path.pass_starts.len()];
    let mut starts = path.pass_starts.iter().peekable();
    let (mut pass, mut at) = (0usize, None);
    for (index, one) in path.moves.iter().enumerate() {
        if starts.next_if(|start| **start == index).is_some() {
            pass += 1;
        }
        if let Some(from) = at.replace(one.to)
            && one.kind != Kind::Rapid
            && pass > 0
        {
            let from: [i32; 3] = from;
            let square: f64 =
                (0..3).map(|axis| f64::from(one.to[axis]) - f64::from(from[axis])).map(|d| d * d).sum();
            lengths[pass - 1] += path.unit_mm * square.sqrt();
        }
    }
    lengths
}
