use super::{Profile, RowPass, cutter_location_rows, erode, machined_by_rows, residual};
use crate::grid::{Heights, Lattice, Window};

/// Samples of one band, about: what is held at once is a few bands and the cutter's reach.
const BAND_SAMPLES: usize = 1 << 23;

/// Rows of one band of a whole part, and what a cutter makes of them.
#[derive(Clone, Debug)]
pub struct Band {
    /// The part.
    pub heights: Heights,
    /// Cutter locations at the rows of this band that are cut; no data where the part has none.
    pub cl: Heights,
    /// What the cutter leaves, if it was asked for; no data where the part has none.
    pub closing: Option<Heights>,
    /// closing - heights.
    pub residual: Option<Heights>,
}

/// Compensates a whole part band by band, from the lowest row up. Rows 0, `every`, 2 `every`, ...
/// are cut, and those beyond the part, whose edges are open; closing is made from these rows.
/// `read` gives the part's samples in a window that may reach past it; `lift` may raise the
/// locations it is given, as [`super::lift`] does. What comes out does not depend on the bands.
///
/// # Errors
/// Those of `read`, `lift` and `each`.
pub fn stream<E>(
    lattice: &Lattice,
    profile: &Profile,
    every: usize,
    with_closing: bool,
    mut read: impl FnMut(Window) -> Result<Heights, E>,
    mut lift: impl FnMut(&mut Heights) -> Result<(), E>,
    mut each: impl FnMut(Band) -> Result<(), E>,
) -> Result<(), E> {
    let every = every.max(1);
    let reach = profile.reach();
    let part = lattice.window();
    let halo = if with_closing { reach } else { 0 };
    let rows_at_once = (BAND_SAMPLES / part.columns.max(1)).clamp(64, 1024).next_multiple_of(every);
    // Rows of positions that are held, one in `every`, and the part's row of the first.
    let mut cut = Heights::empty(Window { columns: part.columns + 2 * halo, rows: 0, ..part.grown(halo) });
    let mut first = -((halo / every * every) as i64);
    for start in (0..part.rows).step_by(rows_at_once) {
        let band = Window { row: start as i64, rows: rows_at_once.min(part.rows - start), ..part };
        // Cut rows that this band needs beyond those held.
        let from = first + (cut.window.rows * every) as i64;
        let end = band.row_end() + halo as i64;
        let wanted = Window {
            column: cut.window.column,
            columns: cut.window.columns,
            row: from,
            rows: (end - from).max(0) as usize,
        };
        let around = wanted.grown(reach);
        let low = around.row.min(band.row);
        let high = around.row_end().max(band.row_end());
        let h = read(Window { row: low, rows: (high - low) as usize, ..around })?;
        let mut more = cutter_location_rows(&h, profile, wanted, every);
        lift(&mut more)?;
        cut.z_mm.extend_from_slice(&more.z_mm);
        cut.window.rows += more.window.rows;
        drop(more);

        let heights = h.crop(band);
        drop(h);
        let cl = those_of_band(&cut, first, every, &band, &heights);
        let closing = with_closing.then(|| {
            let mut closing = if every == 1 {
                // Row numbers are right as long as every row is held.
                let window = Window { row: first, ..cut.window };
                let held = Heights { window, z_mm: std::mem::take(&mut cut.z_mm) };
                let closing = erode(&held, profile, band);
                cut.z_mm = held.z_mm;
                closing
            } else {
                let passes: Vec<RowPass> = cut
                    .z_mm
                    .chunks_exact(cut.window.columns)
                    .enumerate()
                    .map(|(k, z_mm)| RowPass {
                        x0_mm: lattice.x_mm(cut.window.column),
                        y_mm: lattice.y_mm(first + (k * every) as i64),
                        z_mm,
                    })
                    .collect();
                machined_by_rows(&passes, profile, band)
            };
            mask(&mut closing.z_mm, &heights.z_mm);
            closing
        });
        let residual = closing.as_ref().map(|closing| residual(closing, &heights));
        each(Band { heights, cl, closing, residual })?;

        // The next band needs the rows within reach of its first.
        let keep = band.row_end() - halo as i64;
        let gone = ((keep - first).max(0) as usize / every).min(cut.window.rows);
        cut.z_mm.drain(..gone * cut.window.columns);
        cut.window.rows -= gone;
        first += (gone * every) as i64;
    }
    Ok(())
}

/// The cut rows that lie in the band, over the part's columns.
fn those_of_band(cut: &Heights, first: i64, every: usize, band: &Window, heights: &Heights) -> Heights {
    let rows = band.rows.div_ceil(every);
    let mut cl = Heights { window: Window { rows, ..*band }, z_mm: Vec::with_capacity(rows * band.columns) };
    for row in (band.row..band.row_end()).step_by(every) {
        let k = (row - first) as usize / every;
        let from = k * cut.window.columns + (band.column - cut.window.column) as usize;
        let start = cl.z_mm.len();
        cl.z_mm.extend_from_slice(&cut.z_mm[from..][..band.columns]);
        mask(&mut cl.z_mm[start..], heights.row(row));
    }
    cl
}

/// No data where the part has none.
fn mask(z_mm: &mut [f32], part: &[f32]) {
    for (z_mm, part) in z_mm.iter_mut().zip(part) {
        if part.is_nan() {
            *z_mm = f32::NAN;
        }
    }
}
