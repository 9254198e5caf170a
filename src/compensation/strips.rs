use super::Tables;
use super::ball::FARTHEST;
use super::blocks::ROWS;
use super::field::{Field, Sense, Targets};
use super::held::Rows;
use super::outlet::Outlet;
use super::tiles::{Going, OnTile, on_tiles, strip_columns};
use super::way::{Way, is_searched_on_samples};
use crate::grid::Window;
use rayon::prelude::*;

/// Rows past a cutter's reach that a search looks at before it gives a position.
pub(super) const AHEAD: usize = ROWS + FARTHEST + 2;

/// Reach of a cutter, in samples, up to which all rows in its reach are held for every strip.
const MOST_REACH: usize = 512;

/// Cutter locations of a part, or what they leave, from its lowest row up, one band after the other. A search
/// goes on where it stopped at the band before, so that no row is looked at twice however low the bands are.
pub(super) struct Strips<'a> {
    tables: &'a Tables,
    /// All that will be asked for.
    all: Window,
    every: usize,
    sense: Sense,
    width: usize,
    strips: Vec<Strip>,
}

struct Strip {
    scratch: (Field, Targets),
    going: Option<Going>,
}

/// Whether a cutter is taken in strips; if at any distance of rows, then at every row.
pub(super) fn in_strips(tables: &Tables, columns: usize, every: usize) -> bool {
    let profile = tables.profile();
    is_searched_on_samples(profile, every, Way::Known)
        && profile.reach() <= MOST_REACH
        && columns.div_ceil(strip_columns(columns)) >= 2 * rayon::current_num_threads()
}

/// Bytes that the strips of a cutter hold, at most.
pub(super) fn strip_bytes(tables: &Tables, columns: usize) -> u64 {
    if !in_strips(tables, columns, 1) {
        return 0;
    }
    let reach = tables.profile().reach();
    let across = columns.div_ceil(strip_columns(columns)) as u64;
    let wide = (strip_columns(columns) + 2 * reach + 256) as u64;
    4 * across * wide * (2 * reach + ROWS + 2 + (ROWS + 2 * FARTHEST + 2).next_power_of_two()) as u64
}

impl<'a> Strips<'a> {
    pub fn new(tables: &'a Tables, all: Window, every: usize, sense: Sense) -> Strips<'a> {
        let columns = all.columns.max(1);
        let width = if in_strips(tables, columns, every) { Some(strip_columns(columns)) } else { None };
        Strips::of_width(tables, all, every, sense, width)
    }

    /// None: without strips.
    fn of_width(
        tables: &'a Tables,
        all: Window,
        every: usize,
        sense: Sense,
        width: Option<usize>,
    ) -> Strips<'a> {
        let strip = || Strip { scratch: (Field::empty(0, 0), Targets::new(0, 0)), going: None };
        let mut strips = Vec::new();
        strips.resize_with(width.map_or(0, |width| all.columns.div_ceil(width)), strip);
        Strips { tables, all, every, sense, width: width.unwrap_or(0), strips }
    }

    /// The next rows from `row` on, one for each of `to`. `h` has the rows in reach and [`AHEAD`] more, as
    /// far as there are any.
    pub fn rows(&mut self, h: Rows<'_>, row: i64, to: Vec<Outlet<'_>>) {
        let rows = to.len();
        if rows == 0 || self.all.columns == 0 {
            return;
        }
        let out = Window { row, rows: (rows - 1) * self.every + 1, ..self.all };
        if self.strips.is_empty() {
            on_tiles(h, self.tables, out, self.every, self.sense, Way::Known, to);
            return;
        }
        let mut of_strips: Vec<Vec<Outlet<'_>>> = Vec::new();
        of_strips.resize_with(self.strips.len(), || Vec::with_capacity(rows));
        for to in to {
            for (strip, to) in of_strips.iter_mut().zip(to.split(self.width)) {
                strip.push(to);
            }
        }
        let of = OnTile::new(h, self.tables, self.every, self.sense, Way::Known);
        let (width, end) = (self.width, self.all.row_end());
        let strips = self.strips.par_iter_mut().with_max_len(1).zip(of_strips).enumerate();
        strips.for_each(|(k, (strip, mut to))| {
            let column = out.column + (k * width) as i64;
            let tile = Window { column, row, columns: to[0].columns(), rows };
            of.go_on(tile, end, &mut to, &mut strip.scratch, &mut strip.going);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::tiles::surfaces;
    use super::*;
    use crate::compensation::{Profile, cutter_location_rows, erode};

    fn bits(z_mm: &[f32]) -> Vec<u32> {
        z_mm.iter().map(|z| z.to_bits()).collect()
    }

    #[test]
    fn a_search_that_stops_and_goes_on_gives_the_same_bits() {
        surfaces::all(90).par_iter().for_each(|(name, h)| {
            for (cutter, every) in [("ball:0.2", 1), ("ball:0.4", 1), ("ball:0.3", 3)] {
                let profile = Profile::new(cutter.parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
                let tables = Tables::new(profile);
                let all = h.window.grown(7);
                for sense in [Sense::Raise, Sense::Lower] {
                    if sense == Sense::Lower && every > 1 {
                        continue;
                    }
                    let whole = match sense {
                        Sense::Raise => cutter_location_rows(h, &profile, all, every),
                        Sense::Lower => erode(h, &profile, all),
                    };
                    for rows in [1, 7, 40] {
                        let mut strips = Strips::of_width(&tables, all, every, sense, Some(32));
                        let mut in_bands = whole.clone();
                        for (k, z_mm) in in_bands.z_mm.chunks_mut(rows * all.columns).enumerate() {
                            z_mm.fill(0.0);
                            let to = Outlet::plain(z_mm, all.columns);
                            strips.rows(h.into(), all.row + (k * rows * every) as i64, to);
                        }
                        assert!(bits(&in_bands.z_mm) == bits(&whole.z_mm), "{cutter} on {name}, {rows} rows");
                    }
                }
            }
        });
    }
}
