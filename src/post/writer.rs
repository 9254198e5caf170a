use std::io::{Seek, SeekFrom, Write};

use sha2::{Digest, Sha256};

use super::block::Facts;
use super::dialect::{Dialect, FeedUnit, Number, Place, When};
use super::number;
use super::{Error, Program, header};
use crate::catalogue;
use crate::machine::{Bounds, Machine, SpindleSetting};
use crate::toolpath::{GridPoint, Kind, Move};

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    pub bytes: u64,
    pub lines: u64,
    /// Of everything after the header; of everything where there is none. In hexadecimal.
    pub sha256: String,
    /// Byte at which [`stamp_time`] fills the header's time in; None where there is no header.
    pub time_at: Option<u64>,
    /// Of the toolpath's moves, in the program's frame.
    pub bounds: Bounds,
    pub spindle: SpindleSetting,
}

/// Writes the text of a program. What is refused is refused before the first byte.
///
/// Nothing is rounded here: coordinates are whole units of the grid already, feeds are cut off to
/// the decimals of the dialect so that none is faster than asked for.
pub fn write(
    program: &Program,
    dialect: &Dialect,
    machine: &Machine,
    out: &mut dyn Write,
) -> Result<Written, Error> {
    let plan = Plan::new(program, dialect, machine)?;
    let mut lead = Sink::new(None, dialect);
    plan.block(&dialect.block.lead, &mut lead)?;
    let mut dry = Sink::new(None, dialect);
    plan.body(&mut dry)?;
    dry.flush()?;
    let sha256: String = dry.hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    let header = header::header(program, dialect, machine, &plan.bounds, &sha256);
    for line in &header.lines {
        dialect.check_line(line.as_bytes()).map_err(|message| plan.line_error(message))?;
    }
    lead.flush()?;
    let ending = dialect.line_ending.bytes().len() as u64;
    let above: u64 = header.lines.iter().map(|line| line.len() as u64 + ending).sum();
    let (bytes, most) = (lead.bytes + above + dry.bytes, machine.transfer.memory_bytes);
    if let Some(memory_bytes) = most.filter(|most| bytes > *most) {
        return Err(Error::Memory { bytes, machine: machine.name.clone(), memory_bytes });
    }
    let mut sink = Sink::new(Some(out), dialect);
    plan.block(&dialect.block.lead, &mut sink)?;
    let mut time_at = None;
    for (index, line) in header.lines.iter().enumerate() {
        if let Some((_, byte)) = header.time_at.filter(|at| at.0 == index) {
            time_at = Some(sink.bytes + (sink.buffer.len() + byte) as u64);
        }
        sink.line.extend_from_slice(line.as_bytes());
        sink.end_line(&plan)?;
    }
    plan.body(&mut sink)?;
    sink.flush()?;
    let Sink { bytes, lines, .. } = sink;
    Ok(Written { bytes, lines, sha256, time_at, bounds: plan.bounds, spindle: plan.spindle })
}

/// Fills the time that a program takes into its header.
pub fn stamp_time<W: Write + Seek>(
    file: &mut W,
    written: &Written,
    dialect: &Dialect,
    seconds: f64,
) -> Result<(), Error> {
    if let (Some(at), Some(comment)) = (written.time_at, &dialect.comment) {
        file.seek(SeekFrom::Start(at))?;
        file.write_all(header::time(comment, dialect, Some(seconds)).as_bytes())?;
    }
    Ok(())
}

/// Bytes of each pass of a program, from one pass start to the next, and of all around them.
pub(super) fn pass_bytes(
    program: &Program,
    dialect: &Dialect,
    machine: &Machine,
) -> Result<(Vec<u64>, u64), Error> {
    let plan = Plan::new(program, dialect, machine)?;
    let mut sink = Sink::new(None, dialect);
    let mut starts = Vec::with_capacity(program.path.pass_starts.len());
    plan.moves(&mut sink, &mut |at| starts.push(at))?;
    sink.flush()?;
    let passes = starts.windows(2).map(|pair| pair[1] - pair[0]);
    let passes: Vec<u64> = passes.chain(starts.last().map(|last| sink.bytes - last)).collect();
    let mut around = Sink::new(None, dialect);
    plan.block(&dialect.block.lead, &mut around)?;
    plan.block(&dialect.block.start, &mut around)?;
    plan.block(&dialect.block.arrived, &mut around)?;
    plan.block(&dialect.block.end, &mut around)?;
    for line in header::header(program, dialect, machine, &plan.bounds, &"0".repeat(64)).lines {
        around.line.extend_from_slice(line.as_bytes());
        around.end_line(&plan)?;
    }
    around.flush()?;
    Ok((passes, around.bytes))
}

