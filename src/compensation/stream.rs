use super::band::{Band, Wanted, closed, finish, of_part, under_rows};
use super::field::Sense;
use super::held::Held;
use super::outlet::{Beside, Outlet, RowTally};
use super::strips::{AHEAD, Strips, in_strips, strip_bytes};
use super::{Profile, Tables};
use crate::grid::{Lattice, Window};
use crate::memory::untouched;

/// Samples of one band, about: what is held at once is a few bands and the cutter's reach.
const BAND_SAMPLES: usize = 1 << 24;

/// The same for closings where no row is looked at twice.
const STRIP_SAMPLES: usize = 1 << 23;

/// Compensates a whole part band by band, from the lowest row up. Rows 0, `every`, 2 `every`, ...
/// are cut, and those beyond the part, whose edges are open; closing is made from these rows.
/// `read` gives the part's samples in a window of whole rows, each row once and from the lowest up; `lift` may
/// raise the locations it is given, as [`super::lift`] does, of rows `every` apart. What comes out does not depend
/// on the bands. `each` may take a band if it leaves another, whose memory is then used again.
///
/// # Errors
/// Those of `read`, `lift` and `each`.
pub fn stream<E>(
    lattice: &Lattice,
    profile: &Profile,
    every: usize,
    wanted: Wanted,
    read: impl FnMut(Window, &mut [f32]) -> Result<(), E>,
    lift: impl FnMut(Window, &mut [f32]) -> Result<(), E>,
    each: impl FnMut(&mut Band) -> Result<(), E>,
) -> Result<(), E> {
    let tables = Tables::new(*profile);
    by_rows(rows_at_once(lattice, &tables, wanted), lattice, &tables, every, wanted, read, lift, each)
}

fn rows_at_once(lattice: &Lattice, tables: &Tables, wanted: Wanted) -> usize {
    let columns = lattice.columns.max(1);
    if in_strips(tables, columns, 1) && wanted.closes() {
        return (STRIP_SAMPLES / columns).clamp(64, 1024);
    }
    (BAND_SAMPLES / columns).clamp(64, 1024)
}

/// Bytes that [`stream`] holds at once, about and rather more: by the width of the part and the
/// cutter, whatever the part's height.
pub fn stream_bytes(lattice: &Lattice, profile: &Profile, every: usize, wanted: Wanted) -> u64 {
    let tables = Tables::new(*profile);
    let rows = rows_at_once(lattice, &tables, wanted).min(lattice.rows);
    let reach = profile.reach();
    let with_closing = wanted.closes();
    let halo = if with_closing { reach } else { 0 };
    let width = lattice.columns + 2 * halo;
    // The part and the rows cut, with what lies around them, and two bands of results with what a file takes of one.
    // Under rows that are not all cut a closing is looked at once more.
    let closed = with_closing && every > 1;
    let results = [wanted.cl, wanted.closing || closed, wanted.residual || closed];
    let results = results.into_iter().filter(|result| *result).count();
    let held = most_rows(rows, reach, halo);
    let held =
        held[0].min(lattice.rows) + if with_closing { held[1].min(lattice.rows + 2 * halo) } else { 0 };
    let rows = held + (2 * results + 1) * rows;
    let strips = strip_bytes(&tables, width) * if with_closing { 2 } else { 1 };
    4 * width as u64 * rows as u64 + strips
}

