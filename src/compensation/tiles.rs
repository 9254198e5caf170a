use super::field::{Field, Sense, Targets};
use super::pairs::{OnSamples, Pairs};
use super::stencil::Stencil;
use super::{Profile, brute, chord, contact};
use crate::grid::{Heights, Window};
use rayon::prelude::*;

/// Columns of one tile: its rows stay in a core's cache.
const TILE_COLUMNS: usize = 2048;

/// Rows of one tile, at least; a tile reads twice the cutter's reach more.
const TILE_ROWS: usize = 128;

/// Radius of a flat bottom, in samples, from which chords are less work than single samples.
const LEAST_CHORD: f64 = 2.0;

/// Radius of a ball, in samples, from which looking for contacts is less work than every sample.
const LEAST_SEARCH: f64 = 4.0;

/// Cutter locations at the samples of `out`, which may reach past the part: the lowest z of the
/// cutter's lowest point at which it does not cut into `h`. NaN where no data is in reach.
pub fn cutter_location(h: &Heights, profile: &Profile, out: Window) -> Heights {
    on_samples(h, profile, out, 1, Sense::Raise)
}

/// As [`cutter_location`], at the rows `out.row`, `out.row + every`, ... of `out` only: the k-th
/// row of what is returned is row `out.row + k every`, and its window counts these rows.
///
/// `every` is at least 1.
pub fn cutter_location_rows(h: &Heights, profile: &Profile, out: Window, every: usize) -> Heights {
    on_samples(h, profile, out, every.max(1), Sense::Raise)
}

/// What a cutter standing at the locations `cl` (NaN: it does not stand there) leaves of a stock
/// without top: min over |d| <= R of cl(x + d) - s(d), NaN where no position reaches.
pub fn erode(cl: &Heights, profile: &Profile, out: Window) -> Heights {
    on_samples(cl, profile, out, 1, Sense::Lower)
}

/// What the cutter leaves of `h` at best. Cutter positions are the samples of `out` grown by
/// [`Profile::reach`], whether `h` has data there or not, so `h` should cover `out` grown by
/// twice that as far as there is data.
pub fn closing(h: &Heights, profile: &Profile, out: Window) -> Heights {
    erode(&cutter_location(h, profile, out.grown(profile.reach())), profile, out)
}

/// closing - h, never negative: rounding may put a closing one unit in the last place low. NaN
/// where either has no data. Both have the window of `closing`.
pub fn residual(closing: &Heights, h: &Heights) -> Heights {
    let h = if h.window == closing.window { h.clone() } else { h.crop(closing.window) };
    let z_mm = closing
        .z_mm
        .iter()
        .zip(&h.z_mm)
        .map(|(c, h)| if c.is_nan() || h.is_nan() { f32::NAN } else { (c - h).max(0.0) })
        .collect();
    Heights { window: closing.window, z_mm }
}

fn on_samples(h: &Heights, profile: &Profile, out: Window, every: usize, sense: Sense) -> Heights {
    let rows = out.rows.div_ceil(every);
    let mut done = Heights::empty(Window { rows, ..out });
    if out.columns == 0 || rows == 0 {
        return done;
    }
    let stencil = Stencil::new(profile, 0.0, 0.0);
    let tile_rows = TILE_ROWS.max(2 * profile.reach()).div_ceil(every);
    let columns = out.columns;
    done.z_mm.par_chunks_mut(tile_rows * columns).enumerate().for_each(|(band, z_mm)| {
        let first = out.row + (band * tile_rows * every) as i64;
        for column in (0..columns).step_by(TILE_COLUMNS) {
            let width = TILE_COLUMNS.min(columns - column);
            let rows = z_mm.len() / columns;
            let tile = Window { column: out.column + column as i64, row: first, columns: width, rows };
            let targets = tile_on_samples(h, profile, &stencil, tile, every as i64, sense);
            for row in 0..rows {
                let to = &mut z_mm[row * columns + column..][..width];
                for (to, z) in to.iter_mut().zip(targets.row(row)) {
                    *to = sense.give(*z);
                }
            }
        }
    });
    done
}

