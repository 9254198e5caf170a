use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Error, SpindleSetting, Tool};
use crate::catalogue::{self, Kind};
use crate::settings::{self, Source};

/// A machine as posts/machines/*.toml describes it. A section that no source confirms is marked
/// `unconfirmed`; what is shown to an operator says so.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    pub schema: u32,
    pub name: String,
    pub title: String,
    /// Dialects that its controller reads, its own first.
    pub dialects: Vec<String>,
    /// Whether programs may call for a tool by number.
    pub tool_changer: bool,
    #[serde(default)]
    pub notes: Vec<String>,
    pub travel: Travel,
    pub rate: Rate,
    pub motion: Motion,
    pub spindle: Spindle,
    /// None where nothing is switched by programs.
    #[serde(default)]
    pub coolant: Option<Coolant>,
    pub transfer: Transfer,
}

/// Strokes and the size of one mechanical step.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Travel {
    pub x_mm: f64,
    pub y_mm: f64,
    pub z_mm: f64,
    pub step_mm: f64,
    pub source: String,
    #[serde(default)]
    pub unconfirmed: bool,
}

/// Limits of feeds, and the rates of rapid travel.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    pub feed_min_mm_min: f64,
    pub feed_xy_max_mm_min: f64,
    pub feed_z_max_mm_min: f64,
    pub rapid_xy_mm_min: f64,
    pub rapid_z_mm_min: f64,
    pub source: String,
    #[serde(default)]
    pub unconfirmed: bool,
}

/// One figure for each axis.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PerAxis {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// How a controller passes a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Corner {
    /// Grbl's rule: the path is followed exactly, `corner_mm` sets the speed.
    JunctionDeviation,
    /// LinuxCNC's rule: an arc within `corner_mm` of the corner.
    Blend,
    /// A full stop at the end of every block.
    Stop,
}

/// What the motion planner does, for time.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    pub acceleration_mm_s2: PerAxis,
    pub corner: Corner,
    pub corner_mm: f64,
    pub look_ahead_blocks: u32,
    /// Time that a block takes at least, in seconds.
    pub block_s: f64,
    /// How far a chord of an arc may stand off it, for controllers that cut arcs into chords.
    #[serde(default)]
    pub arc_mm: Option<f64>,
    /// Largest speed along the path in any direction; without it only the axes limit it.
    #[serde(default)]
    pub path_max_mm_min: Option<f64>,
    /// A block is spread over one period of the servo loop at least.
    #[serde(default)]
    pub servo_period_s: Option<f64>,
    pub source: String,
    #[serde(default)]
    pub unconfirmed: bool,
}

/// How a program sets the spindle's speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub enum SpindleLaw {
    /// By a number in rpm.
    #[serde(rename = "rpm")]
    Rpm,
    /// rpm = min + code (max - min) / 15, code 0 .. 15.
    #[serde(rename = "code-0-15")]
    CodeFrom0,
    /// rpm = min + (code - 1) (max - min) / 14, code 1 .. 15.
    #[serde(rename = "code-1-15")]
    CodeFrom1,
    /// Not at all: the operator sets it.
    #[serde(rename = "by-hand")]
    ByHand,
}

/// The spindle and what it takes to bring it to speed.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Spindle {
    pub rpm_min: f64,
    pub rpm_max: f64,
    pub set: SpindleLaw,
    pub spin_up_s: f64,
    /// Diameter of what stands above a tool's stick-out: nose, nut or chuck.
    pub nose_diameter_mm: f64,
    pub source: String,
    #[serde(default)]
    pub unconfirmed: bool,
}

/// The words that switch flood, mist or air.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Coolant {
    pub on: String,
    pub off: String,
    pub source: String,
    #[serde(default)]
    pub unconfirmed: bool,
}

/// How a program reaches the controller.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Transfer {
    /// Bits a second of the line; ten of them a byte. None: not a limit.
    #[serde(default)]
    pub baud: Option<u32>,
    /// Size of the largest program the controller holds. None: it is sent as it is cut.
    #[serde(default)]
    pub memory_bytes: Option<u64>,
    pub source: String,
    #[serde(default)]
    pub unconfirmed: bool,
}

/// Words for flood, mist and air of the controllers that are known.
const COOLANT: [&str; 5] = ["M7", "M8", "M9", "M12", "M13"];

impl Machine {
    /// The machine that `name` means to a job in `folder`.
    pub fn find(name: &str, folder: Option<&Path>) -> Result<Machine, Error> {
        Ok(Machine::parse(&catalogue::find(Kind::Machine, name, folder)?)?)
    }

