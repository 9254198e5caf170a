//! The job file: what is cut, from what, on which machine, with which operations. Every key is checked
//! when it is read; an unknown one is an error.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::settings;

/// JOB.toml as written. Paths are relative to the job's folder until [`Job::read`] resolves them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Job {
    pub schema: u32,
    pub part: Part,
    pub stock: Stock,
    pub machine: Machine,
    #[serde(default)]
    pub tools: Tools,
    #[serde(default)]
    pub limits: Limits,
    #[serde(default)]
    pub maps: Maps,
    #[serde(default, rename = "operation")]
    pub operations: Vec<Operation>,
}

/// What is to be cut: exactly one of `screen`, `design`, `mesh`, `heights`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    pub screen: Option<PathBuf>,
    pub design: Option<PathBuf>,
    pub mesh: Option<PathBuf>,
    pub heights: Option<PathBuf>,
    /// C0 R0 C1 R1 of the screen's grid.
    pub cells: Option<[i32; 4]>,
    /// Rows x columns of elevations in mm for `screen`, taken as given.
    pub elevation: Option<PathBuf>,
    #[serde(default = "ten_micrometres")]
    pub step_mm: f64,
    #[serde(default)]
    pub edge: Edge,
    #[serde(default)]
    pub form: Form,
    #[serde(default)]
    pub level: Level,
    /// Pitch of a height image that carries none.
    pub pixel_mm: Option<f64>,
    /// Unit of a mesh: "mm", "m" or "inch".
    pub unit: Option<String>,
    /// Axis of a mesh that points out of the stock: "x", "y" or "z".
    pub up: Option<String>,
    pub z_min_mm: Option<f64>,
    pub z_max_mm: Option<f64>,
}

fn ten_micrometres() -> f64 {
    0.010
}

/// What stands outside the part: nothing, or material to keep up to the stock's top.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Edge {
    #[default]
    Open,
    Wall,
}

/// The part itself, or the die that presses it: z'(x, y) = -z(W - x, y).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    #[default]
    Part,
    Die,
}

/// Whether each tile is turned so that its best-fit plane lies flat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    #[default]
    None,
    Plane,
}

/// The blank, or blanks.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stock {
    #[serde(default)]
    pub material: String,
    pub thickness_mm: f64,
    #[serde(default)]
    pub top_allowance_mm: f64,
    #[serde(default)]
    pub margin_mm: f64,
    #[serde(default)]
    pub min_floor_mm: f64,
    #[serde(default)]
    pub blanks: Blanks,
    #[serde(default)]
    pub z_zero: ZZero,
}

/// One blank a tile, or one sheet that is re-fixtured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Blanks {
    #[default]
    PerTile,
    One,
}

/// The plane of the program's Z0: the stock's top, or the tile's highest design point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ZZero {
    #[default]
    StockTop,
    PartTop,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    pub name: String,
    /// Dialects to write; the machine's own if left out.
    pub post: Option<Vec<String>>,
    #[serde(default = "vacuum_plate")]
    pub fixture: String,
    #[serde(default = "g54")]
    pub wcs: String,
    #[serde(default = "five")]
    pub clearance_mm: f64,
}

fn vacuum_plate() -> String {
    "vacuum-plate".into()
}

fn g54() -> String {
    "G54".into()
}

fn five() -> f64 {
    5.0
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tools {
    /// The one that comes with the program if left out.
    pub library: Option<PathBuf>,
}

/// What must hold for exit code 0; what is not named is not judged, but for `gouge_mm`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    pub gouge_mm: Option<f64>,
    pub deviation_mm: Option<f64>,
    pub normal_p95_deg: Option<f64>,
    pub on_audience_min: Option<f64>,
    pub hours_max: Option<f64>,
}

impl Limits {
    /// The gouge that plans and verdict work to: 2 um where the job names none.
    pub fn gouge_or_default_mm(&self) -> f64 {
        self.gouge_mm.unwrap_or(0.002)
    }

