//! What a command says about the part it reads, beside its file name.

use std::path::{Path, PathBuf};

use screenmill::surface::{Options, Unit, Up};

/// A part and how to read it.
#[derive(clap::Args, Clone, Debug)]
pub struct Part {
    /// Designed cells (.npz), a mesh (.stl) or heights (.tif, .png, .npy)
    pub part: PathBuf,
    /// Distance of the samples in mm
    #[arg(long, value_name = "MM", default_value_t = 0.01, allow_hyphen_values = true)]
    pub step_mm: f64,
    /// Pitch in mm of heights whose file carries none
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub pixel_mm: Option<f64>,
    /// Unit of a mesh: mm, m or inch
    #[arg(long, default_value = "mm")]
    pub unit: Unit,
    /// Axis of a mesh that points out of the stock: x, y or z
    #[arg(long, default_value = "z")]
    pub up: Up,
    /// Height in mm of an integer image's darkest value
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub z_min_mm: Option<f64>,
    /// Height in mm of an integer image's brightest value
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub z_max_mm: Option<f64>,
}

/// A part that would be lost.
#[derive(Debug, thiserror::Error)]
#[error("{path} is the part that is read; hint: another name for what is written")]
pub struct Overwrites {
    path: String,
}

/// Whether two names are one file that there is.
pub fn same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

impl Part {
    /// None of these files takes the part's place.
    pub fn stays(&self, written: &[&PathBuf]) -> Result<(), Overwrites> {
        match written.iter().find(|path| same_file(&self.part, path)) {
            Some(path) => Err(Overwrites { path: path.display().to_string() }),
            None => Ok(()),
        }
    }

    pub fn options(&self) -> Options {
        Options {
            step_mm: self.step_mm,
            pixel_mm: self.pixel_mm,
            unit: self.unit,
            up: self.up,
            z_min_mm: self.z_min_mm,
            z_max_mm: self.z_max_mm,
        }
    }
}
