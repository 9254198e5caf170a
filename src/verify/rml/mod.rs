//! An interpreter of RML-1 after Roland's "RML-1 Programing Guideline" (2002), for three axes.
//!
//! Mode 1 (one letter, `^` before a mode 2 command), mode 2 (two letters) and the common `!`
//! commands are read; a text keeps to the mode it began in, since EGX-300 class machines have one. An
//! out-of-range value is refused, where the machine would clamp it.

mod scanner;

use std::io::BufRead;

use scanner::{Command, Number, Scanner};

use super::error::{Error, Place};
use super::reading::{Event, Language, Motion, Note, Options, Summary};

/// The range of RML-1's float parameter.
const LOWEST: f64 = -8_388_608.0;
const HIGHEST: f64 = 8_388_607.0;

type Sink<'a> = dyn FnMut(&Event) -> Result<(), Error> + 'a;

/// Reads RML-1 command by command.
pub(super) fn read(source: &mut dyn BufRead, options: &Options, each: &mut Sink) -> Result<Summary, Error> {
    let mut scanner = Scanner::new(source);
    scanner.advance()?;
    let mut machine = Machine {
        unit_mm: options.rml_unit_mm,
        at_mm: [f64::NAN; 3],
        relative: false,
        speed_3d_mm_s: None,
        speed_down_mm_s: None,
        down_units: 0.0,
        up_units: None,
        dwell_ms: 0.0,
        turns: false,
        began: None,
    };
    let mut summary = Summary { language: Language::Rml1, blocks: 0, bytes: 0, notes: Vec::new() };
    let mut numbers = Vec::new();
    let mut last = None;
    while let Some((command, at)) = scanner.command(&mut numbers)? {
        summary.blocks += 1;
        last = Some(at);
        machine.run(command, &numbers, at, each)?;
    }
    summary.bytes = scanner.bytes;
    if machine.turns {
        let line = last.and_then(|at: Place| u32::try_from(at.line).ok()).unwrap_or(u32::MAX);
        summary.notes.push(Note::SpindleOn { line });
    }
    if summary.blocks == 0 {
        return Err(Error::Empty);
    }
    Ok(summary)
}

struct Machine {
    unit_mm: f64,
    at_mm: [f64; 3],
    relative: bool,
    /// V, !VZ.
    speed_3d_mm_s: Option<f64>,
    /// F, VS.
    speed_down_mm_s: Option<f64>,
    /// !PZ, @: the tool's two heights; the upper is unknown until named.
    down_units: f64,
    up_units: Option<f64>,
    dwell_ms: f64,
    /// Whether !MC has the spindle turn.
    turns: bool,
    began: Option<u8>,
}

fn ranged(number: Number, what: &'static str, low: f64, high: f64) -> Result<f64, Error> {
    if (low..=high).contains(&number.value) {
        Ok(number.value)
    } else {
        Err(Error::Range { at: number.at, what, value: number.value, low, high })
    }
}

fn coordinate(number: Number) -> Result<f64, Error> {
    let value = ranged(number, "the coordinate in units", LOWEST, HIGHEST)?;
    // Whole within the range, which is less than 32 bits hold.
    if f64::from(value as i32) == value { Ok(value) } else { Err(Error::Fraction { at: number.at, value }) }
}