    /// The deviation that `within_limit_fraction` counts: 20 um where the job names none.
    pub fn deviation_or_default_mm(&self) -> f64 {
        self.deviation_mm.unwrap_or(0.020)
    }
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Maps {
    /// Keep maps at full resolution past 64 Msamples a tile.
    #[serde(default)]
    pub full: bool,
}

/// One operation, cut with one tool in one program a tile.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Operation {
    pub kind: Kind,
    /// An entry of the tool library, or an inline cutter such as `ball:1`.
    pub tool: String,
    pub stepdown_mm: Option<f64>,
    pub stepover_mm: Option<f64>,
    pub scallop_mm: Option<f64>,
    #[serde(default)]
    pub stock_to_leave_mm: f64,
    #[serde(default)]
    pub direction_deg: f64,
    #[serde(default)]
    pub pattern: Pattern,
    pub feed_mm_min: Option<f64>,
    pub plunge_mm_min: Option<f64>,
    pub spindle_rpm: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    Rough,
    Finish,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    #[default]
    Zigzag,
    OneWay,
}

/// Why a job was refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Settings(#[from] settings::Error),
    #[error("{path}: schema is {found}, this version reads schema 1")]
    Schema { path: String, found: u32 },
    #[error("{path}: [part] names {found} of screen, design, mesh and heights; hint: exactly one")]
    Source { path: String, found: usize },
    #[error("{path}: [part] {key} goes with {with} only; hint: {hint}")]
    Misplaced { path: String, key: &'static str, with: &'static str, hint: &'static str },
    #[error("{path}: {key} is {value}, it must lie in {low} .. {high}")]
    Range { path: String, key: String, value: f64, low: f64, high: f64 },
    #[error("{path}: no [[operation]]; hint: a job needs at least one, see samples/quickstart/job.toml")]
    NoOperation { path: String },
    #[error("{path}: operation {number} ({kind}) {problem}; hint: {hint}")]
    Operation { path: String, number: usize, kind: &'static str, problem: String, hint: &'static str },
    #[error("{path}: cells {cells:?} hold nothing; hint: C0 R0 C1 R1 with C0 < C1 and R0 < R1")]
    Cells { path: String, cells: [i32; 4] },
    #[error("{path}: wcs is \"{wcs}\"; hint: G54, G55, G56, G57, G58 or G59")]
    Wcs { path: String, wcs: String },
}

