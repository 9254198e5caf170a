use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Error;
use super::block::Facts;
use super::number::decimal_steps;
use crate::catalogue::{self, Kind};
use crate::machine::Machine;
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
    /// Keys of this file that no source confirms; what is shown to an operator says so.
    #[serde(default)]
    pub unconfirmed: Vec<String>,
    /// What an operator has to know or to set.
    #[serde(default)]
    pub notes: Vec<String>,
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
    /// What of a line its controller counts. What is written is held to it with all of its bytes.
    #[serde(default)]
    pub line_counts: LineCounts,
    /// Largest coordinate, in units of the grid.
    pub value_max: i64,
    pub dwell_max_s: f64,
    /// Words that the controller does not know, or that may not be sent to it.
    pub missing: Vec<String>,
    /// Characters that may stand nowhere, beside those that are not printable ASCII.
    pub forbidden: String,
}

/// What of a line counts towards its longest length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LineCounts {
    #[default]
    Bytes,
    /// Blanks and comments are taken out before.
    Words,
}

/// How a comment is written.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Comment {
    pub open: String,
    pub close: String,
    /// Characters that may not stand in one; they are written as `_`.
    pub forbidden: String,
    /// Whether the controller has capital letters only.
    #[serde(default)]
    pub upper_case: bool,
    /// Between what a line is about and what it says.
    #[serde(default = "colon")]
    pub label: String,
}

fn colon() -> String {
    ": ".into()
}

impl Comment {
    /// A line of its own, with what may not stand in it replaced.
    pub(super) fn line(&self, text: &str, limits: &Limits) -> String {
        format!("{}{}{}", self.open, self.clean(text, limits), self.close)
    }

    /// Text without what may not stand in a comment, or anywhere.
    pub(super) fn clean(&self, text: &str, limits: &Limits) -> String {
        let bad =
            |c: char| !(' '..='~').contains(&c) || self.forbidden.contains(c) || limits.forbidden.contains(c);
        let spelled = |c: char| if self.upper_case { c.to_ascii_uppercase() } else { c };
        text.chars().map(spelled).map(|c| if bad(c) { '_' } else { c }).collect()
    }
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
/// Names: `wcs`, `clearance`, `x`, `y`, `z` (the first point), `park_x`, `park_y` (the back left
/// corner of the program's motions), `rpm`, `code` (none on machines
/// without), `by_hand`, `spin_up_s`, `spin_up_ms`, `rapid_xy`, `rapid_z` (feed words'
/// numbers), `path_tolerance_mm`, `merge_tolerance_mm`, `spindle`, `tool_changer`, `tool_number`, `coolant_on`,
/// `coolant_off` (none on machines without), `program_number`. Filters beside minijinja's own:
/// `point` (3 becomes 3.0), `digits(n)` (leading zeros).
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

/// Where a key that no source confirms may stand.
const KEYS: [&str; 7] =
    ["unit_mm", "path_tolerance_mm", "merge_tolerance_mm", "limits", "comment", "word", "block"];

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
        dialect.check_spelling(source)?;
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
            for facts in Facts::trials(&dialect) {
                for line in facts.spell(template, &dialect).map_err(broken)? {
                    dialect.check_line(line.as_bytes()).map_err(broken)?;
                    dialect.check_words(&line).map_err(broken)?;
                }
            }
        }
        Ok(dialect)
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

    /// The machine's words for coolant; None where it has none or the controller does not know them.
    pub(super) fn coolant(&self, machine: &Machine) -> Option<[String; 2]> {
        let coolant = machine.coolant.as_ref()?;
        let words = [coolant.on.clone(), coolant.off.clone()];
        words.iter().all(|word| self.check_words(word).is_ok()).then_some(words)
    }

    /// What is written as it stands: letters, separator, comment marks, extension.
    fn check_spelling(&self, source: &Source) -> Result<(), Error> {
        let refuse = |key: &str, message: String| Error::Spelling {
            path: source.path().into(),
            line: source.line_of(key),
            key: key.into(),
            message,
        };
        if !self.extension.chars().all(|c| c.is_ascii_alphanumeric()) {
            let message = format!("\"{}\" ends no file name", self.extension.escape_debug());
            return Err(refuse("extension", message));
        }
        let word = &self.word;
        let mut spellings: Vec<(&str, &str)> = vec![
            ("separator", &self.separator),
            ("word.rapid.letter", &word.rapid.letter),
            ("word.cut.letter", &word.cut.letter),
            ("word.x.letter", &word.x.letter),
            ("word.y.letter", &word.y.letter),
            ("word.z.letter", &word.z.letter),
            ("word.feed.letter", &word.feed.letter),
        ];
        spellings.extend(self.wcs.iter().map(|name| ("wcs", name.as_str())));
        if let Some(comment) = &self.comment {
            spellings.extend([("comment.open", comment.open.as_str()), ("comment.close", &comment.close)]);
            if comment.open.is_empty() || comment.open.len() + comment.close.len() > 16 {
                return Err(refuse("comment.open", "a comment needs a short mark to begin with".into()));
            }
        }
        for (key, text) in spellings {
            self.check_line(text.as_bytes()).map_err(|message| refuse(key, message))?;
            self.check_words(text).map_err(|message| refuse(key, message))?;
        }
        for key in &self.unconfirmed {
            if !KEYS.contains(&key.split('.').next().unwrap_or_default()) {
                return Err(source.unknown_value("unconfirmed", key, &KEYS).into());
            }
        }
        Ok(())
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
}
