use std::path::{Path, PathBuf};

use screenmill::job::Job;
use screenmill::pipeline;
use screenmill::report::{Severity, Verdict, write_json};

use super::console::Console;
use super::staging::Staging;
use super::{Common, Outcome, Refusal};

/// What a job writes, and so what it replaces.
const OUTPUTS: [&str; 10] = [
    "programs",
    "rejected",
    "maps",
    "report.json",
    "report.html",
    "setup-sheet.html",
    "screen-map.svg",
    "run.json",
    "cavities.csv",
    "cavities.geojson",
];

/// Cut a job: programs, proved, with maps, report and setup sheet
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// The job file, e.g. samples/quickstart/job.toml
    job: PathBuf,
    /// Folder for programs, maps and report; what a job wrote there before is replaced
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let job = Job::read(&arguments.job)?;
    let folder = arguments.job.parent().unwrap_or(Path::new("")).to_path_buf();
    let staging = Staging::beside(&arguments.out)?;
    let console = Console::new(common.quiet, common.verbose);
    let milled = pipeline::mill(&job, &folder, staging.path(), &console)?;
    let times = console.times();
    let stages: serde_json::Map<String, serde_json::Value> =
        times.iter().map(|(name, time)| (name.clone(), time.as_secs_f64().into())).collect();
    let run = serde_json::json!({
        "schema": 1,
        "screenmill": env!("CARGO_PKG_VERSION"),
        "threads": rayon::current_num_threads(),
        "wall_s": console.wall().as_secs_f64(),
        "stages_s": stages,
    });
    write_json(&staging.path().join("run.json"), &run)?;
    staging.publish(&OUTPUTS)?;
    let report = &milled.report;
    if common.json {
        println!("{}", serde_json::to_string(report)?);
    } else {
        print(&milled, &arguments.out);
    }
    Ok(if report.verdict == Verdict::Pass { Outcome::Within } else { Outcome::Found })
}

fn print(milled: &pipeline::Milled, out: &Path) {
    let report = &milled.report;
    let part = &report.part;
    println!(
        "part      {:.3} x {:.3} mm, {} x {} samples of {} mm, {:.3} mm deep, {} tile{}",
        part.width_mm,
        part.height_mm,
        part.columns,
        part.rows,
        part.step_mm,
        -part.z_min_mm,
        report.tiles.len(),
        if report.tiles.len() == 1 { "" } else { "s" }
    );
    for program in report.tiles.iter().flat_map(|tile| &tile.programs) {
        println!(
            "program   {}: {} blocks, {} cut, {}, bites {:.3} mm",
            program.file,
            program.blocks,
            super::program::length(program.cutting_mm),
            super::hours(program.time_s),
            program.deepest_bite_mm
        );
    }
    if let Some(fidelity) = &report.fidelity {
        let um = |mm: Option<f64>| mm.map_or("-".into(), |mm| format!("{:.2}", mm * 1e3));
        println!(
            "fidelity  gouge {:.2} um, |deviation| p50 {} p99 {} um, normals p95 {} deg, cavities on {:.2} % of the area",
            fidelity.gouge_max_mm * 1e3,
            um(fidelity.deviation_p50_mm),
            um(fidelity.deviation_p99_mm),
            fidelity.normal_p95_deg.map_or("-".into(), |deg| format!("{deg:.2}")),
            100.0 * fidelity.cavity_area_fraction.unwrap_or_default()
        );
    }
    if let Some(light) = &report.light {
        println!(
            "light     on the audience {:.4} (design {:.4}), leak {:.4} (design {:.4})",
            light.on_audience_machined, light.on_audience_designed, light.leak_machined, light.leak_designed
        );
    }
    println!("time      {}", super::hours(report.time_s.total));
    for finding in &report.findings {
        let word = match finding.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        let tile = finding.tile.as_deref().map(|tile| format!("{tile}: ")).unwrap_or_default();
        println!("{word:<9} {tile}{}", finding.message);
    }
    for command in &milled.simulate {
        println!("check     {}", command.replace("{out}", &out.display().to_string()));
    }
    let verdict = if report.verdict == Verdict::Pass { "pass" } else { "fail" };
    println!("verdict   {verdict}; {}", out.join("report.html").display());
}