/// One tile: `tile.rows` rows, `every` apart.
fn tile_on_samples(
    h: &Heights,
    profile: &Profile,
    stencil: &Stencil,
    tile: Window,
    every: i64,
    sense: Sense,
) -> Targets {
    let reach = profile.reach() as i64;
    // One more than is under the cutter, for its neighbours.
    let halo = reach + 1;
    let input = Window {
        column: tile.column - halo,
        row: tile.row - halo,
        columns: tile.columns + 2 * halo as usize,
        rows: (tile.rows - 1) * every as usize + 1 + 2 * halo as usize,
    };
    let pairs = OnSamples {
        stencil,
        reach,
        input_rows: input.rows as i64,
        input_row: input.row,
        target_row: tile.row,
        target_rows: tile.rows,
        every,
        shift: halo,
    };
    let mut targets = Targets::new(tile.columns, tile.rows);
    dilate(&Field::of(h, input, sense), &pairs, profile, &mut targets);
    targets
}

/// Raises the targets by the field, by whichever way suits the profile.
pub(super) fn dilate<P: Pairs>(field: &Field, pairs: &P, profile: &Profile, targets: &mut Targets) {
    let plateau = profile.plateau_mm() / profile.step_mm();
    let chords = plateau >= LEAST_CHORD;
    if chords {
        chord::flat_bottom(field, pairs, targets, plateau + 1.0);
        if profile.plateau_mm() >= profile.radius_mm() {
            return;
        }
    }
    let mut given_up = !profile.is_ball() || profile.radius() < LEAST_SEARCH;
    if !given_up {
        contact::contacts(field, pairs, profile, targets, &mut given_up);
    }
    if given_up {
        brute::every_tap(field, pairs, chords, targets);
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Portable, Vectors};
    use super::*;

    /// Facets, a hole, and a band of noise.
    fn surface(window: Window) -> Heights {
        let mut h = Heights::empty(window);
        let mut state = 1u32;
        for (i, z_mm) in h.z_mm.iter_mut().enumerate() {
            let (x, y) = ((i % window.columns) as f32, (i / window.columns) as f32);
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            let noise = if y > 80.0 { (state >> 16) as f32 * 1e-6 } else { 0.0 };
            if (x - 30.0).hypot(y - 40.0) > 6.0 {
                *z_mm = (0.003 * x).min(0.3 - 0.002 * x).min(0.2 - 0.001 * y) + noise;
            }
        }
        h
    }

    fn bits<V: Vectors>(cutter: &str) -> Vec<u32> {
        let profile = Profile::new(cutter.parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
        let stencil = Stencil::new(&profile, 0.0, 0.0);
        let window = Window { column: 0, row: 0, columns: 123, rows: 97 };
        let halo = profile.reach() as i64 + 1;
        let input = window.grown(halo as usize);
        let pairs = OnSamples {
            stencil: &stencil,
            reach: halo - 1,
            input_rows: input.rows as i64,
            input_row: input.row,
            target_row: 0,
            target_rows: window.rows,
            every: 1,
            shift: halo,
        };
        let field = Field::of(&surface(window), input, Sense::Raise);
        let mut ways = Vec::new();
        let mut done = |fill: &dyn Fn(&mut Targets)| {
            let mut targets = Targets::new(window.columns, window.rows);
            fill(&mut targets);
            for row in 0..window.rows {
                ways.extend(targets.row(row)[..window.columns].iter().map(|z| z.to_bits()));
            }
        };
        done(&|targets| brute::body::<V, _>(&field, &pairs, false, targets));
        if profile.is_ball() {
            done(&|targets| contact::body::<V, _>(&field, &pairs, &profile, targets, &mut false));
        } else {
            done(&|targets| chord::body::<V, _>(&field, &pairs, targets, profile.radius()));
        }
        ways
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        for cutter in ["ball:0.3", "flat:0.3"] {
            let portable = bits::<Portable>(cutter);
            let (all, pruned) = portable.split_at(portable.len() / 2);
            assert!(all == pruned, "{cutter}");
            #[cfg(target_arch = "x86_64")]
            {
                use super::super::lanes::{Avx2, Avx512};
                if is_x86_feature_detected!("avx2") {
                    assert!(bits::<Avx2>(cutter) == portable, "{cutter}");
                }
                if is_x86_feature_detected!("avx512f") {
                    assert!(bits::<Avx512>(cutter) == portable, "{cutter}");
                }
            }
        }
    }
}
