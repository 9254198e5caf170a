use std::io::Write;

use sha2::{Digest, Sha256};

use super::dialect::{self, Dialect, Facts, FeedUnit, Number, Place, When};
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
    let header = header::lines(program, dialect, machine, &plan.bounds, &sha256);
    for line in &header {
        dialect.check_line(line.as_bytes()).map_err(|message| plan.line_error(message))?;
    }
    let mut sink = Sink::new(Some(out), dialect);
    plan.block(&dialect.block.lead, &mut sink)?;
    for line in &header {
        sink.line.extend_from_slice(line.as_bytes());
        sink.end_line(&plan)?;
    }
    plan.body(&mut sink)?;
    sink.flush()?;
    Ok(Written { bytes: sink.bytes, lines: sink.lines, sha256, bounds: plan.bounds, spindle: plan.spindle })
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
            *step = dialect::decimal_steps(number, unit_mm).ok_or(Error::Grid {
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
        let spell = |count: i64| dialect::number(count, word.feed.decimals, word.feed.point);
        plan.facts = Facts {
            wcs: program.wcs.into(),
            clearance: coordinate(2, clearance),
            first: [coordinate(0, first[0]), coordinate(1, first[1]), coordinate(2, first[2])],
            rpm: spindle.rpm.round() as i64,
            code: spindle.code,
            by_hand: spindle.by_hand,
            spin_up_ms: (machine.spindle.spin_up_s * 1000.0).round() as i64,
            rapid_xy: spell(rapid_xy),
            rapid_z: spell(rapid_z),
            tool_changer: machine.tool_changer,
            tool_number: tool.number.unwrap_or(1),
        };
        Ok(plan)
    }

    fn number(&self, axis: usize) -> &Number {
        let word = &self.dialect.word;
        [&word.x, &word.y, &word.z][axis]
    }

    fn push_coordinate(&self, line: &mut Vec<u8>, axis: usize, value: i32) {
        let word = self.number(axis);
        dialect::push_number(line, i64::from(value) * self.steps[axis], word.decimals, word.point);
    }

    fn line_error(&self, message: String) -> Error {
        Error::Line { dialect: self.dialect.name.clone(), message }
    }

    fn block(&self, template: &str, sink: &mut Sink) -> Result<(), Error> {
        let lines = self.dialect.spell(template, &self.facts).map_err(|message| self.line_error(message))?;
        for line in lines {
            sink.line.extend_from_slice(line.as_bytes());
            sink.end_line(self)?;
        }
        Ok(())
    }

    fn body(&self, sink: &mut Sink) -> Result<(), Error> {
        let moves = &self.program.path.moves;
        let mut modal = Modal::default();
        self.block(&self.dialect.block.start, sink)?;
        self.motion(&moves[0], &mut modal, sink)?;
        self.block(&self.dialect.block.arrived, sink)?;
        for one in &moves[1..] {
            self.motion(one, &mut modal, sink)?;
        }
        let last = moves[moves.len() - 1].to;
        if last[2] < self.clearance {
            let lift = Move { kind: Kind::Rapid, to: [last[0], last[1], self.clearance] };
            self.motion(&lift, &mut modal, sink)?;
        }
        self.block(&self.dialect.block.end, sink)
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
        dialect::push_number(line, count, word.decimals, word.point);
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
