use super::ball::Reachable;
use super::chains::on_chains;
use super::cones::Cones;
use super::feed::{Fed, Feed};
use super::field::{Field, Sense, Targets};
use super::held::Rows;
use super::lanes::LANES;
use super::outlet::Outlet;
use super::pairs::OnSamples;
use super::search::Progress;
use super::stencil::Stencil;
use super::way::{Way, has_table, is_folded, is_searched_on_samples, without_search};
use super::{Profile, Tables, contact, folded};
use crate::grid::{Heights, Window};
use crate::memory::untouched;
use rayon::prelude::*;

/// Columns of one tile: its rows stay in a core's cache.
const TILE_COLUMNS: usize = 2048;

/// Reach of a cutter, in samples, up to which the rows of tiles twice as wide stay there, too.
const SMALL_REACH: usize = 16;

/// Rows of one tile without a search, at least and at most; a tile reads twice the cutter's reach more.
const TILE_ROWS: [usize; 2] = [128, 4096];

/// Rows that are held at once where they are not fed.
const WHOLE_ROWS: usize = 1024;

/// Cutter locations at the samples of `out`, which may reach past the part: the lowest z of the
/// cutter's lowest point at which it does not cut into `h`. NaN where no data is in reach.
pub fn cutter_location(h: &Heights, profile: &Profile, out: Window) -> Heights {
    on_samples(h, &Tables::new(*profile), out, 1, Sense::Raise)
}

/// [`cutter_location_rows_into`] by one way only, at every row, for benches: all give the same bits.
#[doc(hidden)]
pub fn cutter_location_by(h: &Heights, profile: &Profile, out: Window, way: Way, done: &mut Heights) {
    on_samples_into(h, &Tables::new(*profile), out, 1, Sense::Raise, way, done);
}

/// As [`cutter_location`], at the rows `out.row`, `out.row + every`, ... of `out` only: the k-th
/// row of what is returned is row `out.row + k every`, and its window counts these rows.
///
/// `every` is at least 1.
pub fn cutter_location_rows(h: &Heights, profile: &Profile, out: Window, every: usize) -> Heights {
    on_samples(h, &Tables::new(*profile), out, every.max(1), Sense::Raise)
}

/// As [`cutter_location_rows`], in the memory that `done` has: taking some anew, and giving it back,
/// costs about as much as what is done to a sample under a small cutter.
pub fn cutter_location_rows_into(
    h: &Heights,
    profile: &Profile,
    out: Window,
    every: usize,
    done: &mut Heights,
) {
    on_samples_into(h, &Tables::new(*profile), out, every.max(1), Sense::Raise, Way::Known, done);
}

/// What a cutter standing at the locations `cl` (NaN: it does not stand there) leaves of a stock
/// without top: min over |d| <= R of cl(x + d) - s(d), NaN where no position reaches.
pub fn erode(cl: &Heights, profile: &Profile, out: Window) -> Heights {
    on_samples(cl, &Tables::new(*profile), out, 1, Sense::Lower)
}

fn on_samples(h: &Heights, tables: &Tables, out: Window, every: usize, sense: Sense) -> Heights {
    let mut done = Heights { window: out, z_mm: Vec::new() };
    on_samples_into(h, tables, out, every, sense, Way::Known, &mut done);
    done
}

pub(super) fn on_samples_into(
    h: &Heights,
    tables: &Tables,
    out: Window,
    every: usize,
    sense: Sense,
    way: Way,
    done: &mut Heights,
) {
    let rows = out.rows.div_ceil(every);
    done.window = Window { rows, ..out };
    // Every sample is written below.
    untouched(&mut done.z_mm, rows * out.columns);
    let to = Outlet::plain(&mut done.z_mm, out.columns);
    on_tiles(h.into(), tables, out, every, sense, way, to);
}