    /// Reads and checks a profile.
    pub fn parse(source: &Source) -> Result<Machine, settings::Error> {
        let machine: Machine = source.parse()?;
        source.schema(machine.schema, 1)?;
        source.within("dialects", machine.dialects.len() as f64, 1.0, 20.0)?;
        let Machine { travel, rate, motion, spindle, transfer, .. } = &machine;
        source.within("travel.x_mm", travel.x_mm, 1.0, 100_000.0)?;
        source.within("travel.y_mm", travel.y_mm, 1.0, 100_000.0)?;
        source.within("travel.z_mm", travel.z_mm, 1.0, 10_000.0)?;
        source.within("travel.step_mm", travel.step_mm, 1e-6, 1.0)?;
        source.within("rate.feed_min_mm_min", rate.feed_min_mm_min, 1e-3, 1e5)?;
        let low = rate.feed_min_mm_min;
        source.within("rate.feed_xy_max_mm_min", rate.feed_xy_max_mm_min, low, 1e6)?;
        source.within("rate.feed_z_max_mm_min", rate.feed_z_max_mm_min, low, 1e6)?;
        source.within("rate.rapid_xy_mm_min", rate.rapid_xy_mm_min, low, 1e6)?;
        source.within("rate.rapid_z_mm_min", rate.rapid_z_mm_min, low, 1e6)?;
        let a = motion.acceleration_mm_s2;
        source.within("motion.acceleration_mm_s2.x", a.x, 0.1, 1e6)?;
        source.within("motion.acceleration_mm_s2.y", a.y, 0.1, 1e6)?;
        source.within("motion.acceleration_mm_s2.z", a.z, 0.1, 1e6)?;
        source.within("motion.corner_mm", motion.corner_mm, 0.0, 10.0)?;
        source.within("motion.look_ahead_blocks", motion.look_ahead_blocks.into(), 1.0, 1e6)?;
        source.within("motion.block_s", motion.block_s, 0.0, 10.0)?;
        source.within("motion.arc_mm", motion.arc_mm.unwrap_or(0.002), 1e-6, 1.0)?;
        source.within("motion.path_max_mm_min", motion.path_max_mm_min.unwrap_or(low), low, 1e6)?;
        source.within("motion.servo_period_s", motion.servo_period_s.unwrap_or(0.0), 0.0, 1.0)?;
        source.within("spindle.rpm_min", spindle.rpm_min, 1.0, 1e6)?;
        source.within("spindle.rpm_max", spindle.rpm_max, spindle.rpm_min, 1e6)?;
        source.within("spindle.spin_up_s", spindle.spin_up_s, 0.0, 600.0)?;
        source.within("spindle.nose_diameter_mm", spindle.nose_diameter_mm, 0.1, 1000.0)?;
        if let Some(coolant) = &machine.coolant {
            let words = [("coolant.on", &coolant.on), ("coolant.off", &coolant.off)];
            let strange = words.iter().find(|(_, word)| !COOLANT.contains(&word.as_str()));
            if let Some((key, word)) = strange {
                return Err(source.unknown_value(key, word, &COOLANT));
            }
        }
        if let Some(baud) = transfer.baud {
            source.within("transfer.baud", baud.into(), 1.0, 1e10)?;
        }
        if let Some(bytes) = transfer.memory_bytes {
            source.within("transfer.memory_bytes", bytes as f64, 1.0, 1e15)?;
        }
        Ok(machine)
    }

    /// The sections of the profile that no source confirms, for "verify against your machine".
    pub fn unconfirmed(&self) -> Vec<&'static str> {
        [
            ("travel", self.travel.unconfirmed),
            ("rate", self.rate.unconfirmed),
            ("motion", self.motion.unconfirmed),
            ("spindle", self.spindle.unconfirmed),
            ("coolant", self.coolant.as_ref().is_some_and(|coolant| coolant.unconfirmed)),
            ("transfer", self.transfer.unconfirmed),
        ]
        .into_iter()
        .filter_map(|(section, unconfirmed)| unconfirmed.then_some(section))
        .collect()
    }

    /// The same with their figures and what they are taken from, a line each.
    pub fn unconfirmed_figures(&self) -> Vec<String> {
        let Machine { travel, rate, motion, spindle, transfer, .. } = self;
        let a = motion.acceleration_mm_s2;
        let coolant = self.coolant.as_ref();
        let lines = [
            (
                travel.unconfirmed,
                format!("travel {} x {} x {} mm ({})", travel.x_mm, travel.y_mm, travel.z_mm, travel.source),
            ),
            (
                rate.unconfirmed,
                format!(
                    "feeds up to {} mm/min in X and Y, {} in Z ({})",
                    rate.feed_xy_max_mm_min, rate.feed_z_max_mm_min, rate.source
                ),
            ),
            (
                motion.unconfirmed,
                format!("accelerations {}, {}, {} mm/s2 ({})", a.x, a.y, a.z, motion.source),
            ),
            (
                spindle.unconfirmed,
                format!("spindle {} to {} rpm ({})", spindle.rpm_min, spindle.rpm_max, spindle.source),
            ),
            (
                coolant.is_some_and(|coolant| coolant.unconfirmed),
                coolant.map_or(String::new(), |c| format!("coolant {} and {} ({})", c.on, c.off, c.source)),
            ),
            (transfer.unconfirmed, format!("transfer ({})", transfer.source)),
        ];
        lines.into_iter().filter_map(|(unconfirmed, line)| unconfirmed.then_some(line)).collect()
    }

    /// Whether its controller reads the dialect. A job may ask for another: it is written, and
    /// warned of.
    pub fn reads(&self, dialect: &str) -> bool {
        self.dialects.iter().any(|known| known == dialect)
    }

    /// What a program has to say to turn the spindle for a tool, and the speed that comes out.
    ///
    /// Errors: a speed or a feed that the machine cannot make. A cut may run in any direction, so
    /// it is held to the limit of X and Y, a plunge to that of Z.
    pub fn run(&self, tool: &Tool) -> Result<SpindleSetting, Error> {
        let least = self.rate.feed_min_mm_min;
        let limits = [
            ("feed_mm_min", tool.feed_mm_min, self.rate.feed_xy_max_mm_min),
            ("plunge_mm_min", tool.plunge_mm_min, self.rate.feed_z_max_mm_min),
        ];
        for (key, feed_mm_min, high) in limits {
            if !(feed_mm_min >= least && feed_mm_min <= high) {
                let (tool, machine) = (tool.name.clone(), self.name.clone());
                return Err(Error::Feed { tool, key, feed_mm_min, machine, low: least, high });
            }
        }
        self.spindle.setting(tool.spindle_rpm).ok_or_else(|| Error::Rpm {
            tool: tool.name.clone(),
            rpm: tool.spindle_rpm,
            machine: self.name.clone(),
            low: self.spindle.rpm_min,
            high: self.spindle.rpm_max,
        })
    }
}
