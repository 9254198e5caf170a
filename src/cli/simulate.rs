//! `screenmill simulate PROGRAM...`: any programs read back, cut, and compared with a part.

use std::path::{Path, PathBuf};

use screenmill::cutter::{ParseError, Shape};
use screenmill::fidelity::{self, Figures, Layers, Tally};
use screenmill::grid::{Lattice, Window};
use screenmill::machine::Machine;
use screenmill::progress::Progress;
use screenmill::report::{self, Fidelity, Finding, GougeBudget, Severity, finding};
use screenmill::surface::{self, HeightWriter, Opened, Surface};
use screenmill::verify::{Blank, Judged, Kinematics, ProgramCut, sweep, time};
use serde_json::{Value, json};

use super::console::Console;
use super::program::{clock, length, read, reading_options, unread};
use super::simulated::Program;
use super::{Common, Outcome, Refusal};

/// A gouge past this fails.
const GOUGE_LIMIT_MM: f64 = 0.002;
/// A gouged part whose half is off by more than this is not what the programs were made for.
const OFF_MM: f64 = 0.01;
/// Samples of a band: 32 MiB of floats a layer.
const BAND_SAMPLES: usize = 1 << 23;
/// The step of a part that has no samples of its own.
const STEP_MM: f64 = 0.01;

/// Reads programs back, cuts them in simulation and compares the cut with a part
#[derive(clap::Args, Clone, Debug)]
pub struct Arguments {
    /// Programs in G-code or RML-1, in the order they run
    #[arg(required_unless_present = "cutters", value_name = "PROGRAM")]
    programs: Vec<PathBuf>,
    /// One cutter a program, in their order, e.g. ball:1; programs may follow their cutters
    #[arg(long = "cutter", required = true, num_args = 1.., value_delimiter = ',', value_name = "C")]
    cutters: Vec<String>,
    /// What the cut should be
    #[arg(long, value_name = "H.tif")]
    part: PathBuf,
    /// Folder for machined.tif, deviation.tif and report.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The programs' zero in the part's frame; its lower left corner at the stock's top if left out
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true)]
    zero: Option<Vec<f64>>,
    /// Top of the stock in the part's frame; the part's highest point if left out
    #[arg(long, value_name = "Z", allow_hyphen_values = true)]
    stock_top_mm: Option<f64>,
    /// Machine profile, for times and travel: a name or a file
    #[arg(long, value_name = "NAME")]
    machine: Option<String>,
    /// Distance of the samples; the part's own if left out, else 0.01
    #[arg(long, value_name = "S")]
    step_mm: Option<f64>,
    /// Pitch of a height file that carries none
    #[arg(long, value_name = "S")]
    pixel_mm: Option<f64>,
}

/// Why a simulation was refused.
#[derive(Debug, thiserror::Error)]
enum Refused {
    #[error(
        "{programs} programs and {cutters} cutters; hint: --cutter takes one cutter per program, in their order"
    )]
    Cutters { programs: usize, cutters: usize },
    #[error("--cutter {value} names no file, and as a cutter: {source}")]
    Cutter { value: String, source: ParseError },
    #[error(
        "{after} stands after --cutter and {before} does not, so which runs first is not clear; hint: all programs before --cutter"
    )]
    Order { before: String, after: String },
    #[error("{what} names {value} mm; hint: it must lie in -100000 .. 100000")]
    Far { what: &'static str, value: f64 },
    #[error("{path}: {source}; hint: --out names a folder that can be written")]
    Folder { path: PathBuf, source: std::io::Error },
    #[error("{path}: no sample has data; hint: is this the right part?")]
    NoData { path: PathBuf },
    #[error("interrupted; nothing was written")]
    Interrupted,
}

/// What was measured.
struct Judgement {
    lattice: Lattice,
    bottom_mm: f64,
    top_mm: f64,
    zero_mm: [f64; 3],
    stock_top_mm: f64,
    figures: Figures,
    /// Samples of the part that no program lowered.
    uncut: u64,
    programs: Vec<Program>,
    findings: Vec<Finding>,
    notes: Vec<String>,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let console = Console::new(common.quiet, common.verbose);
    let judgement = judge(arguments, &console)?;
    console.times();
    let failed = judgement.findings.iter().any(|f| f.severity == Severity::Error);
    let report = written(&judgement, failed);
    report::write_json(&arguments.out.join("report.json"), &report)?;
    if common.json {
        println!("{report}");
    } else {
        print(&judgement, failed);
    }
    Ok(if failed { Outcome::Found } else { Outcome::Within })
}

