use std::path::Path;

use minijinja::{Environment, UndefinedBehavior, Value, context};
use serde::{Deserialize, Serialize};

use super::Error;
use crate::catalogue::{self, Kind};
use crate::settings::Source;

/// How a controller wants its programs spelled: a word table for the motions and blocks of pure
/// spelling around them, with the controller's hard limits. All of it comes from posts/*.toml.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Dialect {
    pub schema: u32,
    pub name: String,
    pub title: String,
    /// Of program files, without the point.
    pub extension: String,
    /// The smallest step a coordinate can name. Toolpaths are laid on this grid.
    pub unit_mm: f64,
    /// How far the controller may leave the path at corners; the program states it.
    pub path_tolerance_mm: f64,
    /// How far the controller may leave the path to merge blocks.
    pub merge_tolerance_mm: f64,
    pub line_ending: LineEnding,
    /// Between the words of a motion.
    pub separator: String,
    /// Work coordinate systems that a program can name; none where the origin is set by hand.
    pub wcs: Vec<String>,
    pub source: String,
    pub limits: Limits,
    /// None where a comment would be run.
    #[serde(default)]
    pub comment: Option<Comment>,
    pub word: Words,
    pub block: Blocks,
}

/// What ends a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LineEnding {
    Lf,
    Crlf,
}

impl LineEnding {
    /// The bytes themselves.
    pub fn bytes(self) -> &'static [u8] {
        match self {
            LineEnding::Lf => b"\n",
            LineEnding::Crlf => b"\r\n",
        }
    }
}

/// What the controller cannot take. Checked on every line that is written.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Longest line in bytes, its ending not counted.
    pub line_max: usize,
    /// Largest coordinate, in units of the grid.
    pub value_max: i64,
    pub dwell_max_s: f64,
    /// Words that the controller does not know, or that may not be sent to it.
    pub missing: Vec<String>,
    /// Characters that may stand nowhere, beside those that are not printable ASCII.
    pub forbidden: String,
}

/// How a comment is written.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Comment {
    pub open: String,
    pub close: String,
    /// Characters that may not stand in one; they are written as `_`.
    pub forbidden: String,
}

/// The words of a motion, in the order in which they are written.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Words {
    pub rapid: Motion,
    pub cut: Motion,
    pub x: Number,
    pub y: Number,
    pub z: Number,
    pub feed: Feed,
}

/// When a word is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum When {
    Always,
    Changed,
}

/// A word that says how to move.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    pub letter: String,
    pub when: When,
}

/// When a number carries a decimal point. Zeros at its end are never written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Point {
    Always,
    /// Where a fraction follows.
    Fraction,
}

/// What a coordinate counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LengthUnit {
    Mm,
    /// Units of the grid.
    Grid,
}

/// A coordinate word.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Number {
    pub letter: String,
    pub unit: LengthUnit,
    pub decimals: u32,
    pub point: Point,
    pub when: When,
}

/// What a feed word counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub enum FeedUnit {
    #[serde(rename = "mm/min")]
    MmMin,
    #[serde(rename = "mm/s")]
    MmS,
}

/// Where a feed word stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// At the end of the motion's line.
    Line,
    /// On a line of its own before it.
    OwnLine,
}

/// The feed word.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Feed {
    pub letter: String,
    pub unit: FeedUnit,
    pub decimals: u32,
    pub point: Point,
    pub when: When,
    pub place: Place,
    /// Whether rapid moves need it too, at the machine's rapid rate.
    pub rapids: bool,
}

/// Spelling around the motions; templates of minijinja. Lines that come out empty are left out.
///
/// Names: `wcs`, `clearance`, `x`, `y`, `z` (the first point), `rpm`, `code` (none on machines
/// without), `by_hand`, `spin_up_s`, `spin_up_ms`, `rapid_xy`, `rapid_z` (feed words' numbers),
/// `path_tolerance_mm`, `merge_tolerance_mm`, `tool_changer`, `tool_number`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Before the header, where a controller wants something on the first line.
    #[serde(default)]
    pub lead: String,
    /// Modes, the lift to the clearance plane, spindle.
    pub start: String,
    /// At the first point, still on the clearance plane.
    #[serde(default)]
    pub arrived: String,
    /// On the clearance plane above the last point.
    pub end: String,
}

