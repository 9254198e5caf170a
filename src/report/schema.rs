//! `report.json`, schema 1: the names and the order of its keys.

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use crate::fidelity::Figures;

/// Everything a job found out. It holds no clock readings.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub schema: u32,
    /// Version of the program.
    pub screenmill: String,
    pub verdict: Verdict,
    pub part: Part,
    pub tiles: Vec<Tile>,
    pub fidelity: Option<Fidelity>,
    /// Designed screens only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<Light>,
    pub time_s: Times,
    pub findings: Vec<Finding>,
}

/// Schema of [`Report`].
pub const SCHEMA: u32 = 1;

impl Report {
    /// A report of this version without tiles; it passes until something fails it.
    pub fn new(part: Part) -> Report {
        Report {
            schema: SCHEMA,
            screenmill: env!("CARGO_PKG_VERSION").to_string(),
            verdict: Verdict::Pass,
            part,
            tiles: Vec::new(),
            fidelity: None,
            light: None,
            time_s: Times::default(),
            findings: Vec::new(),
        }
    }

    /// Adds a finding; an error fails the report.
    pub fn finding(&mut self, finding: Finding) {
        if finding.severity == Severity::Error {
            self.verdict = Verdict::Fail;
        }
        self.findings.push(finding);
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    Pass,
    Fail,
}

#[derive(Clone, Debug, Serialize)]
pub struct Part {
    pub width_mm: f64,
    pub height_mm: f64,
    pub columns: usize,
    pub rows: usize,
    pub step_mm: f64,
    /// Lowest design point; the highest is 0.
    pub z_min_mm: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Tile {
    /// `r0c0`: row and column.
    pub name: String,
    pub row: usize,
    pub column: usize,
    /// Lower left corner in the part frame.
    pub x_mm: f64,
    pub y_mm: f64,
    pub width_mm: f64,
    pub height_mm: f64,
    pub z_range_mm: f64,
    /// The program's zero in the part frame.
    pub program_zero_mm: [f64; 3],
    /// Rotation about x and about y that levelling took out.
    pub wedge_deg: [f64; 2],
    pub programs: Vec<Program>,
    pub maps: Option<MapFiles>,
    pub fidelity: Option<Fidelity>,
}

#[derive(Clone, Debug, Serialize)]
pub struct Program {
    /// Relative to the job's folder.
    pub file: String,
    pub post: String,
    pub operation: String,
    pub tool: String,
    pub cutter: String,
    pub blocks: u64,
    pub bytes: u64,
    pub cutting_mm: f64,
    pub rapid_mm: f64,
    pub time_s: f64,
    pub deepest_bite_mm: f64,
    /// Every motion after the first that names X and Y, in the program frame.
    pub bounds_mm: Bounds,
}

/// Lowest and highest coordinate of each axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    pub x: [f64; 2],
    pub y: [f64; 2],
    pub z: [f64; 2],
}

/// Map files relative to the job's folder.
#[derive(Clone, Debug, Serialize)]
pub struct MapFiles {
    pub design: String,
    pub machined: String,
    pub deviation: String,
    pub cavity: String,
}

#[derive(Clone, Debug, Serialize)]
pub struct Fidelity {
    pub gouge_max_mm: f64,
    pub gouge_budget_mm: GougeBudget,
    pub excess_max_mm: f64,
    pub deviation_p50_mm: Option<f64>,
    pub deviation_p99_mm: Option<f64>,
    pub within_limit_fraction: Option<f64>,
    pub normal_p50_deg: Option<f64>,
    pub normal_p95_deg: Option<f64>,
    pub cavity_area_fraction: Option<f64>,
    pub cavity_max_depth_mm: Option<f64>,
    /// Number of connected cavities.
    pub cavities: Option<u64>,
    pub by_cause: Option<ByCause>,
}

impl Fidelity {
    /// The figures of a tally beside what the job allowed itself and the number of cavities.
    pub fn of(figures: &Figures, gouge_budget_mm: GougeBudget, cavities: Option<u64>) -> Fidelity {
        Fidelity {
            gouge_max_mm: figures.gouge_max_mm,
            gouge_budget_mm,
            excess_max_mm: figures.excess_max_mm,
            deviation_p50_mm: figures.deviation_p50_mm,
            deviation_p99_mm: figures.deviation_p99_mm,
            within_limit_fraction: figures.within_limit_fraction,
            normal_p50_deg: figures.normal_p50_deg,
            normal_p95_deg: figures.normal_p95_deg,
            cavity_area_fraction: figures.cavity_area_fraction,
            cavity_max_depth_mm: figures.cavity_max_depth_mm,
            cavities,
            by_cause: figures.by_cause.map(|cause| ByCause {
                unreachable: cause.unreachable_mm,
                scallop: cause.scallop_mm,
                rounding: cause.rounding_mm,
            }),
        }
    }
}

/// Parts of the gouge limit in mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct GougeBudget {
    pub raster: f64,
    pub simplify: f64,
    pub rounding: f64,
    pub controller: f64,
}