/// Programs and cutters: `--cutter` takes all that follows it up to the next flag, programs included.
fn told_apart(arguments: &Arguments) -> Result<(Vec<PathBuf>, Vec<Shape>), Refused> {
    let (mut after, mut cutters) = (Vec::new(), Vec::new());
    for value in &arguments.cutters {
        match value.parse::<Shape>() {
            Ok(shape) => cutters.push(shape),
            Err(_) if Path::new(value).exists() => after.push(PathBuf::from(value)),
            Err(source) => return Err(Refused::Cutter { value: value.clone(), source }),
        }
    }
    match (arguments.programs.first(), after.first()) {
        (Some(before), Some(after)) => {
            let [before, after] = [before, after].map(|path| path.display().to_string());
            Err(Refused::Order { before, after })
        }
        (None, _) => Ok((after, cutters)),
        (Some(_), None) => Ok((arguments.programs.clone(), cutters)),
    }
}

fn judge(arguments: &Arguments, console: &Console) -> Result<Judgement, Refusal> {
    let part = &arguments.part;
    let (programs, cutters) = told_apart(arguments)?;
    if programs.len() != cutters.len() {
        return Err(Refused::Cutters { programs: programs.len(), cutters: cutters.len() }.into());
    }
    let machine = arguments.machine.as_deref().map(|name| Machine::find(name, None)).transpose()?;
    let step_mm = match arguments.step_mm {
        Some(step_mm) => step_mm,
        None => surface::pitch_mm(part, arguments.pixel_mm)?.unwrap_or(STEP_MM),
    };
    let options = surface::Options { pixel_mm: arguments.pixel_mm, ..surface::Options::at_step(step_mm) };
    let Opened { surface, notes, .. } = surface::open(part, &options)?;
    let (lattice, top_mm, bottom_mm) = (surface.lattice(), surface.top_mm(), surface.bottom_mm());
    if !top_mm.is_finite() {
        return Err(Refused::NoData { path: part.clone() }.into());
    }
    let stock_top_mm = arguments.stock_top_mm.unwrap_or(top_mm);
    let zero_mm = arguments.zero.as_ref().map_or([0.0, 0.0, stock_top_mm], |z| [z[0], z[1], z[2]]);
    for (what, value) in
        zero_mm.map(|value| ("--zero", value)).into_iter().chain([("--stock-top-mm", stock_top_mm)])
    {
        if !(-1e5..=1e5).contains(&value) {
            return Err(Refused::Far { what, value }.into());
        }
    }
    let read_as = machine.as_ref().map(reading_options).transpose()?.unwrap_or_default();
    console.begin("read programs", programs.len() as u64);
    let mut readings = Vec::new();
    for path in &programs {
        readings.push(read(path, &read_as)?);
        console.advance(1);
    }
    let blank = Blank {
        low_mm: [0.0; 2],
        high_mm: [lattice.columns as f64 * step_mm, lattice.rows as f64 * step_mm],
        top_mm: stock_top_mm,
    };
    let judged: Vec<Judged> =
        readings.iter().zip(&cutters).map(|(reading, shape)| Judged::new(reading, *shape, zero_mm)).collect();
    std::fs::create_dir_all(&arguments.out)
        .map_err(|source| Refused::Folder { path: arguments.out.clone(), source })?;
    let cut = cut(surface.as_ref(), &judged, &blank, &arguments.out, console)?;
    let lateral: Vec<_> = judged.iter().map(|j| j.lateral_rapid(&blank)).collect();
    let worked: Vec<_> = judged.iter().map(Judged::worked_mm).collect();
    let feeds: Vec<_> = judged.iter().map(Judged::feeds).collect();
    let mut findings = Vec::new();
    let mut told = Vec::new();
    for (index, reading) in readings.into_iter().enumerate() {
        let program = Program {
            file: programs[index].display().to_string(),
            cutter: cutters[index],
            extent: reading.extent(),
            timing: machine.as_ref().map(|machine| time(&reading, &Kinematics::from(machine))),
            reading,
            worked_mm: worked[index],
            cut: cut.programs[index],
        };
        program.findings(&blank, zero_mm, &mut findings);
        if let Some(rapid) = lateral[index]
            && program.cut.rapid.is_none()
        {
            let message = format!(
                "{} line {}: a rapid in X or Y passes {:.4} mm below the stock's top, where nothing is left to hit",
                program.file, rapid.line, rapid.below_mm
            );
            findings.push(finding(Severity::Warning, "rapid-below-top", message).at(&rapid.from_mm));
        }
        if let Some(machine) = &machine {
            if let Some(unread) = unread(program.reading.summary.language, machine)? {
                let message = format!("{} {unread}", program.file);
                findings.push(finding(Severity::Warning, "language", message));
            }
            program.travel(machine, &mut findings);
            program.too_fast(machine, &feeds[index], &mut findings);
        }
        told.push(program);
    }
    let figures = cut.tally.figures();
    let judgement = Judgement {
        lattice,
        bottom_mm,
        top_mm,
        zero_mm,
        stock_top_mm,
        figures,
        uncut: cut.uncut,
        programs: told,
        findings,
        notes,
    };
    Ok(judgement.concluded())
}

