//! What is to be cut: a designed tile, a mesh or a height image, as a heightfield that any window
//! of can be asked for.

mod designed;
mod envelope;
mod error;
mod face;
mod image;
mod level;
mod mesh;
mod npy;
mod open;
mod pitch;
mod png;
mod raw;
mod samples;
mod stl;
mod stl_text;
mod tiff;
mod transform;
mod writer;

pub use designed::Designed;
pub use error::Error;
pub use face::Face;
pub use image::HeightImage;
pub use level::Level;
pub use mesh::Mesh;
pub use open::{Kind, Opened, Options, open};
pub use pitch::pitch_mm;
pub use stl::{Unit, Up};
pub use transform::{Die, Tile, Transposed, Walled};
pub use writer::HeightWriter;

use std::sync::Arc;

use crate::grid::{Heights, Lattice, Window};

/// Samples of one layer that can be addressed and stored: 4 terabytes of floats.
pub const MOST_SAMPLES: f64 = 1e12;

/// A face steeper than this many degrees is a wall: it sets no stepover.
pub const WALL_DEG: f64 = 85.0;

/// A surface that is a single height over every point of a rectangle.
///
/// `z_mm` is the source's own z. The part frame's z = 0 is [`Surface::top_mm`].
pub trait Surface: Send + Sync {
    /// Size and samples, fixed for the life of the surface.
    fn lattice(&self) -> Lattice;

    /// Highest point of the surface itself (a vertex, not a sample), in the source's z.
    fn top_mm(&self) -> f64;

    /// Lowest point of the surface itself, in the source's z.
    fn bottom_mm(&self) -> f64;

    /// The steepest |dz/dx| and |dz/dy| of the surface's faces; vertical walls and steps are not
    /// faces. It sets the stepover of a scallop and how far a cutter runs past an open edge.
    fn steepest(&self) -> [f64; 2];

    /// Heights of the samples in `window` less `datum_mm`, subtracted in double precision so that
    /// a single float keeps its nanometres on a part that stands at 40 mm. Samples outside the
    /// part, and holes in it, are NaN. The same sample gets the same bits whatever the window.
    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error>;

    /// As [`Surface::heights`], in memory that is there: as many samples as the window has.
    fn heights_onto(&self, window: Window, datum_mm: f64, z_mm: &mut [f32]) -> Result<(), Error> {
        z_mm.copy_from_slice(&self.heights(window, datum_mm)?.z_mm);
        Ok(())
    }

    /// Heights at (width - x, y): the part seen from behind, as a die needs it. Exact for every
    /// width where the surface overrides it; without that the width must be whole steps.
    fn heights_mirrored(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        let lattice = self.lattice();
        let count = lattice.width_mm / lattice.step_mm;
        if (count - lattice.columns as f64).abs() > 1e-6 {
            return Err(Error::NotWholeSteps {
                length_mm: lattice.width_mm,
                step_mm: lattice.step_mm,
                count,
            });
        }
        let mut heights = self
            .heights(Window { column: lattice.columns as i64 - window.column_end(), ..window }, datum_mm)?;
        for row in heights.z_mm.chunks_mut(window.columns.max(1)) {
            row.reverse();
        }
        heights.window = window;
        Ok(heights)
    }

    /// Lowest and highest point over the samples of `window`, in the source's z; None where there
    /// is nothing. From the samples, or from the faces where the surface has them.
    fn range_mm(&self, window: Window) -> Result<Option<[f64; 2]>, Error> {
        let band = (1 << 22) / window.columns.max(1) + 1;
        let datum_mm = self.top_mm();
        let mut range = None;
        for start in (0..window.rows).step_by(band) {
            let rows = band.min(window.rows - start);
            let heights =
                self.heights(Window { row: window.row + start as i64, rows, ..window }, datum_mm)?;
            for z in heights.z_mm.into_iter().filter(|z| !z.is_nan()).map(|z| f64::from(z) + datum_mm) {
                let [low, high] = range.get_or_insert([z, z]);
                *low = low.min(z);
                *high = high.max(z);
            }
        }
        Ok(range)
    }

    /// Corners of the planar faces that reach into a rectangle, each convex, x and y from the
    /// lattice's lower left corner; none where there are only samples. A cutter that touches none
    /// of them and no sample touches nothing.
    fn outlines(&self, _low_mm: [f64; 2], _high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        Vec::new()
    }

    /// The part turned rigidly until its best-fit plane is horizontal.
    fn levelled(&self) -> Result<Level, Error> {
        Err(Error::NotLevelled)
    }
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<S: Surface + ?Sized> Surface for $pointer {
            fn lattice(&self) -> Lattice {
                (**self).lattice()
            }
            fn top_mm(&self) -> f64 {
                (**self).top_mm()
            }
            fn bottom_mm(&self) -> f64 {
                (**self).bottom_mm()
            }
            fn steepest(&self) -> [f64; 2] {
                (**self).steepest()
            }
            fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
                (**self).heights(window, datum_mm)
            }
            fn heights_onto(&self, window: Window, datum_mm: f64, z_mm: &mut [f32]) -> Result<(), Error> {
                (**self).heights_onto(window, datum_mm, z_mm)
            }
            fn heights_mirrored(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
                (**self).heights_mirrored(window, datum_mm)
            }
            fn range_mm(&self, window: Window) -> Result<Option<[f64; 2]>, Error> {
                (**self).range_mm(window)
            }
            fn outlines(&self, low_mm: [f64; 2], high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
                (**self).outlines(low_mm, high_mm)
            }
            fn levelled(&self) -> Result<Level, Error> {
                (**self).levelled()
            }
        }
    )*};
}
forward!(&S, Arc<S>, Box<S>);

/// The samples that cover a part, or why there are too many of them.
fn covering(width_mm: f64, height_mm: f64, step_mm: f64) -> Result<Lattice, Error> {
    if !(step_mm > 0.0 && step_mm.is_finite()) {
        return Err(Error::Step { step_mm });
    }
    let samples = (width_mm / step_mm).max(1.0) * (height_mm / step_mm).max(1.0);
    let sides = (width_mm / step_mm).max(height_mm / step_mm);
    if !(samples <= MOST_SAMPLES && sides <= f64::from(u32::MAX)) {
        return Err(Error::TooManySamples { width_mm, height_mm, step_mm, samples, limit: MOST_SAMPLES });
    }
    Ok(Lattice::covering(width_mm, height_mm, step_mm))
}

/// x of the columns of a window, from left to right.
fn columns_mm(lattice: &Lattice, window: &Window) -> Vec<f64> {
    (window.column..window.column_end()).map(|column| lattice.x_mm(column)).collect()
}

/// x of the columns of a window as a mirror at the part's middle shows them, rising: the last
/// column comes first.
fn mirrored_columns_mm(lattice: &Lattice, window: &Window) -> Vec<f64> {
    (window.column..window.column_end()).rev().map(|column| lattice.width_mm - lattice.x_mm(column)).collect()
}

/// Turns heights made on [`mirrored_columns_mm`] round.
fn reversed(mut heights: Heights) -> Heights {
    let columns = heights.window.columns.max(1);
    for row in heights.z_mm.chunks_mut(columns) {
        row.reverse();
    }
    heights
}
