//! `screenmill limits`: does the screen shadow itself, and which place in the audience loses its light first.

use std::path::{Path, PathBuf};

use screenmill::progress::Progress;
use screenmill::report::{design_space, write_json};
use screenmill::screen::{self, Acuity, ElevationMethod, Margins, Plane, Scene};
use serde_json::{Value, json};

use super::console::Console;
use super::staging::Staging;
use super::{Common, Outcome, Refusal};

/// Smallest gap that 20/20 vision sees, in minutes of arc.
const ACUITY_ARCMIN: f64 = 1.0;

/// All that a run may write; what an earlier one left of it goes.
const OUTPUTS: [&str; 9] = [
    "limits.json",
    "design-space.svg",
    "design-space.png",
    "design-space-elevated.svg",
    "design-space-elevated.png",
    "margin.svg",
    "margin.png",
    "margin-elevated.svg",
    "margin-elevated.png",
];

/// How far a screen is from shadowing itself: Eqs. 10 and 11 at every cell
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// The scene
    #[arg(value_name = "SCREEN.toml")]
    scene: PathBuf,
    /// Folder for limits.json, the plot of the design space and the map of margins
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let scene = Scene::read(&arguments.scene)?;
    let console = Console::new(common.quiet, common.verbose);
    let staging = arguments.out.as_deref().map(Staging::beside).transpose()?;
    console.begin("limits of the flat screen", 1);
    let flat = screen::limits(&scene, None)?;
    let mut notes = Vec::new();
    let mut elevated = None;
    if scene.elevation == ElevationMethod::Poisson {
        console.begin("limits of the elevated screen", 1);
        // A screen that breaks the limits may have no elevation: then the flat one is the answer.
        let found = screen::elevation(&scene).and_then(|elevation| screen::limits(&scene, Some(&elevation)));
        match found {
            Ok(margins) => elevated = Some(margins),
            Err(error) => notes.push(format!("the elevated screen could not be judged: {error}")),
        }
    }
    if console.interrupted() {
        return Err(screenmill::pipeline::Error::Interrupted.into());
    }
    let acuity = screen::acuity(&scene);
    notes.push(acuity_sentence(&acuity));
    let (surface, margins) = match &elevated {
        Some(elevated) if tightest(elevated) < tightest(&flat) => ("elevated", elevated),
        _ => ("flat", &flat),
    };
    let within = tightest(margins) >= 0.0;
    let sentence = sentence(surface, margins);
    let title = arguments.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut files = Vec::new();
    if let Some(staging) = &staging {
        console.begin("figures", 1);
        let at = |name: &str| staging.path().join(name);
        let named = |error| staging.named(error);
        let size_m = [scene.width_m, scene.height_m];
        files.extend(design_space::write(&at("design-space"), &title, &flat).map_err(named)?);
        files.extend(design_space::write_map(&at("margin"), &title, &flat, size_m).map_err(named)?);
        if let Some(elevated) = &elevated {
            let title = format!("{title}, elevated");
            files.extend(design_space::write(&at("design-space-elevated"), &title, elevated).map_err(named)?);
            files.extend(
                design_space::write_map(&at("margin-elevated"), &title, elevated, size_m).map_err(named)?,
            );
        }
        files.push("limits.json".into());
    }
    let report = json!({
        "schema": 1, "screenmill": env!("CARGO_PKG_VERSION"),
        "verdict": if within { "pass" } else { "fail" },
        "sentence": sentence, "margin_deg": tightest(margins),
        "flat": flat, "elevated": elevated, "acuity": acuity, "notes": notes, "files": files,
    });
    if let Some(staging) = staging {
        write_json(&staging.path().join("limits.json"), &report).map_err(|e| staging.named(e))?;
        staging.publish(&OUTPUTS)?;
    }
    console.times();
    if common.json {
        println!("{report}");
    } else {
        print(&report, &flat, elevated.as_ref(), arguments.out.as_deref());
    }
    Ok(if within { Outcome::Within } else { Outcome::Found })
}