/// What the cut of a whole part leaves behind.
struct Cut {
    tally: Tally,
    programs: Vec<ProgramCut>,
    uncut: u64,
}

/// Cuts band by band and writes the maps; both get their names when both are whole.
fn cut(
    surface: &dyn Surface,
    judged: &[Judged],
    blank: &Blank,
    out: &Path,
    console: &Console,
) -> Result<Cut, Refusal> {
    let lattice = surface.lattice();
    let step_mm = lattice.step_mm;
    // Heights are held less the part's top, so that a float keeps its nanometres.
    let datum_mm = surface.top_mm();
    let writer = |name: &str| {
        HeightWriter::create(&out.join(name), lattice.columns, lattice.rows, step_mm, [0.0, 1.0])
    };
    let (mut machined_file, mut deviation_file) = (writer("machined.tif")?, writer("deviation.tif")?);
    let mut cut = Cut {
        tally: Tally::new(fidelity::Params { step_mm, limit_mm: None }),
        programs: vec![ProgramCut::default(); judged.len()],
        uncut: 0,
    };
    let rows = (BAND_SAMPLES / lattice.columns.max(1)).clamp(16, 2048).min(lattice.rows);
    console.begin("cut", lattice.rows as u64);
    for first in (0..lattice.rows).step_by(rows) {
        if console.interrupted() {
            return Err(Refused::Interrupted.into());
        }
        let band = Window { row: first as i64, rows: rows.min(lattice.rows - first), ..lattice.window() };
        // One row of neighbours for the normals.
        let around = Window { row: band.row - 1, rows: band.rows + 2, ..band };
        let design = surface.heights(around, datum_mm)?;
        let stock = blank.heights(around, step_mm, datum_mm);
        let mut swept = sweep(stock, step_mm, datum_mm, judged);
        for (total, part) in cut.programs.iter_mut().zip(&swept.programs) {
            total.merge(part);
        }
        let machined = &mut swept.heights;
        let top = (blank.top_mm - datum_mm) as f32;
        for (z, wanted) in machined.z_mm.iter_mut().zip(&design.z_mm) {
            if wanted.is_nan() {
                *z = f32::NAN;
            }
        }
        cut.tally.add(band, Layers { design: &design, machined, cavity: None, passes: None })?;
        let (mut heights, mut deviation) = (machined.crop(band), machined.crop(band));
        let wanted = design.crop(band);
        for (deviation, wanted) in deviation.z_mm.iter_mut().zip(&wanted.z_mm) {
            *deviation = (f64::from(*deviation) - f64::from(*wanted)) as f32;
        }
        for z in &mut heights.z_mm {
            cut.uncut += u64::from(*z == top);
            *z = (f64::from(*z) + datum_mm) as f32;
        }
        machined_file.write(&heights)?;
        deviation_file.write(&deviation)?;
        console.advance(band.rows as u64);
    }
    machined_file.finish()?;
    deviation_file.finish()?;
    Ok(cut)
}

