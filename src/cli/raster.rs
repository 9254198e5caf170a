//! `screenmill raster`: a part as a file of heights.

use std::path::PathBuf;

use indicatif::{ProgressBar, ProgressStyle};
use screenmill::grid::{Lattice, Window};
use screenmill::pipeline;
use screenmill::surface::{HeightWriter, Kind, Opened, Surface, open};
use serde_json::json;

use super::part::Part;
use super::{Common, Outcome, Refusal, console};

/// Samples held at once: 32 MiB of floats.
const BAND_SAMPLES: usize = 1 << 23;

/// Writes a part's heights, in the z of its source
#[derive(clap::Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    part: Part,
    /// File of heights: .tif (32-bit float), .npy or .png (16 bits)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    arguments.part.stays(&[&arguments.out])?;
    let Opened { surface, kind, mut notes } = open(&arguments.part.part, &arguments.part.options())?;
    let lattice = surface.lattice();
    let range_mm = png_range(arguments, surface.as_ref(), &mut notes);
    let mut writer =
        HeightWriter::create(&arguments.out, lattice.columns, lattice.rows, lattice.step_mm, range_mm)?;
    console::unfinished(writer.hidden());
    let seen = write(surface.as_ref(), &lattice, &mut writer, common)?;
    writer.finish()?;
    let kind = match kind {
        Kind::Design => "design",
        Kind::Mesh => "mesh",
        Kind::Heights => "heights",
    };
    let Lattice { width_mm, height_mm, step_mm, columns, rows } = lattice;
    let (top_mm, bottom_mm) = (surface.top_mm(), surface.bottom_mm());
    let out = arguments.out.display().to_string();
    if common.json {
        let report = json!({
            "file": out, "kind": kind, "width_mm": width_mm, "height_mm": height_mm, "columns": columns,
            "rows": rows, "step_mm": step_mm, "z_min_mm": seen.low, "z_max_mm": seen.high,
            "no_data": seen.no_data, "top_mm": top_mm, "bottom_mm": bottom_mm, "notes": notes,
        });
        println!("{report}");
    } else {
        println!(
            "{out}: {columns} x {rows} samples at {step_mm} mm, {width_mm:.4} x {height_mm:.4} mm, {kind}"
        );
        match (seen.low, seen.high) {
            (Some(low), Some(high)) => println!("z {low:.6} .. {high:.6} mm, {} without data", seen.no_data),
            _ => println!("no sample has data"),
        }
        for note in &notes {
            println!("note: {note}");
        }
    }
    Ok(Outcome::Within)
}

/// The heights of a PNG's ends: as said, else the part's own.
fn png_range(arguments: &Arguments, surface: &dyn Surface, notes: &mut Vec<String>) -> [f64; 2] {
    let (low, high) = (surface.bottom_mm(), surface.top_mm());
    // A level part has no range of its own; a micrometre will do.
    let high = if high > low { high } else { low + 0.001 };
    let range = [arguments.part.z_min_mm.unwrap_or(low), arguments.part.z_max_mm.unwrap_or(high)];
    if arguments.out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        let [low, high] = range;
        notes.push(format!("darkest is z_min_mm = {low}, brightest z_max_mm = {high}"));
    }
    range
}

/// What was found while writing.
struct Seen {
    low: Option<f32>,
    high: Option<f32>,
    no_data: u64,
}

fn write(
    surface: &dyn Surface,
    lattice: &Lattice,
    writer: &mut HeightWriter,
    common: &Common,
) -> Result<Seen, Refusal> {
    let mut seen = Seen { low: None, high: None, no_data: 0 };
    let band = (BAND_SAMPLES / lattice.columns).clamp(1, lattice.rows);
    let progress = if common.quiet { ProgressBar::hidden() } else { ProgressBar::new(lattice.rows as u64) };
    if let Ok(style) = ProgressStyle::with_template("raster {wide_bar} {pos}/{len} rows {eta}") {
        progress.set_style(style);
    }
    for row in (0..lattice.rows).step_by(band) {
        if console::interrupted() {
            return Err(pipeline::Error::Interrupted.into());
        }
        let rows = band.min(lattice.rows - row);
        let window = Window { column: 0, row: row as i64, columns: lattice.columns, rows };
        let heights = surface.heights(window, 0.0)?;
        for &z in &heights.z_mm {
            if z.is_nan() {
                seen.no_data += 1;
            } else {
                seen.low = Some(seen.low.map_or(z, |low| low.min(z)));
                seen.high = Some(seen.high.map_or(z, |high| high.max(z)));
            }
        }
        writer.write(&heights)?;
        progress.inc(rows as u64);
    }
    progress.finish_and_clear();
    Ok(seen)
}
