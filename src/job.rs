//! The job file: what is cut, from what, on which machine, with which operations. Every key is checked
//! when it is read; an unknown one is an error.

mod operation;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;

pub use operation::{Face, Kind, Operation, Pattern, Place};

use crate::catalogue;
use crate::settings::{self, Source};

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
    pub polish: Option<Polish>,
    #[serde(default, rename = "operation")]
    pub operations: Vec<Operation>,
    /// What programs and pages call the part: the job's folder and file name.
    #[serde(skip)]
    pub name: String,
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
    pub unit: Option<Unit>,
    /// Axis of a mesh that points out of the stock: "x", "y" or "z".
    pub up: Option<Up>,
    pub z_min_mm: Option<f64>,
    pub z_max_mm: Option<f64>,
}

fn ten_micrometres() -> f64 {
    0.010
}

/// Unit of a mesh's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    Mm,
    M,
    Inch,
}

/// Axis of a mesh that points out of the stock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    X,
    Y,
    Z,
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

/// A model of polishing by hand, whose light is reported beside that of the cut.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Polish {
    /// Most that is taken off.
    pub removal_um: f64,
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

/// Why a job was refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Settings(#[from] settings::Error),
    #[error("{path}: [part] names {found} of screen, design, mesh and heights; hint: exactly one")]
    Source { path: String, found: usize },
    #[error("{path}: [part] {key} goes with {with} only; hint: {hint}")]
    Misplaced { path: String, key: &'static str, with: &'static str, hint: &'static str },
    #[error("{path}:{line}: {key} = \"{file}\" {problem}; hint: a path is taken from the job's folder")]
    File { path: String, line: usize, key: &'static str, file: String, problem: String },
    #[error("{path}:{line}: {source}")]
    Named { path: String, line: usize, source: catalogue::Error },
    #[error("{path}: no [[operation]]; hint: a job needs at least one, see samples/quickstart/job.toml")]
    NoOperation { path: String },
    #[error("{path}:{line}: operation {number} ({kind}) {problem}; hint: {hint}")]
    Operation {
        path: String,
        line: usize,
        number: usize,
        kind: &'static str,
        problem: &'static str,
        hint: &'static str,
    },
    #[error("{path}:{line}: cells {cells:?} hold nothing; hint: C0 R0 C1 R1 with C0 < C1 and R0 < R1")]
    Cells { path: String, line: usize, cells: [i32; 4] },
}

impl Job {
    /// Reads and checks a job; paths in it come back resolved against its folder.
    pub fn read(path: &Path) -> Result<Job, Error> {
        let source = Source::read(path)?;
        let mut job: Job = source.parse()?;
        job.check(&source)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        job.name = name_of(path);
        let part = &mut job.part;
        let files = [
            ("part.screen", &mut part.screen),
            ("part.design", &mut part.design),
            ("part.mesh", &mut part.mesh),
            ("part.heights", &mut part.heights),
            ("part.elevation", &mut part.elevation),
            ("tools.library", &mut job.tools.library),
        ];
        for (key, file) in files {
            let Some(file) = file else { continue };
            if key == "tools.library" && catalogue::is_name(&file.display().to_string()) {
                continue;
            }
            let resolved = folder.join(&*file);
            let problem = match std::fs::metadata(&resolved) {
                Err(error) if error.kind() == ErrorKind::NotFound => Some("is not there".into()),
                Err(error) => Some(format!("cannot be read: {error}")),
                Ok(found) if found.is_dir() => Some("is a folder".into()),
                Ok(_) => None,
            };
            if let Some(problem) = problem {
                let (path, line) = (source.path().into(), source.line_of(key));
                let file = file.display().to_string();
                return Err(Error::File { path, line, key, file, problem });
            }
            *file = resolved;
        }
        job.check_names(&source, folder)?;
        Ok(job)
    }

    /// Refuses names of machine, fixture and posts that nothing has.
    fn check_names(&self, source: &Source, folder: &Path) -> Result<(), Error> {
        let named = [
            ("machine.name", catalogue::Kind::Machine, &self.machine.name),
            ("machine.fixture", catalogue::Kind::Fixture, &self.machine.fixture),
        ];
        let posts =
            self.machine.post.iter().flatten().map(|post| ("machine.post", catalogue::Kind::Dialect, post));
        for (key, kind, name) in named.into_iter().chain(posts) {
            if let Err(unknown @ catalogue::Error::Unknown { .. }) = catalogue::find(kind, name, Some(folder))
            {
                let (path, line) = (source.path().into(), source.line_of(key));
                return Err(Error::Named { path, line, source: unknown });
            }
        }
        Ok(())
    }

    fn check(&self, source: &Source) -> Result<(), Error> {
        source.schema(self.schema, 1)?;
        self.check_part(source)?;
        self.check_ranges(source)?;
        let known = ["G54", "G55", "G56", "G57", "G58", "G59"];
        if !known.contains(&self.machine.wcs.as_str()) {
            return Err(source.unknown_value("machine.wcs", &self.machine.wcs, &known).into());
        }
        if self.operations.is_empty() {
            return Err(Error::NoOperation { path: source.path().into() });
        }
        for (index, operation) in self.operations.iter().enumerate() {
            operation.check(source, index)?;
        }
        self.check_order(source)
    }

    /// Refuses operations that a blank cannot take, and an underside that is cut after the top.
    fn check_order(&self, source: &Source) -> Result<(), Error> {
        let (mut top, mut finished) = (false, false);
        for (index, operation) in self.operations.iter().enumerate() {
            let problem = if self.stock.blanks == Blanks::One && operation.kind.beside() {
                Some(("goes with blanks = \"per-tile\" only", "a tile of one sheet has no blank of its own"))
            } else if operation.face == Face::Underside && top {
                Some((
                    "cuts the underside after the top has been cut",
                    "put it before them: the blank would lie on its finished face",
                ))
            } else if operation.kind == Kind::Rest && !finished {
                Some((
                    "has no finish before it that leaves no stock",
                    "it goes where the cutters before it could not reach",
                ))
            } else {
                None
            };
            finished |= operation.finishes();
            if let Some((problem, hint)) = problem {
                return Err(operation.refusal(source, index, problem, hint));
            }
            top |= operation.kind.shapes() || operation.kind == Kind::CutOut;
        }
        Ok(())
    }

    fn check_part(&self, source: &Source) -> Result<(), Error> {
        let path = || source.path().to_string();
        let part = &self.part;
        let sources = [&part.screen, &part.design, &part.mesh, &part.heights];
        let found = sources.iter().filter(|source| source.is_some()).count();
        if found != 1 {
            return Err(Error::Source { path: path(), found });
        }
        let (mesh, heights) = (part.mesh.is_some(), part.heights.is_some());
        let (screen, level) = (part.screen.is_some(), part.level == Level::Plane);
        let designed = screen || part.design.is_some();
        let leave_out = "leave it out";
        let level_hint = "level the height image where it is made";
        let placed = [
            ("cells", part.cells.is_some(), designed, "screen or design", leave_out),
            ("elevation", part.elevation.is_some(), screen, "screen", leave_out),
            ("unit", part.unit.is_some(), mesh, "mesh", leave_out),
            ("up", part.up.is_some(), mesh, "mesh", leave_out),
            ("pixel_mm", part.pixel_mm.is_some(), heights, "heights", leave_out),
            ("z_min_mm", part.z_min_mm.is_some(), heights, "heights", leave_out),
            ("z_max_mm", part.z_max_mm.is_some(), heights, "heights", leave_out),
            ("level = \"plane\"", level, !heights, "screen, design or mesh", level_hint),
        ];
        for (key, given, allowed, with, hint) in placed {
            if given && !allowed {
                return Err(Error::Misplaced { path: path(), key, with, hint });
            }
        }
        match part.cells {
            Some(cells) if cells[0] >= cells[2] || cells[1] >= cells[3] => {
                Err(Error::Cells { path: path(), line: source.line_of("part.cells"), cells })
            }
            _ => Ok(()),
        }
    }

    fn check_ranges(&self, source: &Source) -> Result<(), Error> {
        let (part, stock, limits) = (&self.part, &self.stock, &self.limits);
        let ranges = [
            ("part.step_mm", Some(part.step_mm), 0.001, 1.0),
            ("part.pixel_mm", part.pixel_mm, 1e-4, 100.0),
            ("stock.thickness_mm", Some(stock.thickness_mm), 0.1, 500.0),
            ("stock.top_allowance_mm", Some(stock.top_allowance_mm), 0.0, 50.0),
            ("stock.margin_mm", Some(stock.margin_mm), 0.0, 200.0),
            ("stock.min_floor_mm", Some(stock.min_floor_mm), 0.0, stock.thickness_mm),
            ("machine.clearance_mm", Some(self.machine.clearance_mm), 0.1, 200.0),
            ("limits.gouge_mm", limits.gouge_mm, 1e-4, 1.0),
            ("limits.deviation_mm", limits.deviation_mm, 1e-4, 10.0),
            ("limits.normal_p95_deg", limits.normal_p95_deg, 1e-3, 90.0),
            ("limits.on_audience_min", limits.on_audience_min, 0.0, 1.0),
            ("limits.hours_max", limits.hours_max, 1e-6, 1e6),
            ("polish.removal_um", self.polish.map(|polish| polish.removal_um), 0.01, 1000.0),
        ];
        for (key, value, low, high) in ranges {
            if let Some(value) = value {
                source.within(key, value, low, high)?;
            }
        }
        Ok(())
    }
}

/// The file's name, after its folder's where the file is called `job.toml`.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let full = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    match full.parent().and_then(Path::file_name) {
        Some(folder) if stem == "job" => folder.to_string_lossy().into_owned(),
        _ => stem,
    }
}