/// What the blocks of one program may name.
#[derive(Clone, Debug, Default)]
pub(super) struct Facts {
    pub wcs: String,
    pub clearance: String,
    pub first: [String; 3],
    pub rpm: i64,
    pub code: Option<u8>,
    pub by_hand: bool,
    pub spin_up_ms: i64,
    pub rapid_xy: String,
    pub rapid_z: String,
    pub tool_changer: bool,
    pub tool_number: u32,
}

impl Dialect {
    /// The dialect that `name` means to a job in `folder`.
    pub fn find(name: &str, folder: Option<&Path>) -> Result<Dialect, Error> {
        Dialect::parse(&catalogue::find(Kind::Dialect, name, folder)?)
    }

    /// Reads a dialect and checks it: its numbers, and its blocks by spelling them for machines
    /// of every kind.
    pub fn parse(source: &Source) -> Result<Dialect, Error> {
        let dialect: Dialect = source.parse()?;
        source.schema(dialect.schema, 1)?;
        source.within("unit_mm", dialect.unit_mm, 1e-6, 1.0)?;
        source.within("path_tolerance_mm", dialect.path_tolerance_mm, 0.0, 1.0)?;
        source.within("merge_tolerance_mm", dialect.merge_tolerance_mm, 0.0, 1.0)?;
        source.within("extension", dialect.extension.len() as f64, 1.0, 10.0)?;
        source.within("limits.line_max", dialect.limits.line_max as f64, 40.0, 10_000.0)?;
        source.within("limits.value_max", dialect.limits.value_max as f64, 1.0, 1e12)?;
        source.within("limits.dwell_max_s", dialect.limits.dwell_max_s, 0.0, 1e6)?;
        source.within("word.feed.decimals", dialect.word.feed.decimals.into(), 0.0, 6.0)?;
        let numbers = [("word.x", &dialect.word.x), ("word.y", &dialect.word.y), ("word.z", &dialect.word.z)];
        for (key, number) in numbers {
            source.within(&format!("{key}.decimals"), number.decimals.into(), 0.0, 9.0)?;
            if number.unit == LengthUnit::Mm && decimal_steps(number, dialect.unit_mm).is_none() {
                return Err(Error::Decimals {
                    path: source.path().into(),
                    line: source.line_of(key),
                    decimals: number.decimals,
                    unit_mm: dialect.unit_mm,
                });
            }
        }
        for (block, template) in dialect.blocks() {
            let broken = |message: String| Error::Block {
                path: source.path().into(),
                line: source.line_of(&format!("block.{block}")),
                block,
                message,
            };
            for facts in dialect.trials() {
                for line in dialect.spell(template, &facts).map_err(broken)? {
                    dialect.check_line(line.as_bytes()).map_err(broken)?;
                    dialect.check_words(&line).map_err(broken)?;
                }
            }
        }
        Ok(dialect)
    }

    /// The lines of a block.
    pub(super) fn spell(&self, template: &str, facts: &Facts) -> Result<Vec<String>, String> {
        let mut environment = Environment::new();
        environment.set_undefined_behavior(UndefinedBehavior::Strict);
        let values = context! {
            wcs => &facts.wcs,
            clearance => &facts.clearance,
            x => &facts.first[0],
            y => &facts.first[1],
            z => &facts.first[2],
            rpm => facts.rpm,
            code => facts.code.map_or(Value::from(()), Value::from),
            by_hand => facts.by_hand,
            spin_up_s => number(facts.spin_up_ms, 3, Point::Fraction),
            spin_up_ms => facts.spin_up_ms,
            rapid_xy => &facts.rapid_xy,
            rapid_z => &facts.rapid_z,
            path_tolerance_mm => self.path_tolerance_mm,
            merge_tolerance_mm => self.merge_tolerance_mm,
            tool_changer => facts.tool_changer,
            tool_number => facts.tool_number,
        };
        let text = environment.render_str(template, values).map_err(|error| {
            let place = error.line().map_or(String::new(), |line| format!(" in its line {line}"));
            let detail = error.detail().map_or(String::new(), |detail| format!(": {detail}"));
            format!("{}{detail}{place}", error.kind())
        })?;
        Ok(text.lines().map(str::trim).filter(|line| !line.is_empty()).map(String::from).collect())
    }

