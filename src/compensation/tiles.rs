use super::field::{Field, Sense, Targets};
use super::memory::large_pages;
use super::pairs::{OnSamples, Pairs};
use super::stencil::Stencil;
use super::{Profile, bounded, brute, chord, contact};
use crate::grid::{Heights, Window};
use rayon::prelude::*;

/// Columns of one tile: its rows stay in a core's cache.
const TILE_COLUMNS: usize = 2048;

/// Rows of one tile, at least and at most; a tile reads twice the cutter's reach more.
const TILE_ROWS: [usize; 2] = [128, 1024];

/// Radius of a flat bottom, in samples, from which chords are less work than single samples.
const LEAST_CHORD: f64 = 2.0;

/// Radius of a ball, in samples, from which looking for contacts is less work than every sample.
const LEAST_SEARCH: f64 = 4.0;

/// Cutter locations at the samples of `out`, which may reach past the part: the lowest z of the
/// cutter's lowest point at which it does not cut into `h`. NaN where no data is in reach.
pub fn cutter_location(h: &Heights, profile: &Profile, out: Window) -> Heights {
    on_samples(h, profile, out, 1, Sense::Raise, Way::Known)
}

/// [`cutter_location`] by one way only, for benches: all give the same bits.
#[doc(hidden)]
pub fn cutter_location_by(h: &Heights, profile: &Profile, out: Window, way: Way) -> Heights {
    on_samples(h, profile, out, 1, Sense::Raise, way)
}

/// As [`cutter_location`], at the rows `out.row`, `out.row + every`, ... of `out` only: the k-th
/// row of what is returned is row `out.row + k every`, and its window counts these rows.
///
/// `every` is at least 1.
pub fn cutter_location_rows(h: &Heights, profile: &Profile, out: Window, every: usize) -> Heights {
    on_samples(h, profile, out, every.max(1), Sense::Raise, Way::Known)
}

/// What a cutter standing at the locations `cl` (NaN: it does not stand there) leaves of a stock
/// without top: min over |d| <= R of cl(x + d) - s(d), NaN where no position reaches.
pub fn erode(cl: &Heights, profile: &Profile, out: Window) -> Heights {
    on_samples(cl, profile, out, 1, Sense::Lower, Way::Known)
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

fn on_samples(h: &Heights, profile: &Profile, out: Window, every: usize, sense: Sense, way: Way) -> Heights {
    let rows = out.rows.div_ceil(every);
    // Every sample is written below; zeros are memory that nobody has touched yet.
    let mut done = Heights { window: Window { rows, ..out }, z_mm: vec![0.0; rows * out.columns] };
    if out.columns == 0 || rows == 0 {
        return done;
    }
    large_pages(&done.z_mm);
    let stencil = Stencil::new(profile, 0.0, 0.0);
    let columns = out.columns;
    let across = columns.div_ceil(TILE_COLUMNS);
    let least = TILE_ROWS[0].max(2 * profile.reach());
    let share = (out.rows * across).div_ceil(2 * rayon::current_num_threads());
    let tile_rows = share.clamp(least, TILE_ROWS[1].max(least)).div_ceil(every);
    // Tile by tile, its rows of what is done.
    let mut tiles: Vec<Vec<&mut [f32]>> = Vec::new();
    tiles.resize_with(rows.div_ceil(tile_rows) * across, Vec::new);
    for (row, z_mm) in done.z_mm.chunks_exact_mut(columns).enumerate() {
        for (column, z_mm) in z_mm.chunks_mut(TILE_COLUMNS).enumerate() {
            tiles[row / tile_rows * across + column].push(z_mm);
        }
    }
    let scratch = || (Field::empty(0, 0), Targets::new(0, 0));
    tiles.into_par_iter().enumerate().for_each_init(scratch, |(field, targets), (k, to)| {
        let tile = Window {
            column: out.column + (k % across * TILE_COLUMNS) as i64,
            row: out.row + (k / across * tile_rows * every) as i64,
            columns: to[0].len(),
            rows: to.len(),
        };
        tile_on_samples(h, profile, &stencil, tile, every as i64, sense, way, field, targets);
        for (row, to) in to.into_iter().enumerate() {
            sense.give_row(to, targets.row(row));
        }
    });
    done
}

/// One tile: `tile.rows` rows, `every` apart.
#[allow(clippy::too_many_arguments)]
fn tile_on_samples(
    h: &Heights,
    profile: &Profile,
    stencil: &Stencil,
    tile: Window,
    every: i64,
    sense: Sense,
    way: Way,
    field: &mut Field,
    targets: &mut Targets,
) {
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
    field.fill(h, input, sense);
    targets.clear(tile.columns, tile.rows);
    dilate_by(field, &pairs, profile, targets, way);
}

/// How contacts are found; only balls have more than two ways.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// By whichever of the others is less work on the surface at hand.
    Known,
    EveryTap,
    Contacts,
}