/// The margin that decides: of Eqs. 10 and 11 over all planes.
fn tightest(margins: &Margins) -> f64 {
    [&margins.any_direction, &margins.horizontal, &margins.vertical]
        .iter()
        .map(|plane| plane.eq10_margin_deg.min(plane.eq11_margin_deg))
        .fold(f64::INFINITY, f64::min)
}

/// Which place breaks first, and by how much.
fn sentence(surface: &str, margins: &Margins) -> String {
    let worst = &margins.any_direction.worst;
    let [x, y, _] = worst.point_m;
    let [cx, cy, cz] = worst.corner_m;
    let margin = margins.any_direction.eq10_margin_deg;
    let corner = format!("({cx}, {cy}, {cz}) m of audience \"{}\"", worst.audience);
    if margin >= 0.0 {
        return format!(
            "no point of the {surface} screen shadows its light; the first to break would be the corner {corner}, \
             lit from ({x:.3}, {y:.3}) m: {margin:.1} degrees of margin"
        );
    }
    let pairs = if margins.facet_pair_deg >= 0.0 {
        format!(
            "; yet no pair of its facets meets its own light ({:.1} degrees to spare), so a surface \
             without steps stays clear",
            margins.facet_pair_deg
        )
    } else {
        String::new()
    };
    format!(
        "the {surface} screen shadows its light at {} of {} cells; the first to break is the corner {corner}, \
         lit from ({x:.3}, {y:.3}) m: {:.1} degrees beyond the limit{pairs}",
        margins.points_broken, margins.points, -margin
    )
}

fn acuity_sentence(acuity: &Acuity) -> String {
    let Acuity { cell_mm, middle_m, middle_arcmin, nearest_arcmin, one_arcmin_m, .. } = acuity;
    let fine = 1e3 * middle_m * (ACUITY_ARCMIN / 60.0).to_radians();
    let seen = format!(
        "a cell of {cell_mm} mm is {middle_arcmin:.2} arcmin wide from the middle of the audience \
         ({middle_m:.2} m), {nearest_arcmin:.2} from its nearest place; 20/20 vision resolves {ACUITY_ARCMIN} arcmin"
    );
    if *nearest_arcmin <= ACUITY_ARCMIN {
        format!("{seen}: nobody sees single cells")
    } else if *middle_arcmin <= ACUITY_ARCMIN {
        format!("{seen}: cells are seen from nearer than {one_arcmin_m:.2} m only")
    } else {
        format!(
            "{seen}: single cells are seen from nearer than {one_arcmin_m:.2} m; cells of {fine:.2} mm would not be \
             from the middle"
        )
    }
}

fn print(report: &Value, flat: &Margins, elevated: Option<&Margins>, out: Option<&Path>) {
    println!(
        "{:<10} {:<18} {:>15} {:>15} {:>15} {:>9} {:>9}",
        "screen", "planes", "alpha", "beta", "gamma", "Eq. 10", "Eq. 11"
    );
    let range = |[low, high]: [f64; 2]| format!("{low:.1} to {high:.1}");
    for (name, margins) in [Some(("flat", flat)), elevated.map(|m| ("elevated", m))].into_iter().flatten() {
        let planes: [(&str, &Plane); 3] = [
            ("along rows", &margins.horizontal),
            ("along columns", &margins.vertical),
            ("worst of any", &margins.any_direction),
        ];
        for (planes, plane) in planes {
            println!(
                "{name:<10} {planes:<18} {:>15} {:>15} {:>15} {:>9.1} {:>9.1}",
                range(plane.alpha_deg),
                range(plane.beta_deg),
                range(plane.gamma_deg),
                plane.eq10_margin_deg,
                plane.eq11_margin_deg
            );
        }
        println!("{name:<10} smallest angle between a ray and a facet: {:.1}", margins.facet_pair_deg);
    }
    println!("degrees; Eq. 10 and Eq. 11: smallest margins, negative where the screen shadows itself");
    println!("{}", report["sentence"].as_str().unwrap_or_default());
    for note in report["notes"].as_array().into_iter().flatten() {
        println!("note: {}", note.as_str().unwrap_or_default());
    }
    if let Some(out) = out {
        for file in report["files"].as_array().into_iter().flatten() {
            println!("{}", out.join(file.as_str().unwrap_or_default()).display());
        }
    }
}
