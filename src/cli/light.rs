//! `screenmill light`: where the light of a surface goes, against the design it was made from.

use std::path::PathBuf;

use screenmill::pipeline::{self, Lit, Relit};
use screenmill::report::light_picture;
use screenmill::report::picture::{Caption, write_png};
use screenmill::report::{self, Light, write_json};
use serde_json::{Value, json};

use super::console::Console;
use super::staging::Staging;
use super::{Common, Outcome, Refusal};

/// Follows the projector's light from a surface to the audience, against the design
#[derive(clap::Args, Clone, Debug)]
pub struct Arguments {
    /// Designed cells (.npz) of screenmill design
    design: PathBuf,
    /// The surface: heights of the same part (.tif, .npy, .png), e.g. a machined map
    #[arg(long, value_name = "H.tif")]
    surface: PathBuf,
    /// The scene that the cells were designed for
    #[arg(long, value_name = "SCREEN.toml")]
    screen: PathBuf,
    /// Folder for report.json and maps
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Take light to arrive at, and leave from, each cell's centre: directions alone count
    #[arg(long)]
    far_field: bool,
    /// Also light the surface as polishing could leave it, which takes off up to so many um: a model
    #[arg(long, value_name = "UM", value_parser = removal)]
    polish_um: Option<f64>,
    /// Pitch of a height file that carries none
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pixel_mm: Option<f64>,
}

fn removal(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(um) if (0.01..=1000.0).contains(&um) => Ok(um),
        _ => Err("a removal lies in 0.01 .. 1000 um".into()),
    }
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let console = Console::new(common.quiet, common.verbose);
    let case = Relit {
        design: arguments.design.clone(),
        surface: arguments.surface.clone(),
        pixel_mm: arguments.pixel_mm,
        scene: arguments.screen.clone(),
        far_field: arguments.far_field,
        polish_um: arguments.polish_um,
    };
    let lit = pipeline::relit(&case, &console)?;
    console.times();
    let staging = Staging::beside(&arguments.out)?;
    draw(&lit, arguments, &staging.path().join("maps"))?;
    let report = written(&lit, arguments);
    write_json(&staging.path().join("report.json"), &report)?;
    staging.publish(&["report.json", "maps"])?;
    if common.json {
        println!("{report}");
    } else {
        print(&lit);
    }
    Ok(Outcome::Within)
}

fn written(lit: &Lit, arguments: &Arguments) -> Value {
    let lattice = &lit.lattice;
    let planes = &lit.by_planes;
    json!({
        "schema": report::schema::SCHEMA, "screenmill": env!("CARGO_PKG_VERSION"),
        "part": {
            "width_mm": lattice.width_mm, "height_mm": lattice.height_mm, "columns": lattice.columns,
            "rows": lattice.rows, "step_mm": lattice.step_mm,
        },
        "far_field": arguments.far_field,
        "light": lit.light,
        "design_by_planes": {
            "on_audience": planes.on_audience, "leak": planes.leak, "absorbed": planes.absorbed,
        },
        "maps": { "lost": "maps/light-lost.png", "room": "maps/light-room.png" },
        "notes": lit.notes,
    })
}

fn draw(lit: &Lit, arguments: &Arguments, maps: &std::path::Path) -> Result<(), Refusal> {
    std::fs::create_dir_all(maps)
        .map_err(|source| pipeline::Error::OutputFolder { path: maps.into(), source })?;
    let part = arguments.surface.display().to_string();
    let light = &lit.light;
    let notes = vec![
        format!(
            "on the audience {:.2} % of what falls (the design {:.2} %), beside it {:.2} % ({:.2} %)",
            100.0 * light.on_audience_machined,
            100.0 * light.on_audience_designed,
            100.0 * light.leak_machined,
            100.0 * light.leak_designed
        ),
        format!(
            "normals by central differences every {} um; {}",
            1e3 * lit.lattice.step_mm,
            if arguments.far_field {
                "far field from each cell's centre"
            } else {
                "true places on the screen"
            }
        ),
    ];
    let caption = Caption { part, notes, ..Caption::default() };
    let [design, cut] = &lit.maps;
    let lost = light_picture::lost(&design.means(), &cut.means());
    let pitch_mm = lit.lattice.step_mm * cut.factor as f64;
    let frame = light_picture::Frame { columns: cut.columns, rows: cut.rows, pitch_mm };
    let picture = light_picture::loss(&frame, &lost, &caption);
    write_png(&maps.join("light-lost.png"), &picture)?;
    let [before, after] = &lit.tallies;
    let room = pipeline::room_picture(&lit.scene, lit.middle_m, before, after, &caption);
    write_png(&maps.join("light-room.png"), &room)?;
    Ok(())
}

fn print(lit: &Lit) {
    let Light {
        on_audience_designed,
        on_audience_machined,
        leak_designed,
        leak_machined,
        absorbed_designed,
        absorbed_machined,
        unresolved_designed,
        unresolved_machined,
        gain_designed,
        gain_machined,
        uniformity_designed,
        uniformity_machined,
        screen_uniformity_designed,
        screen_uniformity_machined,
        ..
    } = lit.light;
    println!("{:<22} {:>10} {:>10}", "of the incident light", "design", "as cut");
    for (name, before, after) in [
        ("on the audience", on_audience_designed, on_audience_machined),
        ("beside it", leak_designed, leak_machined),
        ("absorbed", absorbed_designed, absorbed_machined),
        ("not followed", unresolved_designed, unresolved_machined),
    ] {
        println!("{name:<22} {:>8.3} % {:>8.3} %", 100.0 * before, 100.0 * after);
    }
    for (name, before, after) in [
        ("gain", gain_designed, gain_machined),
        ("uniformity, audience", uniformity_designed, uniformity_machined),
        ("uniformity, screen", screen_uniformity_designed, screen_uniformity_machined),
    ] {
        if let (Some(before), Some(after)) = (before, after) {
            println!("{name:<22} {before:>10.3} {after:>10.3}");
        }
    }
    if let Some(polished) = &lit.light.polished {
        println!(
            "polished by a model, up to {} um: {:.3} % on the audience, {:.3} % beside it",
            polished.removal_um,
            100.0 * polished.on_audience,
            100.0 * polished.leak
        );
    }
    if let Some(error) = lit.light.standard_error {
        println!(
            "directions are drawn from the metal's lobe: standard error of the share at most {:.4} %",
            100.0 * error
        );
    }
    let planes = &lit.by_planes;
    println!(
        "the design by its planes, mirrors: {:.3} % of the reflected light on the audience",
        100.0 * planes.on_audience / (planes.on_audience + planes.leak)
    );
    for note in &lit.notes {
        println!("note: {note}");
    }
}
