//! Blocks of pure spelling, filled with what one program says.

use minijinja::{Environment, UndefinedBehavior, Value, context};

use super::dialect::{Dialect, Point};
use super::number::number;

/// What the blocks of one program may name.
#[derive(Clone, Debug, Default)]
pub(super) struct Facts {
    pub wcs: String,
    pub clearance: String,
    pub first: [String; 3],
    pub park: [String; 2],
    pub rpm: i64,
    pub code: Option<u8>,
    pub by_hand: bool,
    /// Whether it turns at all.
    pub spindle: bool,
    pub spin_up_ms: i64,
    pub rapid_xy: String,
    pub rapid_z: String,
    pub tool_changer: bool,
    pub tool_number: u32,
    pub coolant: Option<[String; 2]>,
    pub program_number: u32,
}

impl Facts {
    /// The lines of a block; empty ones are left out.
    pub fn spell(&self, template: &str, dialect: &Dialect) -> Result<Vec<String>, String> {
        let mut environment = Environment::new();
        environment.set_undefined_behavior(UndefinedBehavior::Strict);
        environment.add_filter("point", pointed);
        environment.add_filter("digits", digits);
        let coolant = |which: usize| {
            self.coolant.as_ref().map_or(Value::from(()), |words| Value::from(words[which].as_str()))
        };
        let values = context! {
            wcs => &self.wcs,
            clearance => &self.clearance,
            x => &self.first[0],
            y => &self.first[1],
            z => &self.first[2],
            park_x => &self.park[0],
            park_y => &self.park[1],
            rpm => self.rpm,
            code => self.code.map_or(Value::from(()), Value::from),
            by_hand => self.by_hand,
            spindle => self.spindle,
            spin_up_s => number(self.spin_up_ms, 3, Point::Fraction),
            spin_up_ms => self.spin_up_ms,
            rapid_xy => &self.rapid_xy,
            rapid_z => &self.rapid_z,
            path_tolerance_mm => dialect.path_tolerance_mm,
            merge_tolerance_mm => dialect.merge_tolerance_mm,
            tool_changer => self.tool_changer,
            tool_number => self.tool_number,
            coolant_on => coolant(0),
            coolant_off => coolant(1),
            program_number => self.program_number,
        };
        let text = environment.render_str(template, values).map_err(|error| {
            let place = error.line().map_or(String::new(), |line| format!(" in its line {line}"));
            let detail = error.detail().map_or(String::new(), |detail| format!(": {detail}"));
            format!("{}{detail}{place}", error.kind())
        })?;
        Ok(text.lines().map(str::trim).filter(|line| !line.is_empty()).map(String::from).collect())
    }

    /// Programs of every kind of machine, for trying the blocks of a dialect when it is read.
    pub fn trials(dialect: &Dialect) -> Vec<Facts> {
        let plain = Facts {
            wcs: dialect.wcs.first().cloned().unwrap_or_default(),
            clearance: "500".into(),
            first: ["1".into(), "2".into(), "500".into()],
            park: ["1".into(), "2".into()],
            rpm: 20_000,
            spindle: true,
            spin_up_ms: 3000,
            rapid_xy: "30".into(),
            rapid_z: "15".into(),
            tool_number: 1,
            program_number: 1,
            ..Facts::default()
        };
        vec![
            Facts { code: Some(8), ..plain.clone() },
            Facts { by_hand: true, ..plain.clone() },
            Facts { tool_changer: true, ..plain.clone() },
            Facts { spindle: false, ..plain.clone() },
            plain,
        ]
    }
}

/// A number with its decimal point, for controllers that count in thousandths without one.
fn pointed(text: String) -> String {
    if text.contains('.') { text } else { format!("{text}.0") }
}

/// A whole number with leading zeros.
fn digits(value: u32, count: usize) -> String {
    format!("{value:0count$}")
}