/// Raises the targets by the field, by whichever way suits the profile.
pub(super) fn dilate<P: Pairs>(field: &Field, pairs: &P, profile: &Profile, targets: &mut Targets) {
    dilate_by(field, pairs, profile, targets, Way::Known);
}

fn dilate_by<P: Pairs>(field: &Field, pairs: &P, profile: &Profile, targets: &mut Targets, way: Way) {
    let plateau = profile.plateau_mm() / profile.step_mm();
    let chords = plateau >= LEAST_CHORD;
    if chords {
        chord::flat_bottom(field, pairs, targets, plateau + 1.0);
        if profile.plateau_mm() >= profile.radius_mm() {
            return;
        }
    }
    let mut given_up = !profile.is_ball() || profile.radius() < LEAST_SEARCH || way == Way::EveryTap;
    if !given_up {
        let most = if way == Way::Contacts { f64::INFINITY } else { brute::work(profile, targets) };
        contact::contacts(field, pairs, profile, targets, most, &mut given_up);
    }
    if !given_up {
        return;
    }
    // Where looking for a ball's contacts is too much work, maxima leave nothing out either.
    if profile.is_ball() || profile.radius() < bounded::LEAST_RADIUS || way == Way::EveryTap {
        brute::every_tap(field, pairs, chords, targets);
    } else {
        bounded::bounded(field, pairs, chords, targets);
    }
}

#[cfg(test)]
#[allow(dead_code)]
#[path = "../../tests/compensation/surfaces.rs"]
mod surfaces;

#[cfg(test)]
mod tests {
    use super::super::lanes::{Portable, Vectors};
    use super::*;

    /// By the definition and by the way that suits the cutter, one after the other.
    fn bits<V: Vectors>(h: &Heights, cutter: &str) -> [Vec<u32>; 2] {
        let profile = Profile::new(cutter.parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
        let stencil = Stencil::new(&profile, 0.0, 0.0);
        let window = h.window.grown(5);
        let halo = profile.reach() as i64 + 1;
        let input = window.grown(halo as usize);
        let pairs = OnSamples {
            stencil: &stencil,
            reach: halo - 1,
            input_rows: input.rows as i64,
            input_row: input.row,
            target_row: window.row,
            target_rows: window.rows,
            every: 1,
            shift: halo,
        };
        let field = Field::of(h, input, Sense::Raise);
        let done = |fill: &dyn Fn(&mut Targets)| {
            let mut targets = Targets::new(window.columns, window.rows);
            fill(&mut targets);
            let mut bits = Vec::new();
            for row in 0..window.rows {
                bits.extend(targets.row(row)[..window.columns].iter().map(|z| z.to_bits()));
            }
            bits
        };
        let every_tap = done(&|targets| brute::body::<V, _>(&field, &pairs, false, targets));
        let pruned = if profile.is_ball() {
            done(&|targets| {
                contact::body::<V, _>(&field, &pairs, &profile, targets, f64::INFINITY, &mut false)
            })
        } else {
            done(&|targets| {
                let plateau = profile.plateau_mm() / profile.step_mm();
                if plateau > 0.0 {
                    chord::body::<V, _>(&field, &pairs, targets, plateau + 1.0);
                }
                if plateau < profile.radius() {
                    bounded::body::<V, _>(&field, &pairs, plateau > 0.0, targets);
                }
            })
        };
        [every_tap, pruned]
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits_on_every_surface() {
        surfaces::all(64).par_iter().for_each(|(name, h)| {
            let cutters = [
                "ball:0.12",
                "ball:0.2",
                "ball:0.5",
                "flat:0.3",
                "bull:0.4:0.1",
                "vee:60:0:0.3",
                "taper:0.2:10:0.3",
                "vee:120:0:0.8",
            ];
            for cutter in cutters {
                let [portable, pruned] = bits::<Portable>(h, cutter);
                assert!(portable == pruned, "{cutter} on {name}, portable");
                #[cfg(target_arch = "x86_64")]
                {
                    use super::super::lanes::{Avx2, Avx512};
                    if is_x86_feature_detected!("avx2") {
                        for bits in bits::<Avx2>(h, cutter) {
                            assert!(bits == portable, "{cutter} on {name}, 256 bits");
                        }
                    }
                    if is_x86_feature_detected!("avx512f") {
                        for bits in bits::<Avx512>(h, cutter) {
                            assert!(bits == portable, "{cutter} on {name}, 512 bits");
                        }
                    }
                }
            }
        });
    }
}