/// Work on the samples of `out`, every `every`-th row: by a search strip by strip, or else tile by tile.
pub(super) fn on_tiles(
    h: Rows<'_>,
    tables: &Tables,
    out: Window,
    every: usize,
    sense: Sense,
    way: Way,
    to: Vec<Outlet<'_>>,
) {
    if to.is_empty() || out.columns == 0 {
        return;
    }
    let profile = tables.profile();
    let (rows, columns) = (out.rows.div_ceil(every), out.columns);
    let width = if profile.reach() <= SMALL_REACH {
        evenly(columns, 2 * TILE_COLUMNS)
    } else {
        strip_columns(columns)
    };
    let of = OnTile::new(h, tables, every, sense, way);
    if is_searched_on_samples(profile, every, way) {
        return on_chains(&of, out, width, to);
    }
    let across = columns.div_ceil(width);
    let least = TILE_ROWS[0].max(4 * profile.reach());
    let share = (out.rows * across).div_ceil(2 * rayon::current_num_threads());
    let tile_rows = share.clamp(least, TILE_ROWS[1].max(least)).div_ceil(every);
    // Tile by tile, its rows of what is done.
    let mut tiles: Vec<Vec<Outlet<'_>>> = Vec::new();
    tiles.resize_with(rows.div_ceil(tile_rows) * across, Vec::new);
    for (row, to) in to.into_iter().enumerate() {
        for (column, to) in to.split(width).enumerate() {
            tiles[row / tile_rows * across + column].push(to);
        }
    }
    let scratch = || (Field::empty(0, 0), Targets::new(0, 0));
    tiles.into_par_iter().with_max_len(1).enumerate().for_each_init(scratch, |scratch, (k, mut to)| {
        let tile = Window {
            column: out.column + (k % across * width) as i64,
            row: out.row + (k / across * tile_rows * every) as i64,
            columns: to[0].columns(),
            rows: to.len(),
        };
        of.without_search(tile, &mut to, scratch);
    });
}

/// Columns of one strip of a part.
pub(super) fn strip_columns(columns: usize) -> usize {
    evenly(columns, TILE_COLUMNS)
}

/// Columns of tiles that are all about as wide, so that threads have equal shares.
fn evenly(columns: usize, most: usize) -> usize {
    columns.div_ceil(columns.div_ceil(most)).next_multiple_of(LANES)
}

/// What is to be done on each tile: `tile.rows` rows, `every` apart.
pub(super) struct OnTile<'a> {
    h: Rows<'a>,
    pub profile: &'a Profile,
    stencil: &'a Stencil,
    cones: Option<&'a Cones>,
    pub every: i64,
    sense: Sense,
    way: Way,
}

/// How a search over the rows of a strip goes on from one band to the next.
pub(super) struct Going {
    /// Where it began.
    row: i64,
    fed: Fed,
    progress: Progress<Reachable>,
}