/// A program that has passed all checks.
struct Plan<'a> {
    program: &'a Program<'a>,
    dialect: &'a Dialect,
    facts: Facts,
    spindle: SpindleSetting,
    bounds: Bounds,
    clearance: i32,
    /// Feed numbers in their last decimal.
    cut: i64,
    plunge: i64,
    rapid_xy: i64,
    rapid_z: i64,
    steps: [i64; 3],
}

impl<'a> Plan<'a> {
    fn new(program: &'a Program, dialect: &'a Dialect, machine: &Machine) -> Result<Plan<'a>, Error> {
        let tool = program.tool;
        let spindle = machine.run(tool)?;
        let unit_mm = dialect.unit_mm;
        if program.path.unit_mm != unit_mm {
            return Err(Error::Grid {
                unit_mm: program.path.unit_mm,
                dialect: dialect.name.clone(),
                dialect_unit_mm: unit_mm,
            });
        }
        if !dialect.wcs.is_empty() && !dialect.wcs.iter().any(|known| known == program.wcs) {
            let known: Vec<&str> = dialect.wcs.iter().map(String::as_str).collect();
            let hint = catalogue::nearest(program.wcs, &known);
            return Err(Error::Wcs {
                wcs: program.wcs.escape_debug().to_string(),
                dialect: dialect.name.clone(),
                hint,
            });
        }
        if machine.spindle.spin_up_s > dialect.limits.dwell_max_s {
            return Err(Error::Dwell {
                machine: machine.name.clone(),
                spin_up_s: machine.spindle.spin_up_s,
                dialect: dialect.name.clone(),
                limit_s: dialect.limits.dwell_max_s,
            });
        }
        let clearance_mm = program.clearance_mm;
        let stock_top_mm = program.stock_top_mm();
        if !(clearance_mm > stock_top_mm && clearance_mm < 10_000.0) {
            return Err(Error::Clearance { clearance_mm, stock_top_mm });
        }
        // The plane itself may lie between two units; what is written is never below it.
        let clearance = (clearance_mm / unit_mm - 1e-6).ceil() as i32;
        let bounds = check_moves(program, dialect, clearance)?;
        let word = &dialect.word;
        let mut steps = [1; 3];
        for (step, number) in steps.iter_mut().zip([&word.x, &word.y, &word.z]) {
            *step = number::decimal_steps(number, unit_mm).ok_or(Error::Grid {
                unit_mm,
                dialect: dialect.name.clone(),
                dialect_unit_mm: unit_mm,
            })?;
        }
        let feed = |mm_min: f64| feed_count(mm_min, dialect);
        let rapid_xy = feed(machine.rate.rapid_xy_mm_min)?;
        let rapid_z = feed(machine.rate.rapid_z_mm_min)?;
        let mut plan = Plan {
            program,
            dialect,
            facts: Facts::default(),
            spindle,
            bounds,
            clearance,
            cut: feed(tool.feed_mm_min)?,
            plunge: feed(tool.plunge_mm_min)?,
            rapid_xy,
            rapid_z,
            steps,
        };
        let first = program.path.moves[0].to;
        let coordinate = |axis: usize, value: i32| {
            let mut text = Vec::new();
            plan.push_coordinate(&mut text, axis, value);
            String::from_utf8_lossy(&text).into_owned()
        };
        let grid = |mm: f64| (mm / unit_mm).round() as i32;
        let spell = |count: i64| number::number(count, word.feed.decimals, word.feed.point);
        plan.facts = Facts {
            wcs: program.wcs.into(),
            clearance: coordinate(2, clearance),
            first: [coordinate(0, first[0]), coordinate(1, first[1]), coordinate(2, first[2])],
            park: [coordinate(0, grid(bounds.low_mm[0])), coordinate(1, grid(bounds.high_mm[1]))],
            rpm: tool.spindle_rpm.round() as i64,
            code: spindle.code,
            by_hand: spindle.by_hand,
            spindle: program.spindle,
            spin_up_ms: (machine.spindle.spin_up_s * 1000.0).round() as i64,
            rapid_xy: spell(rapid_xy),
            rapid_z: spell(rapid_z),
            tool_changer: machine.tool_changer,
            tool_number: tool.number.unwrap_or(1),
            coolant: dialect.coolant(machine).filter(|_| program.spindle),
            program_number: program.number,
        };
        Ok(plan)
    }

    fn number(&self, axis: usize) -> &Number {
        let word = &self.dialect.word;
        [&word.x, &word.y, &word.z][axis]
    }

    fn push_coordinate(&self, line: &mut Vec<u8>, axis: usize, value: i32) {
        let word = self.number(axis);
        number::push_number(line, i64::from(value) * self.steps[axis], word.decimals, word.point);
    }

    fn line_error(&self, message: String) -> Error {
        Error::Line { dialect: self.dialect.name.clone(), message }
    }

    fn block(&self, template: &str, sink: &mut Sink) -> Result<(), Error> {
        let lines = self.facts.spell(template, self.dialect).map_err(|message| self.line_error(message))?;
        for line in lines {
            sink.line.extend_from_slice(line.as_bytes());
            sink.end_line(self)?;
        }
        Ok(())
    }

    fn body(&self, sink: &mut Sink) -> Result<(), Error> {
        self.block(&self.dialect.block.start, sink)?;
        self.moves(sink, &mut |_| ())?;
        if let (Some(section), Some(comment)) = (self.program.section, &self.dialect.comment) {
            let text = format!("section {} of {} ends here", section.index, section.count);
            sink.line.extend_from_slice(comment.line(&text, &self.dialect.limits).as_bytes());
            sink.end_line(self)?;
        }
        self.block(&self.dialect.block.end, sink)
    }

    /// The motions with a mark at each pass start; `passed` is told the byte of each.
    fn moves(&self, sink: &mut Sink, passed: &mut dyn FnMut(u64)) -> Result<(), Error> {
        let path = self.program.path;
        let mut modal = Modal::default();
        let mut starts = path.pass_starts.iter().peekable();
        let mut pass = 0;
        for (index, one) in path.moves.iter().enumerate() {
            if starts.next_if(|start| **start == index).is_some() {
                passed(sink.bytes + sink.buffer.len() as u64);
                pass += 1;
                if let Some(comment) = &self.dialect.comment {
                    let mark = comment.line(&format!("pass {pass}"), &self.dialect.limits);
                    sink.line.extend_from_slice(mark.as_bytes());
                    sink.end_line(self)?;
                }
            }
            self.motion(one, &mut modal, sink)?;
            if index == 0 {
                self.block(&self.dialect.block.arrived, sink)?;
            }
        }
        let last = path.moves[path.moves.len() - 1].to;
        if last[2] < self.clearance {
            let lift = Move { kind: Kind::Rapid, to: [last[0], last[1], self.clearance] };
            self.motion(&lift, &mut modal, sink)?;
        }
        Ok(())
    }

    fn motion(&self, one: &Move, modal: &mut Modal, sink: &mut Sink) -> Result<(), Error> {
        let changed = |axis: usize| modal.at.is_none_or(|at| at[axis] != one.to[axis]);
        let changed = [changed(0), changed(1), changed(2)];
        if changed == [false; 3] {
            return Ok(());
        }
        let word = &self.dialect.word;
        let rapid = one.kind == Kind::Rapid;
        let feed = match one.kind {
            Kind::Rapid if !word.feed.rapids => None,
            Kind::Rapid if changed[2] => Some(self.rapid_z.min(self.rapid_xy)),
            Kind::Rapid => Some(self.rapid_xy),
            Kind::Plunge => Some(self.plunge),
            Kind::Cut => Some(self.cut),
        };
        let feed = feed.filter(|_| word.feed.when == When::Always || modal.feed != feed);
        if let (Some(count), Place::OwnLine) = (feed, word.feed.place) {
            self.push_feed(&mut sink.line, count);
            sink.end_line(self)?;
        }
        let motion = if rapid { &word.rapid } else { &word.cut };
        if motion.when == When::Always || modal.rapid != Some(rapid) {
            sink.line.extend_from_slice(motion.letter.as_bytes());
            sink.separate(self);
        }
        for (axis, changed) in changed.into_iter().enumerate() {
            let number = self.number(axis);
            if changed || number.when == When::Always {
                sink.line.extend_from_slice(number.letter.as_bytes());
                self.push_coordinate(&mut sink.line, axis, one.to[axis]);
                sink.separate(self);
            }
        }
        if let (Some(count), Place::Line) = (feed, word.feed.place) {
            self.push_feed(&mut sink.line, count);
            sink.separate(self);
        }
        let length = sink.line.len() - self.dialect.separator.len();
        sink.line.truncate(length);
        sink.end_line(self)?;
        modal.at = Some(one.to);
        modal.rapid = Some(rapid);
        modal.feed = feed.or(modal.feed);
        Ok(())
    }

    fn push_feed(&self, line: &mut Vec<u8>, count: i64) {
        let word = &self.dialect.word.feed;
        line.extend_from_slice(word.letter.as_bytes());
        number::push_number(line, count, word.decimals, word.point);
    }
}

