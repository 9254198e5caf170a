use glam::DVec3;
use rayon::prelude::*;

use super::{Grid, Seat, high_gain_towards};

/// The screen as one seat sees it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SeatView {
    pub seat: Seat,
    /// Mean gain over the screen, through the mask.
    pub mean_gain: f64,
    /// Standard deviation over the mean, of the directional screen and of the model of a high-gain one.
    pub deviation: f64,
    pub high_gain_deviation: f64,
    /// Gain at each cell of the grid, through the mask.
    #[serde(skip)]
    pub gain: Vec<f64>,
    #[serde(skip)]
    pub high_gain: Vec<f64>,
}

/// Works out the view of the screen from a seat; `mask` has a value for each cell of the grid.
pub fn seat_view(grid: &Grid, mask: &[f64], projector_m: DVec3, seat: Seat) -> SeatView {
    let place = DVec3::from_array(seat.place_m);
    let gain: Vec<f64> =
        grid.cells.par_iter().zip(mask).map(|(cell, mask)| mask * cell.gain_towards(place)).collect();
    let high_gain: Vec<f64> = grid
        .cells
        .iter()
        .map(|cell| high_gain_towards(cell.point_m.with_z(0.0), projector_m, place))
        .collect();
    let (mean_gain, deviation) = spread(&gain);
    SeatView { seat, mean_gain, deviation, high_gain_deviation: spread(&high_gain).1, gain, high_gain }
}

/// Mean, and standard deviation over the mean.
pub(super) fn spread(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    (mean, if mean > 0.0 { variance.sqrt() / mean } else { 0.0 })
}

/// Mean luminance of the screen over places in a horizontal plane.
#[derive(Clone, Debug)]
pub struct AudienceMap {
    /// Corners of the plane's piece: x and z in m.
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub columns: usize,
    pub height_m: f64,
    /// Mean gain, row-major, nearest row first.
    pub gain: Vec<f64>,
    pub inside: Vec<bool>,
}

/// Works out the mean gain of the screen, through its mask, at `columns` x `rows` places at one height.
pub fn audience_map(
    grid: &Grid,
    mask: &[f64],
    (low, high): ([f64; 2], [f64; 2]),
    height_m: f64,
    (columns, rows): (usize, usize),
    inside: impl Fn(DVec3) -> bool + Sync,
) -> AudienceMap {
    let at = |index: usize| {
        let (c, r) = ((index % columns) as f64 + 0.5, (index / columns) as f64 + 0.5);
        let x = low[0] + (high[0] - low[0]) * c / columns as f64;
        let z = low[1] + (high[1] - low[1]) * r / rows as f64;
        DVec3::new(x, height_m, z)
    };
    let count = grid.cells.len().max(1) as f64;
    let gain = (0..columns * rows)
        .into_par_iter()
        .map(|index| {
            let place = at(index);
            grid.cells.iter().zip(mask).map(|(cell, mask)| mask * cell.gain_towards(place)).sum::<f64>()
                / count
        })
        .collect();
    let inside = (0..columns * rows).map(|index| inside(at(index))).collect();
    AudienceMap { low, high, columns, height_m, gain, inside }
}

impl AudienceMap {
    /// Mean gain over the places inside the audience, and its standard deviation over the mean.
    pub fn inside_spread(&self) -> (f64, f64) {
        let values: Vec<f64> = self
            .gain
            .iter()
            .zip(&self.inside)
            .filter(|(_, inside)| **inside)
            .map(|(gain, _)| *gain)
            .collect();
        spread(&values)
    }
}