impl Job {
    /// Reads and checks a job; paths in it come back resolved against its folder.
    pub fn read(path: &Path) -> Result<Job, Error> {
        let mut job: Job = settings::read(path)?;
        job.check(&path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let part = &mut job.part;
        for file in [
            &mut part.screen,
            &mut part.design,
            &mut part.mesh,
            &mut part.heights,
            &mut part.elevation,
            &mut job.tools.library,
        ] {
            if let Some(file) = file {
                *file = folder.join(&*file);
            }
        }
        Ok(job)
    }

    fn check(&self, path: &str) -> Result<(), Error> {
        let path = || path.to_string();
        if self.schema != 1 {
            return Err(Error::Schema { path: path(), found: self.schema });
        }
        let part = &self.part;
        let sources = [&part.screen, &part.design, &part.mesh, &part.heights];
        let found = sources.iter().filter(|source| source.is_some()).count();
        if found != 1 {
            return Err(Error::Source { path: path(), found });
        }
        let misplaced = |key, given: bool, allowed: bool, with, hint| {
            if given && !allowed {
                Err(Error::Misplaced { path: path(), key, with, hint })
            } else {
                Ok(())
            }
        };
        let (mesh, heights) = (part.mesh.is_some(), part.heights.is_some());
        let designed = part.screen.is_some() || part.design.is_some();
        misplaced("cells", part.cells.is_some(), designed, "screen or design", "leave it out")?;
        misplaced("elevation", part.elevation.is_some(), part.screen.is_some(), "screen", "leave it out")?;
        misplaced("unit", part.unit.is_some(), mesh, "mesh", "leave it out")?;
        misplaced("up", part.up.is_some(), mesh, "mesh", "leave it out")?;
        misplaced("pixel_mm", part.pixel_mm.is_some(), heights, "heights", "leave it out")?;
        misplaced("z_min_mm", part.z_min_mm.is_some(), heights, "heights", "leave it out")?;
        misplaced("z_max_mm", part.z_max_mm.is_some(), heights, "heights", "leave it out")?;
        misplaced(
            "level = \"plane\"",
            part.level == Level::Plane && heights,
            false,
            "screen, design or mesh",
            "level the height image where it is made",
        )?;
        if let Some(cells) = part.cells
            && (cells[0] >= cells[2] || cells[1] >= cells[3])
        {
            return Err(Error::Cells { path: path(), cells });
        }
        if !matches!(self.machine.wcs.as_str(), "G54" | "G55" | "G56" | "G57" | "G58" | "G59") {
            return Err(Error::Wcs { path: path(), wcs: self.machine.wcs.clone() });
        }
        self.check_ranges(path)?;
        self.check_operations(path)
    }

    fn check_ranges(&self, path: impl Fn() -> String) -> Result<(), Error> {
        let within = |key: &str, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(Error::Range { path: path(), key: key.into(), value, low, high })
            }
        };
        let optional = |key: &str, value: Option<f64>, low: f64, high: f64| match value {
            Some(value) => within(key, value, low, high),
            None => Ok(()),
        };
        within("[part] step_mm", self.part.step_mm, 0.001, 1.0)?;
        optional("[part] pixel_mm", self.part.pixel_mm, 1e-4, 100.0)?;
        within("[stock] thickness_mm", self.stock.thickness_mm, 0.1, 500.0)?;
        within("[stock] top_allowance_mm", self.stock.top_allowance_mm, 0.0, 50.0)?;
        within("[stock] margin_mm", self.stock.margin_mm, 0.0, 200.0)?;
        within("[stock] min_floor_mm", self.stock.min_floor_mm, 0.0, self.stock.thickness_mm)?;
        within("[machine] clearance_mm", self.machine.clearance_mm, 0.1, 200.0)?;
        optional("[limits] gouge_mm", self.limits.gouge_mm, 1e-4, 1.0)?;
        optional("[limits] deviation_mm", self.limits.deviation_mm, 1e-4, 10.0)?;
        optional("[limits] normal_p95_deg", self.limits.normal_p95_deg, 1e-3, 90.0)?;
        optional("[limits] on_audience_min", self.limits.on_audience_min, 0.0, 1.0)?;
        optional("[limits] hours_max", self.limits.hours_max, 1e-6, 1e6)
    }

    fn check_operations(&self, path: impl Fn() -> String) -> Result<(), Error> {
        if self.operations.is_empty() {
            return Err(Error::NoOperation { path: path() });
        }
        for (index, operation) in self.operations.iter().enumerate() {
            let number = index + 1;
            let kind = match operation.kind {
                Kind::Rough => "rough",
                Kind::Finish => "finish",
            };
            let refuse = |problem: String, hint| {
                Err(Error::Operation { path: path(), number, kind, problem, hint })
            };
            let numbers = [
                ("stepdown_mm", operation.stepdown_mm, 1e-3, 50.0),
                ("stepover_mm", operation.stepover_mm, 1e-3, 100.0),
                ("scallop_mm", operation.scallop_mm, 1e-6, 10.0),
                ("stock_to_leave_mm", Some(operation.stock_to_leave_mm), 0.0, 10.0),
                ("direction_deg", Some(operation.direction_deg), -360.0, 360.0),
                ("feed_mm_min", operation.feed_mm_min, 1.0, 60_000.0),
                ("plunge_mm_min", operation.plunge_mm_min, 1.0, 60_000.0),
                ("spindle_rpm", operation.spindle_rpm, 1.0, 200_000.0),
            ];
            for (key, value, low, high) in numbers {
                if let Some(value) = value
                    && !(value >= low && value <= high)
                {
                    let key = format!("operation {number} ({kind}) {key}");
                    return Err(Error::Range { path: path(), key, value, low, high });
                }
            }
            match operation.kind {
                Kind::Rough if operation.stepdown_mm.is_none() => {
                    return refuse("has no stepdown_mm".into(), "0.05 to 0.15 of the cutter's diameter");
                }
                Kind::Rough if operation.scallop_mm.is_some() => {
                    return refuse("has scallop_mm".into(), "roughing takes stepover_mm");
                }
                Kind::Finish if operation.stepdown_mm.is_some() => {
                    return refuse(
                        "has stepdown_mm".into(),
                        "finishing follows the surface in one pass; a rough operation goes down by levels",
                    );
                }
                Kind::Finish if operation.stepover_mm.is_some() == operation.scallop_mm.is_some() => {
                    let both = operation.stepover_mm.is_some();
                    let problem =
                        if both { "has stepover_mm and scallop_mm" } else { "has no stepover_mm or scallop_mm" };
                    return refuse(problem.into(), "exactly one of them");
                }
                _ => {}
            }
        }
        Ok(())
    }
}