/// What the controller remembers from the lines before. The blocks' own words are not read, so
/// nothing is known after them: the first motion names everything.
#[derive(Default)]
struct Modal {
    at: Option<GridPoint>,
    rapid: Option<bool>,
    feed: Option<i64>,
}

fn check_moves(program: &Program, dialect: &Dialect, clearance: i32) -> Result<Bounds, Error> {
    let unit_mm = dialect.unit_mm;
    let moves = &program.path.moves;
    let Some(first) = moves.first() else { return Err(Error::Empty) };
    if first.kind != Kind::Rapid || first.to[2] < clearance {
        let z_mm = f64::from(first.to[2]) * unit_mm;
        return Err(Error::Start { z_mm, clearance_mm: program.clearance_mm });
    }
    let stock_top_mm = program.stock_top_mm();
    let stock_top = (stock_top_mm / unit_mm - 1e-6).ceil() as i32;
    let (mut low, mut high) = (first.to, first.to);
    let mut at = first.to;
    for (index, one) in moves.iter().enumerate() {
        let lateral = at[0] != one.to[0] || at[1] != one.to[1];
        let lower = at[2].min(one.to[2]);
        if one.kind == Kind::Rapid && lateral && lower < stock_top {
            return Err(Error::RapidInStock { index, z_mm: f64::from(lower) * unit_mm, stock_top_mm });
        }
        for axis in 0..3 {
            low[axis] = low[axis].min(one.to[axis]);
            high[axis] = high[axis].max(one.to[axis]);
        }
        at = one.to;
    }
    for (axis, name) in ["X", "Y", "Z"].into_iter().enumerate() {
        for value in [low[axis], high[axis]] {
            if i64::from(value).abs() > dialect.limits.value_max {
                return Err(Error::Value {
                    axis: name,
                    value_mm: f64::from(value) * unit_mm,
                    dialect: dialect.name.clone(),
                    limit_mm: dialect.limits.value_max as f64 * unit_mm,
                });
            }
        }
    }
    let mm = |point: GridPoint| point.map(|value| f64::from(value) * unit_mm);
    Ok(Bounds { low_mm: mm(low), high_mm: mm(high) })
}