impl Judgement {
    /// Adds what the whole shows: gouge, and stock that no program reached.
    fn concluded(mut self) -> Judgement {
        let figures = &self.figures;
        if figures.gouge_max_mm > GOUGE_LIMIT_MM {
            let at = figures.gouge_where_mm.unwrap_or_default();
            let message = format!(
                "the cut goes {:.4} mm below the part at x {:.3}, y {:.3}, the limit is {GOUGE_LIMIT_MM} mm",
                figures.gouge_max_mm, at[0], at[1]
            );
            self.findings.insert(0, finding(Severity::Error, "gouge", message).at(&at));
            if let Some(half_mm) = figures.deviation_p50_mm.filter(|half_mm| *half_mm > OFF_MM) {
                let message = format!(
                    "half of the part is off by more than {half_mm:.4} mm and some of it gouged; hint: another cutter, another --zero or \
                     another part than the programs were made for?"
                );
                self.findings.push(finding(Severity::Warning, "another-job", message));
            }
        }
        let share = self.uncut as f64 / figures.samples.max(1) as f64;
        if self.stock_top_mm > self.top_mm && share > 0.02 || share > 0.5 {
            let message = format!(
                "{:.1} % of the part were left at the stock's top; hint: a program of another part or another origin?",
                100.0 * share
            );
            self.findings.push(finding(Severity::Warning, "stock-left", message));
        }
        self
    }
}

fn written(judgement: &Judgement, failed: bool) -> Value {
    let Judgement { lattice, programs, .. } = judgement;
    // What text alone tells of the budget is the path tolerance it asks for.
    let controller = programs.iter().map(Program::path_tolerance_mm).fold(0.0, f64::max);
    let budget = GougeBudget { controller, ..GougeBudget::default() };
    let total: Option<f64> = programs.iter().map(|p| p.timing.map(|t| t.total_s)).sum();
    json!({
        "schema": report::schema::SCHEMA, "screenmill": env!("CARGO_PKG_VERSION"),
        "verdict": if failed { "fail" } else { "pass" },
        "part": {
            "width_mm": lattice.width_mm, "height_mm": lattice.height_mm, "columns": lattice.columns,
            "rows": lattice.rows, "step_mm": lattice.step_mm, "z_min_mm": judgement.bottom_mm,
            "z_max_mm": judgement.top_mm,
        },
        "program_zero_mm": judgement.zero_mm, "stock_top_mm": judgement.stock_top_mm,
        "programs": programs.iter().map(Program::written).collect::<Vec<_>>(),
        "maps": { "machined": "machined.tif", "deviation": "deviation.tif" },
        "fidelity": Fidelity::of(&judgement.figures, budget, None),
        "time_s": { "total": total },
        "findings": judgement.findings, "notes": judgement.notes,
    })
}

fn print(judgement: &Judgement, failed: bool) {
    let Judgement { lattice, figures, .. } = judgement;
    println!("{}", if failed { "FAIL" } else { "pass" });
    println!(
        "part {:.3} x {:.3} mm, {} x {} samples at {} mm",
        lattice.width_mm, lattice.height_mm, lattice.columns, lattice.rows, lattice.step_mm
    );
    println!(
        "gouge {:.4} mm (limit {GOUGE_LIMIT_MM}), excess {:.4} mm",
        figures.gouge_max_mm, figures.excess_max_mm
    );
    if let (Some(p50), Some(p99)) = (figures.deviation_p50_mm, figures.deviation_p99_mm) {
        println!("deviation: half within {p50:.4} mm, 99 % within {p99:.4} mm");
    }
    if let (Some(p50), Some(p95)) = (figures.normal_p50_deg, figures.normal_p95_deg) {
        println!("normals: half within {p50:.2} degrees, 95 % within {p95:.2}");
    }
    for program in &judgement.programs {
        let Program { file, cutter, extent, timing, cut, .. } = program;
        let time = timing.map_or(String::new(), |t| format!(", {}", clock(t.total_s)));
        println!(
            "{file}, {cutter}: {} cutting, {} rapids, deepest bite {:.4} mm{time}",
            length(extent.cutting_mm),
            length(extent.rapid_mm),
            cut.deepest_bite_mm()
        );
    }
    for finding in &judgement.findings {
        let severity = match finding.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        println!("{severity}: {}", finding.message);
    }
    for note in &judgement.notes {
        println!("note: {note}");
    }
}
