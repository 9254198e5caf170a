use super::{Profile, RowPass, cutter_location_rows_into, erode, machined_by_rows, residual};
use crate::grid::{Heights, Lattice, Window};

/// Samples of one band, about: what is held at once is a few bands and the cutter's reach.
const BAND_SAMPLES: usize = 1 << 24;

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
    read: impl FnMut(Window) -> Result<Heights, E>,
    lift: impl FnMut(&mut Heights) -> Result<(), E>,
    each: impl FnMut(Band) -> Result<(), E>,
) -> Result<(), E> {
    by_rows(rows_at_once(lattice), lattice, profile, every, with_closing, read, lift, each)
}

fn rows_at_once(lattice: &Lattice) -> usize {
    (BAND_SAMPLES / lattice.columns.max(1)).clamp(64, 1024)
}

/// Bytes that [`stream`] holds at once, about and rather more: by the width of the part and the
/// cutter, whatever the part's height.
pub fn stream_bytes(lattice: &Lattice, profile: &Profile, with_closing: bool) -> u64 {
    let rows = rows_at_once(lattice).min(lattice.rows);
    let reach = profile.reach();
    let halo = if with_closing { reach } else { 0 };
    let width = lattice.columns + 2 * (halo + reach);
    // The part with its halo, the rows cut (twice while they grow), and four bands of results, with those of the
    // band before on their way to a file.
    let rows = rows + 2 * (halo + reach) + 2 * (rows + 2 * halo) + 8 * rows;
    4 * width as u64 * rows as u64
}

#[allow(clippy::too_many_arguments)]
fn by_rows<E>(
    rows_at_once: usize,
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
    let rows_at_once = rows_at_once.next_multiple_of(every);
    // Rows of positions that are held, one in `every`, and the part's row of the first.
    let mut cut = Heights::empty(Window { columns: part.columns + 2 * halo, rows: 0, ..part.grown(halo) });
    let mut first = -((halo / every * every) as i64);
    let mut more = Heights::empty(Window { columns: 0, rows: 0, ..part });
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
        cutter_location_rows_into(&h, profile, wanted, every, &mut more);
        lift(&mut more)?;
        cut.z_mm.extend_from_slice(&more.z_mm);
        cut.window.rows += more.window.rows;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compensation::{closing, cutter_location};
    use std::convert::Infallible;

    /// Waves with a hole.
    fn part() -> (Lattice, Heights) {
        let lattice = Lattice::covering(0.83, 1.57, 0.01);
        let mut h = Heights::empty(lattice.window());
        for (i, z_mm) in h.z_mm.iter_mut().enumerate() {
            let (x, y) = ((i % lattice.columns) as f32, (i / lattice.columns) as f32);
            if (x - 40.0).hypot(y - 70.0) > 9.0 {
                *z_mm = 0.1 * (0.11 * x).sin() * (0.07 * y + 0.02 * x).cos();
            }
        }
        (lattice, h)
    }

    /// Bits of every band put together: locations, closing, residual.
    fn streamed(rows_at_once: usize, every: usize) -> [Vec<u32>; 3] {
        let (lattice, h) = part();
        let profile = Profile::new("ball:0.3".parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
        let mut out = [Vec::new(), Vec::new(), Vec::new()];
        let each = |band: Band| {
            let parts = [Some(&band.cl), band.closing.as_ref(), band.residual.as_ref()];
            for (out, heights) in out.iter_mut().zip(parts) {
                out.extend(heights.expect("asked for").z_mm.iter().map(|z| z.to_bits()));
            }
            Ok::<(), Infallible>(())
        };
        let done =
            by_rows(rows_at_once, &lattice, &profile, every, true, |w| Ok(h.crop(w)), |_| Ok(()), each);
        assert!(done.is_ok());
        out
    }

    #[test]
    fn the_height_of_a_band_does_not_show() {
        for every in [1, 4] {
            let whole = streamed(1000, every);
            for rows_at_once in [1, 13, 40] {
                assert_eq!(streamed(rows_at_once, every), whole, "bands of {rows_at_once}, every {every}");
            }
        }
    }

    #[test]
    fn a_stream_is_the_whole_with_holes_left_out() {
        let (_, h) = part();
        let profile = Profile::new("ball:0.3".parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
        let [cl, closed, _] = streamed(17, 1);
        let whole = [cutter_location(&h, &profile, h.window), closing(&h, &profile, h.window)];
        for (streamed, whole) in [cl, closed].iter().zip(&whole) {
            for ((streamed, whole), h) in streamed.iter().zip(&whole.z_mm).zip(&h.z_mm) {
                let want = if h.is_nan() { f32::NAN } else { *whole };
                assert!(*streamed == want.to_bits() || want.is_nan() && f32::from_bits(*streamed).is_nan());
            }
        }
    }

    #[test]
    fn every_kth_row_cuts_past_open_edges_too() {
        let profile = Profile::new("ball:0.3".parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
        let (lattice, h) = part();
        let [_, closed, _] = streamed(1000, 4);
        let around = h.window.grown(profile.reach());
        let mut cl = cutter_location(&h, &profile, around);
        for (i, z_mm) in cl.z_mm.iter_mut().enumerate() {
            if (around.row + (i / around.columns) as i64).rem_euclid(4) != 0 {
                *z_mm = f32::NAN;
            }
        }
        let want = erode(&cl, &profile, h.window);
        assert_eq!(closed.len(), lattice.window().samples());
        for ((closed, want), h) in closed.iter().zip(&want.z_mm).zip(&h.z_mm) {
            assert!(h.is_nan() || *closed == want.to_bits());
        }
    }
}
