//! `screenmill calibrate`: the projector's mask that makes a screen evenly bright.

use std::path::{Path, PathBuf};

use glam::DVec2;
use screenmill::progress::Progress as _;
use screenmill::report::mask::{self, Depth};
use screenmill::screen::{self, Scene};
use screenmill::whole::publish_all;
use serde_json::json;

use super::console::Console;
use super::{Common, Outcome, Refusal};

/// Pixels in a row of a 4K projector.
const FOUR_K: u32 = 4096;
const MOST_PIXELS: u32 = 32_768;

/// The projector's mask (Eq. 9), and the gain by attenuation and by redirection
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// The scene
    #[arg(value_name = "SCREEN.toml")]
    scene: PathBuf,
    /// The mask, 16 bits a pixel; one of 8 bits is put beside it as MASK-8bit.png
    #[arg(long, value_name = "MASK.png")]
    out: PathBuf,
    /// The projector's pixels, columns and rows; square pixels, 4096 in a row, if left out
    #[arg(long, num_args = 2, value_names = ["COLUMNS", "ROWS"])]
    pixels: Option<Vec<u32>>,
    /// What the projector's picture covers of the screen plane, in m; the screen if left out
    #[arg(long, num_args = 4, value_names = ["LEFT", "BOTTOM", "RIGHT", "TOP"], allow_hyphen_values = true)]
    frustum: Option<Vec<f64>>,
    /// For the screen as it is elevated, not the flat one of Eq. 9
    #[arg(long)]
    elevated: bool,
    /// Exponent of the projector from pixel value to light; 1 is a mask in light itself
    #[arg(long, value_name = "G", default_value_t = 1.0)]
    gamma: f64,
}

/// A mask that cannot be made as asked.
#[derive(Debug, thiserror::Error)]
enum Unusable {
    #[error("{path} is not a .png; hint: --out MASK.png")]
    Kind { path: String },
    #[error("{path} cannot be written: {source}; hint: its folder must be writable and have room")]
    Unwritable { path: String, source: std::io::Error },
    #[error("--pixels {columns} {rows}: a mask has 1 to {MOST_PIXELS} columns and rows")]
    Pixels { columns: u32, rows: u32 },
    #[error(
        "--frustum {left} {bottom} {right} {top}: it takes left < right and bottom < top, in m on the screen plane; hint: the screen is {} {} {} {}",
        -screen[0], -screen[1], screen[0], screen[1]
    )]
    Frustum { left: f64, bottom: f64, right: f64, top: f64, screen: [f64; 2] },
    #[error(
        "--frustum {left} {bottom} {right} {top} lies beside the screen, {} {} {} {}; hint: in m on the screen plane, whose centre is 0 0",
        -screen[0], -screen[1], screen[0], screen[1]
    )]
    Beside { left: f64, bottom: f64, right: f64, top: f64, screen: [f64; 2] },
    #[error(
        "--gamma {gamma}: an exponent from 0.1 to 10 is meant; hint: 2.2 for most projectors, 1 for light itself"
    )]
    Gamma { gamma: f64 },
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let scene = Scene::read(&arguments.scene)?;
    let half = [0.5 * scene.width_m, 0.5 * scene.height_m];
    let path = arguments.out.display().to_string();
    if arguments.out.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("png")) {
        return Err(Unusable::Kind { path }.into());
    }
    let given = arguments.frustum.as_deref();
    let [left, bottom, right, top] =
        given.and_then(|f| f.try_into().ok()).unwrap_or([-half[0], -half[1], half[0], half[1]]);
    if !(left < right && bottom < top && [left, bottom, right, top].iter().all(|v| v.is_finite())) {
        return Err(Unusable::Frustum { left, bottom, right, top, screen: half }.into());
    }
    if left >= half[0] || right <= -half[0] || bottom >= half[1] || top <= -half[1] {
        return Err(Unusable::Beside { left, bottom, right, top, screen: half }.into());
    }
    let square =
        (f64::from(FOUR_K) * (top - bottom) / (right - left)).round().clamp(1.0, f64::from(MOST_PIXELS));
    let given = arguments.pixels.as_deref();
    let [columns, rows] = given.and_then(|p| p.try_into().ok()).unwrap_or([FOUR_K, square as u32]);
    if !(1..=MOST_PIXELS).contains(&columns) || !(1..=MOST_PIXELS).contains(&rows) {
        return Err(Unusable::Pixels { columns, rows }.into());
    }
    let gamma = arguments.gamma;
    if !(0.1..=10.0).contains(&gamma) {
        return Err(Unusable::Gamma { gamma }.into());
    }
    let console = Console::new(common.quiet, common.verbose);
    let elevation = if arguments.elevated {
        console.begin("elevation", 1);
        Some(screen::elevation(&scene)?)
    } else {
        None
    };
    console.begin("light that each place needs", 1);
    let calibration = screen::calibrate(&scene, elevation.as_ref())?;
    let pixel = |column: u32, row: u32| {
        let x = left + (right - left) * (f64::from(column) + 0.5) / f64::from(columns);
        let y = top - (top - bottom) * (f64::from(row) + 0.5) / f64::from(rows);
        // Light beside the screen is lost.
        if x.abs() > half[0] || y.abs() > half[1] {
            return 0.0;
        }
        calibration.mask(DVec2::new(x, y)).powf(1.0 / gamma)
    };
    let eight = beside(&arguments.out);
    let mut masks = Vec::new();
    for (path, depth) in [(&eight, Depth::Eight), (&arguments.out, Depth::Sixteen)] {
        let mask = mask::write(path, [columns, rows], depth, &pixel, &console)?;
        masks.push(mask.ok_or(screenmill::pipeline::Error::Interrupted)?);
    }
    // Half a pair is no answer.
    publish_all(masks)
        .map_err(|(path, source)| Unusable::Unwritable { path: path.display().to_string(), source })?;
    console.times();
    let figures = &calibration.figures;
    if common.json {
        let report = json!({
            "schema": 1, "screenmill": env!("CARGO_PKG_VERSION"),
            "file": path, "file_8bit": eight.display().to_string(),
            "columns": columns, "rows": rows, "frustum_m": [left, bottom, right, top], "gamma": gamma,
            "screen": if arguments.elevated { "elevated" } else { "flat" },
            "figures": figures,
        });
        println!("{report}");
    } else {
        println!(
            "Eq. 9 over the {} screen: {:.4} to {:.4} sr, mean {:.4}, centre {:.4}",
            if arguments.elevated { "elevated" } else { "flat" },
            figures.l_min_sr,
            figures.l_max_sr,
            figures.l_mean_sr,
            figures.l_centre_sr
        );
        println!(
            "mask: {:.4} to 1, mean {:.4}, {columns} x {rows} pixels",
            figures.mask_min, figures.mask_mean
        );
        println!(
            "gain: {:.2} by attenuation, {:.2} by redirection ({:+.1} %); {:.2} at the centre without a mask",
            figures.gain_attenuation,
            figures.gain_redirection,
            100.0 * (figures.gain_redirection / figures.gain_attenuation - 1.0),
            figures.gain_uncalibrated_centre
        );
        println!("gain 1 is a matte screen of reflectance 1");
        println!("{path}");
        println!("{}", eight.display());
    }
    Ok(Outcome::Within)
}

/// The name of the mask of 8 bits.
fn beside(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-8bit.png"))
}
