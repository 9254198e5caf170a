//! `screenmill evaluate`: what a screen does for its audience, as the paper's section 5.2 shows it.

use std::path::PathBuf;

use screenmill::evaluation::evaluate;
use screenmill::progress::Progress;
use screenmill::report::{evaluation, write_json};
use screenmill::screen::Scene;
use serde_json::json;

use super::console::Console;
use super::staging::Staging;
use super::{Common, Outcome, Refusal};

/// The paper's figures for a scene: gain, uniformity, views from the audience, tolerance to misalignment
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// The scene
    #[arg(value_name = "SCREEN.toml")]
    scene: PathBuf,
    /// Folder for evaluation.html, evaluation.json, figures and data
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let scene = Scene::read(&arguments.scene)?;
    let console = Console::new(common.quiet, common.verbose);
    let staging = Staging::beside(&arguments.out)?;
    let interrupted = || screenmill::pipeline::Error::Interrupted;
    let found = evaluate(&scene, &console)?.ok_or_else(interrupted)?;
    console.begin("figures", 1);
    let title = arguments.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut files = evaluation::write(staging.path(), &title, &found).map_err(|e| staging.named(e))?;
    if console.interrupted() {
        return Err(interrupted().into());
    }
    files.push("evaluation.json".into());
    let (audience_gain, audience_deviation) = found.map.inside_spread();
    let report = json!({
        "schema": 1, "screenmill": env!("CARGO_PKG_VERSION"), "title": title,
        "claims": found.claims,
        "flat": found.flat,
        "elevated": found.elevated.then_some(found.calibration.figures),
        "gain": { "within_audience": found.gain_within, "curves": found.curves },
        "seats": found.views, "all_audiences": found.pictures,
        "audience": { "height_m": found.map.height_m, "mean_gain": audience_gain, "deviation": audience_deviation },
        "misalignment": found.tolerance, "acuity": found.acuity, "files": files,
    });
    write_json(&staging.path().join("evaluation.json"), &report).map_err(|e| staging.named(e))?;
    staging.publish(&["figures", "data", "evaluation.html", "evaluation.json"])?;
    console.times();
    if common.json {
        println!("{report}");
    } else {
        for claim in &found.claims {
            println!("paper: {}", claim.paper);
            println!("here:  {}", claim.here);
        }
        println!("{}", arguments.out.join("evaluation.html").display());
    }
    Ok(Outcome::Within)
}
