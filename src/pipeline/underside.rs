//! Programs that cut the underside of a blank, judged on the blank as it lies then: turned over left to right.

use std::collections::BTreeMap;

use super::Error;
use super::cut::Motions;
use super::plan::{Program, TileSetup};
use super::shop::Shop;
use crate::grid::Window;
use crate::verify::{self, Blank, Judged};

/// Pitch of the lattice on which the underside is cut, where the blank is not too large for it.
const STEP_MM: f64 = 0.02;
/// Samples that are held at most.
const MOST_SAMPLES: f64 = 16e6;
/// Squares in which depth and surface are compared, in mm.
const SQUARE_MM: f64 = 0.25;

/// Where a cut of the underside comes nearest to the part's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thin {
    /// Metal between the two.
    pub left_mm: f64,
    /// Tile frame, as seen from the top.
    pub at_mm: [f64; 2],
}

/// What the programs do, one for each, in their order.
pub fn judge(shop: &Shop, tile: &TileSetup, programs: &[&Program]) -> Result<Vec<Motions>, Error> {
    if programs.is_empty() {
        return Ok(Vec::new());
    }
    let bounds = tile.setup.blank;
    let [low, high] = [bounds.low_mm, bounds.high_mm].map(|corner| [corner[0], corner[1]]);
    let blank = Blank { low_mm: low, high_mm: high, top_mm: bounds.high_mm[2] };
    let shape = |program: &Program| shop.tools[program.operation].shape;
    let judged: Vec<Judged> =
        programs.iter().map(|program| Judged::new(&program.reading, shape(program), [0.0; 3])).collect();
    let nose_mm = shop.machine.spindle.nose_diameter_mm;
    let bodies: Vec<_> =
        programs.iter().map(|program| shop.tools[program.operation].cylinders(nose_mm)).collect();
    let body_hits = verify::body_hits(&blank, &judged, &bodies);
    let step_mm = ((high[0] - low[0]) * (high[1] - low[1]) / MOST_SAMPLES).sqrt().max(STEP_MM);
    let first = low.map(|mm| (mm / step_mm).floor() as i64);
    let end = high.map(|mm| (mm / step_mm).ceil() as i64);
    let window = Window {
        column: first[0],
        row: first[1],
        columns: (end[0] - first[0]).max(0) as usize,
        rows: (end[1] - first[1]).max(0) as usize,
    };
    let swept = verify::sweep(blank.heights(window, step_mm, 0.0), step_mm, 0.0, &judged);
    let mut out = Vec::new();
    for ((judged, cut), body_hit) in judged.iter().zip(swept.programs).zip(body_hits) {
        let thin = thinnest(shop, tile, judged)?;
        out.push(Motions { cut, lateral_rapid: judged.lateral_rapid(&blank), body_hit, thin });
    }
    Ok(out)
}

/// The least metal between what a program cuts into the underside and the part's lowest surface in the same square;
/// None where it stays beside the part.
fn thinnest(shop: &Shop, tile: &TileSetup, judged: &Judged) -> Result<Option<Thin>, Error> {
    let surface = tile.surface();
    let lattice = surface.lattice();
    let radius = judged.shape.radius_mm();
    let mut depths: BTreeMap<[i64; 2], f64> = BTreeMap::new();
    let mut from = [f64::NAN; 3];
    for motion in &judged.reading.motions {
        let to = motion.to_mm;
        let start = if from.iter().all(|v| v.is_finite()) { from } else { to };
        from = to;
        if !motion.known() || start[2].min(to[2]) >= 0.0 {
            continue;
        }
        let pieces = ((to[0] - start[0]).hypot(to[1] - start[1]) / SQUARE_MM).ceil().max(1.0) as usize;
        let part = |k: usize, axis: usize| start[axis] + (to[axis] - start[axis]) * k as f64 / pieces as f64;
        for k in 0..pieces {
            let z_mm = part(k, 2).min(part(k + 1, 2));
            let low = [0, 1].map(|axis| part(k, axis).min(part(k + 1, axis)) - radius);
            let high = [0, 1].map(|axis| part(k, axis).max(part(k + 1, axis)) + radius);
            let square = |mm: f64| (mm / SQUARE_MM).floor() as i64;
            for row in square(low[1])..=square(high[1]) {
                for column in square(low[0])..=square(high[0]) {
                    let depth = depths.entry([column, row]).or_insert(0.0);
                    *depth = depth.min(z_mm);
                }
            }
        }
    }
    let metal_mm = shop.stock.thickness_mm - tile.allowance_mm;
    let mut thin: Option<Thin> = None;
    for ([column, row], z_mm) in depths {
        // As seen from the top.
        let right = lattice.width_mm - column as f64 * SQUARE_MM;
        let (left, front) = (right - SQUARE_MM, row as f64 * SQUARE_MM);
        let sample = |mm: f64, end: usize| ((mm / lattice.step_mm).floor().max(0.0) as usize).min(end);
        let (c0, c1) = (sample(left, lattice.columns), sample(right + lattice.step_mm, lattice.columns));
        let (r0, r1) =
            (sample(front, lattice.rows), sample(front + SQUARE_MM + lattice.step_mm, lattice.rows));
        if c0 >= c1 || r0 >= r1 {
            continue;
        }
        let window = Window { column: c0 as i64, row: r0 as i64, columns: c1 - c0, rows: r1 - r0 };
        let heights = surface.heights(window, surface.top_mm())?;
        let lowest = heights.z_mm.iter().filter(|z| !z.is_nan()).fold(f32::INFINITY, |low, z| low.min(*z));
        let left_mm = metal_mm + f64::from(lowest) + z_mm;
        if left_mm < thin.map_or(f64::INFINITY, |thin| thin.left_mm) {
            thin = Some(Thin { left_mm, at_mm: [left + 0.5 * SQUARE_MM, front + 0.5 * SQUARE_MM] });
        }
    }
    Ok(thin)
}