impl<'a> OnTile<'a> {
    pub fn new(h: Rows<'a>, tables: &'a Tables, every: usize, sense: Sense, way: Way) -> OnTile<'a> {
        let profile = tables.profile();
        let cones = has_table(profile, way).then(|| tables.cones());
        OnTile { h, profile, stencil: tables.on_samples(), cones, every: every as i64, sense, way }
    }

    /// Does a tile by a search that goes on upwards where it stopped, at most up to the row `end`.
    pub fn go_on(
        &self,
        tile: Window,
        end: i64,
        to: &mut [Outlet<'_>],
        scratch: &mut (Field, Targets),
        going: &mut Option<Going>,
    ) {
        let (field, targets) = scratch;
        let row = going.as_ref().map_or(tile.row, |going| going.row);
        let rows = ((end - row) as usize).div_ceil(self.every as usize);
        let (input, pairs) = self.pairs(Window { row, rows, ..tile });
        let first = ((tile.row - row) / self.every) as usize;
        let (mut feed, mut progress) = match going.take() {
            None => (Feed::new(self.h, input, self.sense, &pairs, to, field, targets), Progress::new()),
            Some(Going { fed, progress, .. }) => {
                (Feed::again(self.h, input, self.sense, &pairs, to, first, fed), progress)
            }
        };
        let mut given_up = false;
        let fed = Some((&mut feed, &mut progress));
        contact::contacts(field, &pairs, self.profile, targets, fed, self.most(tile), &mut given_up);
        if given_up {
            self.without_search(tile, to, scratch);
        } else {
            *going = Some(Going { row, fed: feed.fed, progress });
        }
    }

    fn without_search(&self, tile: Window, to: &mut [Outlet<'_>], (field, targets): &mut (Field, Targets)) {
        if is_folded(self.profile, self.way) {
            let (input, pairs) = self.pairs(tile);
            folded::every_sample(self.h, input, self.sense, &pairs, field, to);
            return;
        }
        let at_once = WHOLE_ROWS.max(2 * self.profile.reach()).div_ceil(self.every as usize);
        for (k, to) in to.chunks_mut(at_once).enumerate() {
            let row = tile.row + (k * at_once) as i64 * self.every;
            let tile = Window { row, rows: to.len(), ..tile };
            let (input, pairs) = self.pairs(tile);
            field.fill(self.h, input, self.sense);
            targets.clear(tile.columns, tile.rows);
            without_search(field, &pairs, self.profile, self.cones, targets, self.way);
            for (row, to) in to.iter_mut().enumerate() {
                to.give_portable(self.sense, targets.row(row));
            }
        }
    }

    /// What a tile reads, and how its samples are paired.
    pub fn pairs(&self, tile: Window) -> (Window, OnSamples<'_>) {
        let reach = self.profile.reach() as i64;
        // One more than is under the cutter, for its neighbours.
        let halo = reach + 1;
        let input = Window {
            column: tile.column - halo,
            row: tile.row - halo,
            columns: tile.columns + 2 * halo as usize,
            rows: (tile.rows - 1) * self.every as usize + 1 + 2 * halo as usize,
        };
        let pairs = OnSamples {
            stencil: self.stencil,
            reach,
            input_rows: input.rows as i64,
            input_row: input.row,
            target_row: tile.row,
            target_rows: tile.rows,
            every: self.every,
            shift: halo,
        };
        (input, pairs)
    }

    /// Work at which looking for contacts is given up: what it counts takes about twice as long as a sum.
    fn most(&self, tile: Window) -> f64 {
        match self.way {
            Way::Contacts => f64::INFINITY,
            _ => 0.5 * folded::work(self.profile, tile.columns, tile.rows),
        }
    }
}

#[cfg(test)]
#[allow(dead_code)]
#[path = "../../tests/compensation/surfaces.rs"]
pub(super) mod surfaces;

#[cfg(test)]
mod tests {
    use super::super::lanes::{Portable, Vectors};
    use super::super::way::has_chords;
    use super::super::{bounded, brute, chord};
    use super::*;

    fn bits_of(z_mm: &[f32]) -> Vec<u32> {
        z_mm.iter().map(|z| z.to_bits()).collect()
    }

    /// By the definition, by the way that suits the cutter, by a table, and by every sample with as few sums as may be.
    fn bits<V: Vectors>(h: &Heights, cutter: &str) -> [Vec<u32>; 4] {
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
        let field = Field::of(h.into(), input, Sense::Raise);
        let mut searched = Field::of(h.into(), input, Sense::Raise);
        let done = |fill: &mut dyn FnMut(&mut Targets)| {
            let mut targets = Targets::new(window.columns, window.rows);
            fill(&mut targets);
            let mut bits = Vec::new();
            for row in 0..window.rows {
                let mut to = vec![0.0; window.columns];
                Sense::Raise.give_row(&mut to, targets.row(row));
                bits.extend(bits_of(&to));
            }
            bits
        };
        let every_tap = done(&mut |targets| brute::body::<V, _>(&field, &pairs, false, targets));
        let pruned = if profile.is_ball() {
            done(&mut |targets| {
                contact::body::<V, _>(
                    &mut searched,
                    &pairs,
                    &profile,
                    targets,
                    None,
                    f64::INFINITY,
                    &mut false,
                )
            })
        } else {
            done(&mut |targets| {
                let plateau = profile.plateau_mm() / profile.step_mm();
                if plateau > 0.0 {
                    chord::body::<V, _>(&field, &pairs, targets, plateau + 1.0, None);
                }
                if plateau < profile.radius() {
                    bounded::body::<V, _>(&field, &pairs, plateau > 0.0, targets);
                }
            })
        };
        let mut folded = Heights { window, z_mm: vec![0.0; window.samples()] };
        folded::body::<V>(
            h.into(),
            input,
            Sense::Raise,
            &pairs,
            &mut Field::empty(0, 0),
            &mut Outlet::plain(&mut folded.z_mm, window.columns),
        );
        let folded = bits_of(&folded.z_mm);
        if profile.is_ball() {
            return [every_tap.clone(), every_tap, pruned, folded];
        }
        let cones = Cones::new(&profile, &stencil, has_chords(&profile));
        let listed = done(&mut |targets| {
            if has_chords(&profile) {
                chord::body::<V, _>(
                    &searched,
                    &pairs,
                    targets,
                    profile.plateau_mm() / profile.step_mm() + 1.0,
                    None,
                );
            }
            if profile.plateau_mm() < profile.radius_mm() {
                let (field, most) = (&mut searched, f64::INFINITY);
                contact::body_by_table::<V, _>(field, &pairs, &cones, targets, most, &mut false);
            }
        });
        [every_tap, pruned, listed, folded]
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
                let [portable, pruned, listed, folded] = bits::<Portable>(h, cutter);
                assert!(portable == pruned, "{cutter} on {name}, portable");
                assert!(portable == listed, "{cutter} on {name}, portable, by a table");
                assert!(portable == folded, "{cutter} on {name}, portable, by every sample");
                #[cfg(target_arch = "x86_64")]
                {
                    use super::super::x86::{Avx2, Avx512};
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
