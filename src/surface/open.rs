//! Any part by its file name.

use std::path::Path;
use std::sync::Arc;

use super::image::{self, Format, Said};
use super::{Designed, Error, Surface, Unit, Up, stl};
use crate::screen::Design;

/// What the user says beside the file's name.
#[derive(Clone, Debug)]
pub struct Options {
    /// Distance of the samples in mm.
    pub step_mm: f64,
    /// Pitch of an image that carries none.
    pub pixel_mm: Option<f64>,
    /// Unit of a mesh.
    pub unit: Unit,
    /// Axis of a mesh that points out of the stock.
    pub up: Up,
    /// Heights of the darkest and the brightest value of an image of integers.
    pub z_min_mm: Option<f64>,
    pub z_max_mm: Option<f64>,
}

impl Options {
    /// A step and nothing else said.
    pub fn at_step(step_mm: f64) -> Options {
        Options { step_mm, pixel_mm: None, unit: Unit::Mm, up: Up::Z, z_min_mm: None, z_max_mm: None }
    }
}

/// What a part is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Design,
    Mesh,
    Heights,
}

/// An opened part.
pub struct Opened {
    pub surface: Box<dyn Surface>,
    pub kind: Kind,
    /// What the user should know: a doubtful unit, coarse steps, a resampled image.
    pub notes: Vec<String>,
}

/// Opens a part: `.npz` (design), `.stl` (mesh), `.tif`, `.png` or `.npy` (heights). Images are
/// read by windows later; nothing of their size is held.
pub fn open(path: &Path, options: &Options) -> Result<Opened, Error> {
    let step_mm = options.step_mm;
    if !(step_mm > 0.0 && step_mm.is_finite()) {
        return Err(Error::Step { step_mm });
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let mut notes = Vec::new();
    let format = match extension.as_str() {
        "npz" => {
            let surface = Designed::whole(Arc::new(Design::read(path)?), step_mm)?;
            return Ok(Opened { surface: Box::new(surface), kind: Kind::Design, notes });
        }
        "stl" => {
            let mesh = stl::read(path, options.unit, options.up, step_mm, &mut notes)?;
            return Ok(Opened { surface: Box::new(mesh), kind: Kind::Mesh, notes });
        }
        "tif" | "tiff" => Format::Tiff,
        "npy" => Format::Npy,
        "png" => Format::Png,
        _ => return Err(Error::PartKind { path: path.display().to_string(), extension }),
    };
    let said = Said { pixel_mm: options.pixel_mm, z_min_mm: options.z_min_mm, z_max_mm: options.z_max_mm };
    let image = image::read(path, format, &said, step_mm, &mut notes)?;
    Ok(Opened { surface: Box::new(image), kind: Kind::Heights, notes })
}