impl GougeBudget {
    /// All parts together, in mm.
    pub fn total_mm(&self) -> f64 {
        self.raster + self.simplify + self.rounding + self.controller
    }
}

/// Area means in mm that add up to the mean deviation. Without a cavity map or without exact passes the
/// scallop holds their part too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ByCause {
    pub unreachable: Option<f64>,
    pub scallop: f64,
    pub rounding: Option<f64>,
}

/// Where the light of the design and of the cut goes, as parts of the incident light; gain is relative to a
/// Lambertian of reflectance 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Light {
    pub on_audience_designed: f64,
    pub on_audience_machined: f64,
    pub leak_designed: f64,
    pub leak_machined: f64,
    pub absorbed_designed: f64,
    pub absorbed_machined: f64,
    pub unresolved_designed: f64,
    pub unresolved_machined: f64,
    pub gain_designed: Option<f64>,
    pub gain_machined: Option<f64>,
    pub uniformity_designed: Option<f64>,
    pub uniformity_machined: Option<f64>,
    /// The same over the screen's cells, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screen_uniformity_designed: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screen_uniformity_machined: Option<f64>,
    /// Part of the samples that the projector does not reach.
    pub shadowed_designed: Option<f64>,
    pub shadowed_machined: Option<f64>,
    /// Of the share on the audience, where a rough metal's directions are drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<f64>,
    /// After polishing, by the model that the job asks for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polished: Option<Polished>,
}

/// Where the light of a polished cut goes, by a model of polishing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Polished {
    pub removal_um: f64,
    pub on_audience: f64,
    pub leak: f64,
    pub absorbed: f64,
    pub unresolved: f64,
    pub gain: Option<f64>,
    pub uniformity: Option<f64>,
}

/// Machine time in seconds.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Times {
    pub total: f64,
    pub by_operation: Parts,
    pub by_tool: Parts,
}

/// Named parts in the order they were first met, written as an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts(pub Vec<(String, f64)>);

impl Parts {
    /// Adds to the part of this name.
    pub fn add(&mut self, name: &str, amount: f64) {
        match self.0.iter_mut().find(|(known, _)| known == name) {
            Some((_, sum)) => *sum += amount,
            None => self.0.push((name.to_string(), amount)),
        }
    }
}

impl Serialize for Parts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, amount) in &self.0 {
            map.serialize_entry(name, amount)?;
        }
        map.end()
    }
}

/// How much a finding matters, gravest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    Error,
    Warning,
    Note,
}

/// Something the user should know. `code` is stable, e.g. `gouge`; `where_mm` is in the part frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    pub severity: Severity,
    pub code: String,
    pub message: String,
    pub tile: Option<String>,
    pub where_mm: Option<Vec<f64>>,
}

/// A finding about the whole job; add a tile and a place with [`Finding::on`] and [`Finding::at`].
pub fn finding(severity: Severity, code: &str, message: impl Into<String>) -> Finding {
    Finding { severity, code: code.to_string(), message: message.into(), tile: None, where_mm: None }
}

impl Finding {
    /// The same finding, on a tile.
    pub fn on(self, tile: &str) -> Finding {
        Finding { tile: Some(tile.to_string()), ..self }
    }

    /// The same finding, at a place of the part frame.
    pub fn at(self, where_mm: &[f64]) -> Finding {
        Finding { where_mm: Some(where_mm.to_vec()), ..self }
    }
}
