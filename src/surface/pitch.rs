use std::path::Path;

use super::{Error, npy, png, tiff};

/// The distance of a height image's own samples in mm: what its file carries, else `pixel_mm`. None
/// for a part that has no samples of its own.
pub fn pitch_mm(path: &Path, pixel_mm: Option<f64>) -> Result<Option<f64>, Error> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let found = match extension.as_str() {
        "tif" | "tiff" => tiff::read(path)?,
        "npy" => npy::read(path)?,
        "png" => png::read(path)?,
        _ => return Ok(None),
    };
    Ok(found.pitch_mm.or(pixel_mm))
}