/// A feed in last decimals of the dialect's feed word, cut off.
fn feed_count(mm_min: f64, dialect: &Dialect) -> Result<i64, Error> {
    let word = &dialect.word.feed;
    let minute = match word.unit {
        FeedUnit::MmMin => 1,
        FeedUnit::MmS => 60,
    };
    // In whole millionths of a mm/min, so that 5.3 mm/s given as 318 mm/min stays 5.3.
    let micro = (mm_min * 1e6).round() as i64;
    let scale = 10i64.pow(word.decimals);
    let count = (i128::from(micro) * i128::from(scale) / (minute * 1_000_000)) as i64;
    if count > 0 {
        return Ok(count);
    }
    let least_mm_min = minute as f64 / scale as f64;
    Err(Error::Feed { feed_mm_min: mm_min, dialect: dialect.name.clone(), least_mm_min })
}

/// Lines on their way out, or only counted and hashed.
struct Sink<'a> {
    out: Option<&'a mut dyn Write>,
    line: Vec<u8>,
    buffer: Vec<u8>,
    ending: &'static [u8],
    hash: Sha256,
    bytes: u64,
    lines: u64,
}

const BUFFER_BYTES: usize = 1 << 16;

impl<'a> Sink<'a> {
    fn new(out: Option<&'a mut dyn Write>, dialect: &Dialect) -> Sink<'a> {
        Sink {
            out,
            line: Vec::with_capacity(256),
            buffer: Vec::with_capacity(BUFFER_BYTES + 1024),
            ending: dialect.line_ending.bytes(),
            hash: Sha256::new(),
            bytes: 0,
            lines: 0,
        }
    }

    fn separate(&mut self, plan: &Plan) {
        self.line.extend_from_slice(plan.dialect.separator.as_bytes());
    }

    fn end_line(&mut self, plan: &Plan) -> Result<(), Error> {
        plan.dialect.check_line(&self.line).map_err(|message| plan.line_error(message))?;
        self.buffer.extend_from_slice(&self.line);
        self.buffer.extend_from_slice(self.ending);
        self.lines += 1;
        self.line.clear();
        if self.buffer.len() >= BUFFER_BYTES { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), Error> {
        self.bytes += self.buffer.len() as u64;
        match &mut self.out {
            Some(out) => out.write_all(&self.buffer)?,
            None => self.hash.update(&self.buffer),
        }
        self.buffer.clear();
        Ok(())
    }
}