#[allow(clippy::too_many_arguments)]
fn by_rows<E>(
    rows_at_once: usize,
    lattice: &Lattice,
    tables: &Tables,
    every: usize,
    wanted: Wanted,
    mut read: impl FnMut(Window, &mut [f32]) -> Result<(), E>,
    mut lift: impl FnMut(Window, &mut [f32]) -> Result<(), E>,
    mut each: impl FnMut(&mut Band) -> Result<(), E>,
) -> Result<(), E> {
    let every = every.max(1);
    let with_closing = wanted.closes();
    let reach = tables.profile().reach();
    let part = lattice.window();
    let halo = if with_closing { reach } else { 0 };
    let rows_at_once = rows_at_once.next_multiple_of(every);
    let most = most_rows(rows_at_once.min(part.rows), reach, halo);
    let mut h = Held::new(part, most[0].min(part.rows));
    // Positions that are held: row k of these is the part's row k `every`.
    let lowest = -((halo / every) as i64);
    let positions = Window { row: lowest, columns: part.columns + 2 * halo, ..part.grown(halo) };
    let most_cut = most[1].min(part.rows + 2 * halo).div_ceil(every) + 2;
    let mut cut = Held::new(positions, if with_closing { most_cut } else { 0 });
    let all =
        Window { row: lowest * every as i64, rows: part.rows + halo + halo / every * every, ..positions };
    let mut locations = Strips::new(tables, all, every, Sense::Raise);
    let mut closings = Strips::new(tables, part, 1, Sense::Lower);
    let mut band = Band::default();
    let mut tallies = Vec::new();
    for row in (0..part.rows).step_by(rows_at_once) {
        (band.row, band.rows) = (row, rows_at_once.min(part.rows - row));
        let end = (row + band.rows) as i64;
        // Positions that closing looks at, and samples that these look at.
        let beyond = if with_closing { halo + AHEAD } else { 0 } as i64;
        let cut_end = (end + beyond).min(all.row_end());
        let h_end = (cut_end + (reach + AHEAD) as i64).min(part.row_end());
        for (window, z_mm) in h.more((h_end - h.end()).max(0) as usize) {
            if window.rows > 0 {
                read(window, z_mm)?;
            }
        }
        tallies.resize_with(band.rows, RowTally::default);
        if with_closing {
            let rows = ((cut_end - 1).div_euclid(every as i64) + 1 - cut.end()).max(0) as usize;
            let mut new = cut.more(rows);
            let first = new[0].0.row * every as i64;
            let to = new.iter_mut().flat_map(|(window, z_mm)| Outlet::plain(z_mm, window.columns)).collect();
            locations.rows(h.rows(), first, to);
            for (window, z_mm) in new {
                if window.rows > 0 {
                    lift(Window { row: window.row * every as i64, ..window }, z_mm)?;
                }
            }
            if every == 1 {
                closings.rows(
                    cut.rows(),
                    row as i64,
                    closed(h.rows(), cut.rows(), &tallies, wanted, &mut band),
                );
            } else {
                if wanted.cl {
                    of_part(cut.rows(), every, &part, &mut band);
                }
                under_rows(cut.rows(), every, lattice, tables.profile(), &mut band);
            }
        } else {
            let rows = band.rows.div_ceil(every);
            let new = Window { row: row as i64, rows, ..part };
            untouched(&mut band.cl, new.samples());
            let mut to = Outlet::plain(&mut band.cl, part.columns);
            if every == 1 {
                for ((to, tally), row) in to.iter_mut().zip(&tallies).zip(new.row..) {
                    to.beside = Some(Beside { h: h.rows().row(row), tally: Some(tally), closed: None });
                }
            }
            locations.rows(h.rows(), new.row, to);
            lift(new, &mut band.cl)?;
        }
        finish(h.rows(), every, wanted, &mut tallies, &mut band);
        each(&mut band)?;

        // The next band looks at the rows within reach of its first.
        cut.keep_from((end - halo as i64).div_euclid(every as i64));
        h.keep_from(end - reach as i64);
    }
    Ok(())
}

