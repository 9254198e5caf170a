use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::Grid;
use crate::screen::Scene;

/// Part of the reflected light that stays on the audience when something is not where it should be.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Tolerance {
    pub what: String,
    pub unit: &'static str,
    pub off: Vec<f64>,
    pub on_audience: Vec<f64>,
}

/// Moves the projector along each axis under the whole screen, and tilts and shifts one tile of it. Facets keep their
/// normals; a ray goes where the mirror now sends it.
pub fn misalignment(scene: &Scene, screen: &Grid, tile: &Grid) -> Vec<Tolerance> {
    let shifts_mm = [-200.0, -100.0, -50.0, -20.0, -10.0, 0.0, 10.0, 20.0, 50.0, 100.0, 200.0];
    let shifts_tile_mm = [-50.0, -20.0, -10.0, -5.0, -2.0, 0.0, 2.0, 5.0, 10.0, 20.0, 50.0];
    let tilts_deg = [-2.0, -1.0, -0.5, -0.2, -0.1, 0.0, 0.1, 0.2, 0.5, 1.0, 2.0];
    let moved = |axis: DVec3, mm: f64| {
        on_audience(scene, screen, scene.projector_m + axis * 1e-3 * mm, DQuat::IDENTITY, DVec3::ZERO)
    };
    let tilted = |axis: DVec3, deg: f64| {
        on_audience(
            scene,
            tile,
            scene.projector_m,
            DQuat::from_axis_angle(axis, deg.to_radians()),
            DVec3::ZERO,
        )
    };
    let shifted =
        |axis: DVec3, mm: f64| on_audience(scene, tile, scene.projector_m, DQuat::IDENTITY, axis * 1e-3 * mm);
    let row = |what: &str, unit, off: &[f64], share: &dyn Fn(f64) -> f64| Tolerance {
        what: what.into(),
        unit,
        off: off.to_vec(),
        on_audience: off.iter().map(|&off| share(off)).collect(),
    };
    vec![
        row("projector along x", "mm", &shifts_mm, &|mm| moved(DVec3::X, mm)),
        row("projector along y", "mm", &shifts_mm, &|mm| moved(DVec3::Y, mm)),
        row("projector along z", "mm", &shifts_mm, &|mm| moved(DVec3::Z, mm)),
        row("tile along x", "mm", &shifts_tile_mm, &|mm| shifted(DVec3::X, mm)),
        row("tile along y", "mm", &shifts_tile_mm, &|mm| shifted(DVec3::Y, mm)),
        row("tile along z", "mm", &shifts_tile_mm, &|mm| shifted(DVec3::Z, mm)),
        row("tile turned about x", "degrees", &tilts_deg, &|deg| tilted(DVec3::X, deg)),
        row("tile turned about y", "degrees", &tilts_deg, &|deg| tilted(DVec3::Y, deg)),
        row("tile turned about z", "degrees", &tilts_deg, &|deg| tilted(DVec3::Z, deg)),
    ]
}

/// Share of the reflected light that meets the audience, with the cells turned about their own centres, then
/// shifted.
fn on_audience(scene: &Scene, grid: &Grid, projector_m: DVec3, turn: DQuat, shift_m: DVec3) -> f64 {
    let sums: Vec<[f64; 2]> = grid
        .cells
        .par_iter()
        .map(|cell| {
            let x = cell.point_m + shift_m;
            let i = (projector_m - x).normalize();
            let view = scene.view(x);
            let (mut on, mut all) = (0.0, 0.0);
            for beam in &cell.beams {
                let n = turn * beam.normal;
                let o = 2.0 * i.dot(n) * n - i;
                all += beam.flux;
                on += if view.hit(o) { beam.flux } else { 0.0 };
            }
            [on, all]
        })
        .collect();
    let (on, all) = sums.iter().fold((0.0, 0.0), |(on, all), sum| (on + sum[0], all + sum[1]));
    if all > 0.0 { on / all } else { 0.0 }
}
