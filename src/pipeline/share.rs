//! A share of the tiles' area, spread evenly, and how far what is measured on it may be from the whole.

use crate::fidelity::light::draw;
use crate::grid::{Lattice, Window};

/// Samples along a side of a square that is looked at: two or three cells of a screen, more than most cutters reach.
const SQUARE: usize = 1024;

/// The squares that stand for all of some tiles, of each tile its own: of every 1 / `share` in a row one, drawn by its
/// place, the tiles one after the other. All of them where `share` is 1.
pub fn squares(tiles: impl IntoIterator<Item = Lattice>, share: f64) -> Vec<Vec<Window>> {
    let starts = |count: usize| (0..count).step_by(SQUARE);
    let mut all: Vec<(usize, Window)> = Vec::new();
    let mut chosen: Vec<Vec<Window>> = Vec::new();
    for (tile, lattice) in tiles.into_iter().enumerate() {
        chosen.push(Vec::new());
        for (nth, row) in starts(lattice.rows).enumerate() {
            let rows = SQUARE.min(lattice.rows - row);
            let along = starts(lattice.columns).map(|column| {
                let columns = SQUARE.min(lattice.columns - column);
                (tile, Window { column: column as i64, row: row as i64, columns, rows })
            });
            // To and fro, so that neighbours in the list are neighbours on the tile.
            let mut along: Vec<(usize, Window)> = along.collect();
            if nth % 2 == 1 {
                along.reverse();
            }
            all.append(&mut along);
        }
    }
    let strata = ((all.len() as f64 * share).round() as usize).clamp(1, all.len().max(1));
    let first = |stratum: usize| stratum * all.len() / strata;
    for stratum in 0..strata {
        let (start, end) = (first(stratum), first(stratum + 1));
        let [part, ..] = draw(stratum as i64, 0, 0);
        if let Some((tile, window)) = all.get(start + (part * (end - start) as f64) as usize) {
            chosen[*tile].push(*window);
        }
    }
    chosen
}

/// Standard error of the ratio of two sums over squares, `(part, of)` each in the order of [`squares`], that were
/// drawn one from each of some strata: by the differences of neighbours (Wolter, Introduction to Variance
/// Estimation, 2007, chapter 8). None for fewer than two.
pub fn standard_error(squares: &[(f64, f64)], share: f64) -> Option<f64> {
    let count = squares.len() as f64;
    let (part, of) = squares.iter().fold((0.0, 0.0), |sum, square| (sum.0 + square.0, sum.1 + square.1));
    if squares.len() < 2 || of <= 0.0 {
        return None;
    }
    let ratio = part / of;
    let rest = |square: &(f64, f64)| square.0 - ratio * square.1;
    let differences: f64 = squares.windows(2).map(|pair| (rest(&pair[0]) - rest(&pair[1])).powi(2)).sum();
    let variance = differences / (2.0 * (count - 1.0));
    Some(((1.0 - share).max(0.0) * count * variance).sqrt() / of)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(columns: usize, rows: usize) -> Lattice {
        let step_mm = 0.01;
        Lattice {
            columns,
            rows,
            step_mm,
            width_mm: columns as f64 * step_mm,
            height_mm: rows as f64 * step_mm,
        }
    }

    #[test]
    fn all_of_a_tile_is_every_square_once() {
        let lattice = lattice(5000, 2100);
        let all = squares([lattice], 1.0).concat();
        assert_eq!(all.len(), 15);
        assert_eq!(all.iter().map(Window::samples).sum::<usize>(), 5000 * 2100);
    }

    #[test]
    fn a_share_is_spread_over_the_tile() {
        let lattice = lattice(20_000, 20_000);
        let some = squares([lattice], 0.1).concat();
        assert_eq!(some.len(), 40);
        for quarter in 0..4 {
            let inside = |w: &&Window| w.column / 10_000 + 2 * (w.row / 10_000) == quarter;
            let count = some.iter().filter(inside).count();
            assert!((7..=13).contains(&count), "{count} in quarter {quarter}");
        }
        assert_eq!(squares([lattice], 1e-9).concat().len(), 1);
    }

    #[test]
    fn a_share_of_many_small_tiles_is_no_more_than_that() {
        let some = squares((0..200).map(|_| lattice(900, 700)), 0.1);
        assert_eq!(some.len(), 200);
        assert!(some.chunks(10).all(|tiles| tiles.concat().len() == 1));
    }

    /// Of a figure that drifts over the tile and has noise, nine of ten estimates lie within two standard errors.
    #[test]
    fn the_error_is_about_what_it_says() {
        let of = |n: i64, set: i64| 0.3 + n as f64 * 5e-4 + 0.2 * (draw(n, set, 1)[0] - 0.5);
        let (mut within, sets) = (0, 200);
        for set in 0..sets {
            let all: Vec<f64> = (0..400).map(|n| of(n, set)).collect();
            let truth = all.iter().sum::<f64>() / 400.0;
            let drawn: Vec<(f64, f64)> = (0..40)
                .map(|stratum| {
                    let nth = (10.0 * draw(stratum, set, 2)[0]) as i64;
                    (all[(stratum * 10 + nth) as usize], 1.0)
                })
                .collect();
            let mean = drawn.iter().map(|square| square.0).sum::<f64>() / 40.0;
            let error = standard_error(&drawn, 0.1).expect("40 squares");
            within += i64::from((mean - truth).abs() < 2.0 * error);
        }
        assert!(within * 10 > 9 * sets && within < sets, "{within} of {sets}");
    }
}