/// Rows of the part, and of the positions that a closing of a band looks at, that are held at once.
fn most_rows(band: usize, reach: usize, halo: usize) -> [usize; 2] {
    let cut = if halo > 0 { band + 2 * halo + AHEAD } else { band };
    [cut + 2 * reach + AHEAD, cut]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compensation::{CAVITY_MM, OutOfReach, closing, cutter_location, cutter_location_rows, erode};
    use crate::grid::Heights;
    use std::convert::Infallible;

    /// Waves with a hole.
    fn part(width_mm: f64) -> (Lattice, Heights) {
        let lattice = Lattice::covering(width_mm, 1.57, 0.01);
        let mut h = Heights::empty(lattice.window());
        for (i, z_mm) in h.z_mm.iter_mut().enumerate() {
            let (x, y) = ((i % lattice.columns) as f32, (i / lattice.columns) as f32);
            if (x - 40.0).hypot(y - 70.0) > 9.0 {
                *z_mm = 0.1 * (0.11 * x).sin() * (0.07 * y + 0.02 * x).cos();
            }
        }
        (lattice, h)
    }

    const CL: Wanted = Wanted { cl: true, closing: false, residual: false, out_of_reach: false };
    const ALL: Wanted = Wanted { cl: true, closing: true, residual: true, out_of_reach: true };

    /// Bits of every band put together: locations, closing, residual.
    fn streamed(rows_at_once: usize, every: usize) -> [Vec<u32>; 3] {
        streamed_of(&part(0.83), rows_at_once, every, ALL).0
    }

    /// The same, and what was found out in numbers: samples, and what is out of reach.
    fn streamed_of(
        (lattice, h): &(Lattice, Heights),
        rows_at_once: usize,
        every: usize,
        wanted: Wanted,
    ) -> ([Vec<u32>; 3], (u64, OutOfReach)) {
        let profile = Profile::new("ball:0.3".parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
        let mut out = [Vec::new(), Vec::new(), Vec::new()];
        let mut found = (0, OutOfReach::default());
        let each = |band: &mut Band| {
            let Band { cl, closing, residual, samples, out_of_reach, .. } = std::mem::take(band);
            found.0 += samples;
            found.1.samples += out_of_reach.samples;
            found.1.most_mm = out_of_reach.most_mm.max(found.1.most_mm);
            for (out, z_mm) in out.iter_mut().zip([cl, closing, residual]) {
                out.extend(z_mm.iter().map(|z| z.to_bits()));
            }
            Ok::<(), Infallible>(())
        };
        let read = |window, z_mm: &mut [f32]| {
            z_mm.copy_from_slice(&h.crop(window).z_mm);
            Ok(())
        };
        let tables = Tables::new(profile);
        let lift = |_, _: &mut [f32]| Ok(());
        let done = by_rows(rows_at_once, lattice, &tables, every, wanted, read, lift, each);
        assert!(done.is_ok());
        (out, found)
    }

    #[test]
    fn samples_are_counted_once_where_a_search_is_given_up() {
        for width_mm in [0.83, 21.3] {
            let mut part = part(width_mm);
            // Noise from the middle on: the rows below have been given when the search is given up.
            let half = part.1.z_mm.len() / 2;
            let mut seed = 7u32;
            for z_mm in &mut part.1.z_mm[half..] {
                seed = seed.wrapping_mul(1664525).wrapping_add(1013904223);
                *z_mm = (seed >> 8) as f32 * 1e-7;
            }
            let there = part.1.z_mm.iter().filter(|z| !z.is_nan()).count() as u64;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
            for wanted in [CL, ALL] {
                let ([cl, ..], (counted, _)) = pool.install(|| streamed_of(&part, 1000, 1, wanted));
                assert_eq!(counted, there, "{width_mm} mm, {wanted:?}");
                assert!(
                    cl.iter().zip(&part.1.z_mm).all(|(cl, h)| f32::from_bits(*cl).is_nan() == h.is_nan())
                );
            }
        }
    }

    #[test]
    fn strips_count_and_mask_as_tiles_do() {
        let part = part(21.3);
        let there = part.1.z_mm.iter().filter(|z| !z.is_nan()).count() as u64;
        let profile = Profile::new("ball:0.3".parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
        let in_pool = |threads: usize, every: usize, wanted: Wanted| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| {
                assert_eq!(in_strips(&Tables::new(profile), part.0.columns, 1), threads == 1);
                streamed_of(&part, 50, every, wanted)
            })
        };
        for (every, wanted) in [(1, CL), (1, ALL), (3, CL), (3, ALL)] {
            let (strips, found) = in_pool(1, every, wanted);
            assert_eq!(found.0, there);
            assert!(in_pool(4, every, wanted) == (strips.clone(), found), "every {every}, {wanted:?}");
            let whole = cutter_location_rows(&part.1, &profile, part.1.window, every);
            for ((k, cl), whole) in strips[0].iter().enumerate().zip(&whole.z_mm) {
                let (row, column) = (k / part.0.columns * every, k % part.0.columns);
                let is_there = !part.1.row(row as i64)[column].is_nan();
                assert_eq!(f32::from_bits(*cl).is_nan(), !is_there);
                assert!(!is_there || *cl == whole.to_bits());
            }
            assert_eq!(strips[1].len(), if wanted.closing { part.1.z_mm.len() } else { 0 });
        }
    }

    #[test]
    fn what_is_wanted_is_the_same_whatever_else_is() {
        for (width_mm, every) in [(0.83, 1), (21.3, 1), (0.83, 3)] {
            let part = part(width_mm);
            let (all, found) = streamed_of(&part, 50, every, ALL);
            let left =
                || all[2].iter().map(|bits| f32::from_bits(*bits)).filter(|left_mm| *left_mm > CAVITY_MM);
            assert_eq!(found.1.samples, left().count() as u64);
            assert_eq!(found.1.most_mm, left().fold(0.0, f32::max));
            assert!(found.1.samples > 0, "the waves are narrower than the ball");
            for k in 1..16 {
                let [cl, closing, residual, out_of_reach] = [1, 2, 4, 8].map(|bit| k & bit != 0);
                let wanted = Wanted { cl, closing, residual, out_of_reach };
                let (some, numbers) = streamed_of(&part, 50, every, wanted);
                for ((some, all), wanted) in some.iter().zip(&all).zip([cl, closing, residual]) {
                    assert!(if wanted { some == all } else { some.is_empty() }, "{wanted:?}");
                }
                assert_eq!(numbers, if wanted.closes() { found } else { (found.0, OutOfReach::default()) });
            }
        }
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
        let (_, h) = part(0.83);
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
        let (lattice, h) = part(0.83);
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
