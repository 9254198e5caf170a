use std::path::{Path, PathBuf};

use screenmill::job::Job;
use screenmill::pipeline::{self, Look, Reach};
use screenmill::report::{Severity, Verdict, write_json};

use super::console::Console;
use super::staging::Staging;
use super::{Common, Outcome, Refusal};

/// What each cutter of the library cannot reach, and the smallest set that will do
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// The job file; its operations are not planned
    job: PathBuf,
    /// Folder for check.json and the maps of what stays unreachable
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Part of the area to look at, in squares of 1024 samples that are spread evenly; figures of less than 1, all of it,
    /// have a standard error. Left out: all of parts up to 64 million samples; of larger ones so many under each
    /// cutter, and all of it under the set that they come to
    #[arg(long, value_name = "FRACTION", value_parser = share)]
    share: Option<f64>,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => Err("a share of the area is above 0 and at most 1, as 0.1".into()),
    }
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let job = Job::read(&arguments.job)?;
    let folder = arguments.job.parent().unwrap_or(Path::new(""));
    let console = Console::new(common.quiet, common.verbose);
    let staging = arguments.out.as_deref().map(Staging::beside).transpose()?;
    let look = arguments.share.map_or_else(Look::default, Look::Share);
    let checked = pipeline::check(&job, folder, staging.as_ref().map(Staging::path), look, &console)?;
    console.times();
    if let Some(staging) = staging {
        write_json(&staging.path().join("check.json"), &checked)?;
        staging.publish(&["check.json", "maps"])?;
    }
    if common.json {
        println!("{}", serde_json::to_string(&checked)?);
    } else {
        println!(
            "{:<14} {:<14} {:>12} {:>10} {:>10} {:>9}  {:>11}",
            "tool", "cutter", "unreachable", "over 1 um", "deepest", "normals", "on audience"
        );
        for reach in &checked.cutters {
            print(&reach.tools.join("+"), reach);
        }
        if let Some(set) = &checked.smallest_set {
            print("smallest set", set);
            println!("smallest set: {}", set.tools.join(", "));
        }
        println!(
            "unreachable: part of the area left more than {} mm too high; normals: 95 % are off by less, in degrees",
            checked.deviation_mm
        );
        if let Some(fraction) = checked.looked_at_fraction {
            let all_under_the_set = arguments.share.is_none() && checked.smallest_set.is_some();
            let errors = checked.cutters.iter().any(|reach| reach.standard_error.is_some());
            println!(
                "{:.1} % of the area was looked at{}: the deepest is the deepest there, and {}",
                100.0 * fraction,
                if all_under_the_set { " under each cutter, all of it under the set" } else { "" },
                if errors {
                    "after +- stands a standard error"
                } else {
                    "one square alone has no standard error"
                }
            );
        }
        for finding in &checked.findings {
            let word = if finding.severity == Severity::Error { "error" } else { "warning" };
            println!("{word}: {}", finding.message);
        }
    }
    Ok(if checked.verdict == Verdict::Pass { Outcome::Within } else { Outcome::Found })
}

fn print(name: &str, reach: &Reach) {
    let light = reach.light.as_ref().map_or("-".into(), |light| {
        format!("{:.4} of {:.4}", light.on_audience_machined, light.on_audience_designed)
    });
    println!(
        "{:<14} {:<14} {:>10.3} % {:>8.2} % {:>7.1} um {:>9}  {:>11}{}",
        name,
        reach.cutters.join("+"),
        100.0 * reach.unreachable_fraction,
        100.0 * reach.cavity_area_fraction,
        1e3 * reach.cavity_max_depth_mm,
        reach.normal_p95_deg.map_or("-".into(), |deg| format!("{deg:.2}")),
        light,
        if reach.refused.is_some() { "  (cannot be used here)" } else { "" }
    );
    if let Some(error) = reach.standard_error {
        let light = error.on_audience_machined.map_or(String::new(), |error| format!("+- {error:.4}"));
        println!(
            "{:<29} {:>10.3} % {:>8.2} % {:>21} {light}",
            "+-",
            100.0 * error.unreachable_fraction,
            100.0 * error.cavity_area_fraction,
            ""
        );
    }
}