    /// What of a line the controller cannot take.
    pub(super) fn check_line(&self, line: &[u8]) -> Result<(), String> {
        if line.len() > self.limits.line_max {
            return Err(format!("a line of {} bytes, {} are taken", line.len(), self.limits.line_max));
        }
        let forbidden = self.limits.forbidden.as_bytes();
        match line.iter().find(|&&b| !(b' '..=b'~').contains(&b) || forbidden.contains(&b)) {
            Some(&byte) => {
                Err(format!("the character '{}' may not be sent", (byte as char).escape_default()))
            }
            None => Ok(()),
        }
    }

    fn check_words(&self, line: &str) -> Result<(), String> {
        let mut words = line.split([' ', ';', ',']);
        match words.find(|word| self.limits.missing.iter().any(|missing| missing == word)) {
            Some(word) => Err(format!("the word {word} is one that the controller does not have")),
            None => Ok(()),
        }
    }

    fn blocks(&self) -> [(&'static str, &str); 4] {
        [
            ("lead", &self.block.lead),
            ("start", &self.block.start),
            ("arrived", &self.block.arrived),
            ("end", &self.block.end),
        ]
    }

    fn trials(&self) -> Vec<Facts> {
        let plain = Facts {
            wcs: self.wcs.first().cloned().unwrap_or_default(),
            clearance: "500".into(),
            first: ["1".into(), "2".into(), "500".into()],
            rpm: 20_000,
            spin_up_ms: 3000,
            rapid_xy: "30".into(),
            rapid_z: "15".into(),
            tool_number: 1,
            ..Facts::default()
        };
        vec![
            Facts { code: Some(8), ..plain.clone() },
            Facts { by_hand: true, ..plain.clone() },
            Facts { tool_changer: true, ..plain.clone() },
            plain,
        ]
    }
}

/// How many last decimals one unit of the grid is; None if it is no whole number of them.
pub(super) fn decimal_steps(word: &Number, unit_mm: f64) -> Option<i64> {
    match word.unit {
        LengthUnit::Grid => Some(1),
        LengthUnit::Mm => {
            let steps = unit_mm * 10f64.powi(word.decimals as i32);
            // unit_mm is a decimal number read into binary: 0.0001 * 1e4 is 1 but for the last bit.
            let whole = steps.round();
            (whole >= 1.0 && (steps - whole).abs() < 1e-9 * whole).then_some(whole as i64)
        }
    }
}

/// `count` last decimals, exactly: 1500 with three decimals is 1.5.
pub(super) fn number(count: i64, decimals: u32, point: Point) -> String {
    let mut bytes = Vec::new();
    push_number(&mut bytes, count, decimals, point);
    bytes.into_iter().map(char::from).collect()
}

/// As [`number`], at the end of a line.
pub(super) fn push_number(line: &mut Vec<u8>, count: i64, decimals: u32, point: Point) {
    let mut digits = [b'0'; 32];
    let mut rest = count.unsigned_abs();
    let mut start = digits.len();
    while rest > 0 {
        start -= 1;
        digits[start] = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    if count < 0 {
        line.push(b'-');
    }
    let split = digits.len() - decimals as usize;
    line.extend_from_slice(if start < split { &digits[start..split] } else { b"0" });
    let zeros = digits[split..].iter().rev().take_while(|&&b| b == b'0').count();
    let fraction = &digits[split..digits.len() - zeros];
    if !fraction.is_empty() {
        line.push(b'.');
        line.extend_from_slice(fraction);
    } else if point == Point::Always {
        line.extend_from_slice(if decimals > 0 { b".0" } else { b"." });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spelled_from_whole_counts() {
        let cases = [
            (0, 4, Point::Fraction, "0"),
            (-1, 4, Point::Fraction, "-0.0001"),
            (15_000, 4, Point::Fraction, "1.5"),
            (-123_456_789, 4, Point::Fraction, "-12345.6789"),
            (30, 1, Point::Always, "3.0"),
            (53, 1, Point::Always, "5.3"),
            (8, 0, Point::Always, "8."),
            (-2_147_483_648, 0, Point::Fraction, "-2147483648"),
        ];
        for (count, decimals, point, text) in cases {
            assert_eq!(number(count, decimals, point), text);
        }
    }
}