impl Machine {
    fn run(&mut self, command: Command, numbers: &[Number], at: Place, each: &mut Sink) -> Result<(), Error> {
        let name = command.name;
        if command.mode != 0 {
            let began = *self.began.get_or_insert(command.mode);
            if began != command.mode {
                let hint = if began == 1 {
                    format!("in mode 1 write ^{name} for a mode 2 command")
                } else {
                    "stay in mode 2".to_string()
                };
                return Err(Error::Mode { at, command: name, mode: command.mode, began, hint });
            }
        }
        let count = |allowed: fn(usize) -> bool, wanted: &'static str| {
            if allowed(numbers.len()) {
                Ok(())
            } else {
                Err(Error::Count { at, command: name, found: numbers.len(), wanted })
            }
        };
        let line = u32::try_from(at.line).unwrap_or(u32::MAX);
        match name {
            "DF" | "IN" => {
                count(|n| n == 0, "none")?;
                self.relative = false;
                self.speed_3d_mm_s = None;
                self.speed_down_mm_s = None;
                (self.down_units, self.up_units) = (0.0, None);
                self.dwell_ms = 0.0;
                self.turns = false;
                if name == "IN" {
                    self.at_mm = [f64::NAN; 3];
                }
            }
            "PA" | "PR" => {
                count(|n| n % 2 == 0, "pairs of x, y")?;
                self.relative = name == "PR";
                if !numbers.is_empty() {
                    // The tool's state decides how a bare PA moves, and the text may not tell it.
                    return Err(Error::Unread {
                        at,
                        code: "PA x,y",
                        what: "a move in the tool's last state",
                        hint: "write PU or PD with the coordinates",
                    });
                }
            }
            "V" | "!VZ" | "F" | "VS" => {
                count(|n| n == 1, "one speed in mm/s")?;
                let speed = Some(ranged(numbers[0], "the speed in mm/s", 0.1, 1000.0)?);
                if matches!(name, "V" | "!VZ") {
                    self.speed_3d_mm_s = speed;
                } else {
                    self.speed_down_mm_s = speed;
                }
            }
            "W" | "!DW" => {
                count(|n| n <= 1, "one time in ms")?;
                self.dwell_ms =
                    numbers.first().map_or(Ok(0.0), |n| ranged(*n, "the dwell in ms", 0.0, 32_767.0))?;
            }
            "!MC" => {
                count(|n| n <= 1, "one switch")?;
                for number in numbers {
                    ranged(*number, "the switch", -32_768.0, 32_767.0)?;
                }
                self.turns = numbers.first().is_none_or(|number| number.value != 0.0);
            }
            "!RC" => {
                count(|n| n == 1, "one speed code")?;
                let Number { value, at } = numbers[0];
                if !((0.0..=15.0).contains(&value) || (100.0..=32_767.0).contains(&value)) {
                    return Err(Error::SpeedCode { at, value });
                }
            }
            "J" => {
                count(|n| n == 1, "one tool number")?;
                each(&Event::Pause { line })?;
            }
            "!NR" => {
                count(|n| n == 0, "none")?;
                each(&Event::Pause { line })?;
            }
            "!PZ" | "@" => {
                count(|n| n == 1 || n == 2, "one or two heights")?;
                self.down_units = coordinate(numbers[0])?;
                if let Some(up) = numbers.get(1) {
                    self.up_units = Some(coordinate(*up)?);
                }
            }
            "H" => {
                count(|n| n == 0, "none")?;
                self.turns = false;
                // To the top, then to the origin: where the top is, only the machine knows.
                let up = [self.at_mm[0], self.at_mm[1], f64::NAN];
                self.go(up, f64::INFINITY, line, each)?;
                self.at_mm = [f64::NAN; 3];
            }
            "!ZM" => {
                count(|n| n == 1, "one z")?;
                let speed = self.speed(true, at, name)?;
                let to = [self.at_mm[0], self.at_mm[1], self.axis(2, coordinate(numbers[0])?)];
                self.go(to, speed, line, each)?;
            }
            "Z" | "!ZZ" => {
                count(|n| n > 0 && n.is_multiple_of(3), "triples of x, y, z")?;
                let speed = self.speed(true, at, name)?;
                for point in numbers.chunks_exact(3) {
                    let to = [
                        self.axis(0, coordinate(point[0])?),
                        self.axis(1, coordinate(point[1])?),
                        self.axis(2, coordinate(point[2])?),
                    ];
                    self.cut(to, speed, line, at, each)?;
                }
            }
            "PU" | "M" | "R" => {
                count(|n| n.is_multiple_of(2), "pairs of x, y")?;
                let up = self.up_units.map_or(f64::NAN, |z| z * self.unit_mm);
                self.go([self.at_mm[0], self.at_mm[1], up], f64::INFINITY, line, each)?;
                for point in numbers.chunks_exact(2) {
                    let to = self.flat(point, name, up)?;
                    self.go(to, f64::INFINITY, line, each)?;
                }
            }
            "PD" | "D" | "I" => {
                count(|n| n.is_multiple_of(2), "pairs of x, y")?;
                let down = self.down_units * self.unit_mm;
                let plunge = self.speed(true, at, name)?;
                self.cut([self.at_mm[0], self.at_mm[1], down], plunge, line, at, each)?;
                if !numbers.is_empty() {
                    let speed = self.speed(false, at, name)?;
                    for point in numbers.chunks_exact(2) {
                        let to = self.flat(point, name, down)?;
                        self.cut(to, speed, line, at, each)?;
                    }
                }
            }
            "!ZO" => {
                return Err(Error::Unread {
                    at,
                    code: "!ZO",
                    what: "a new Z origin",
                    hint: "set the origin on the machine",
                });
            }
            _ => {
                return Err(Error::Unread {
                    at,
                    code: "!ZE",
                    what: "a move by lettered axes",
                    hint: "write it with Z or !ZZ",
                });
            }
        }
        Ok(())
    }

    fn speed(&self, three_axes: bool, at: Place, command: &'static str) -> Result<f64, Error> {
        let (value, speed) =
            if three_axes { (self.speed_3d_mm_s, "V or !VZ") } else { (self.speed_down_mm_s, "F or VS") };
        value.map(|mm_s| 60.0 * mm_s).ok_or(Error::Speed { at, command, speed })
    }

    /// Units to mm. A whole number of hundredths divided by 100 is the nearest double to what the
    /// same point says in G-code.
    fn axis(&self, axis: usize, units: f64) -> f64 {
        let mm = self.mm(units);
        if self.relative { self.at_mm[axis] + mm } else { mm }
    }

    fn mm(&self, units: f64) -> f64 {
        if self.unit_mm == 0.01 { units / 100.0 } else { units * self.unit_mm }
    }

    fn flat(&self, point: &[Number], name: &str, z_mm: f64) -> Result<[f64; 3], Error> {
        let units = [coordinate(point[0])?, coordinate(point[1])?];
        let relative = match name {
            "M" | "D" => false,
            "R" | "I" => true,
            _ => self.relative,
        };
        let at = |axis: usize| {
            let mm = self.mm(units[axis]);
            if relative { self.at_mm[axis] + mm } else { mm }
        };
        Ok([at(0), at(1), z_mm])
    }

    fn cut(&mut self, to: [f64; 3], speed: f64, line: u32, at: Place, each: &mut Sink) -> Result<(), Error> {
        if to.iter().any(|v| v.is_nan()) {
            return Err(Error::Nowhere { at, axes: "an axis" });
        }
        self.go(to, speed, line, each)
    }

    /// The modal dwell comes before every motion.
    fn go(&mut self, to_mm: [f64; 3], speed_mm_min: f64, line: u32, each: &mut Sink) -> Result<(), Error> {
        if self.dwell_ms > 0.0 {
            each(&Event::Dwell { seconds: 1e-3 * self.dwell_ms, line })?;
        }
        self.at_mm = to_mm;
        each(&Event::Move(Motion { to_mm, feed_mm_min: speed_mm_min as f32, line }))
    }
}
