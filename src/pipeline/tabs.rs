//! Whether the slot around a tile is cut through, and whether its tabs stand: measured along the middle of the slot
//! that the read-back programs leave.

use super::beside::cut_out_of;
use super::plan::TileSetup;
use super::shop::Shop;
use crate::grid::Window;
use crate::job::{Job, Kind};
use crate::toolpath::beside::CutOut;
use crate::verify::{self, Blank, Judged};

/// Between two places that are looked at, in mm.
const STEP_MM: f64 = 0.02;
/// What is higher than the planned floor by less is floor: the controller's grid and a cutter's tip.
const FLOOR_MM: f64 = 0.03;

/// The slot around a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// Position among the job's operations.
    pub operation: usize,
    /// Tabs that were asked for, on all sides.
    pub wanted: usize,
    /// Stretches of the slot that stand higher than its floor.
    pub standing: usize,
    /// The narrowest of them at its top, and the lowest, in mm; infinite where there is none.
    pub narrowest_mm: f64,
    pub lowest_mm: f64,
    pub cut_out: CutOut,
}

impl Slot {
    /// Whether what stands is what was asked for.
    pub fn holds(&self) -> bool {
        let Some(tab) = self.cut_out.tab else { return self.standing == 0 };
        self.standing == self.wanted
            && self.narrowest_mm >= tab.width_mm - 2.0 * STEP_MM
            && self.lowest_mm >= tab.height_mm - 1e-6
    }
}

/// The slots of a tile after all of its programs.
pub fn slots(job: &Job, shop: &Shop, tile: &TileSetup, blank: &Blank, programs: &[Judged]) -> Vec<Slot> {
    let cut_outs = job.operations.iter().enumerate().filter(|(_, operation)| operation.kind == Kind::CutOut);
    cut_outs
        .map(|(index, operation)| {
            let cut_out = cut_out_of(operation, &shop.tools[index], shop);
            slot(index, cut_out, tile, blank, programs)
        })
        .collect()
}

fn slot(operation: usize, cut_out: CutOut, tile: &TileSetup, blank: &Blank, programs: &[Judged]) -> Slot {
    let lattice = tile.surface().lattice();
    let radius = cut_out.shape.radius_mm();
    let underside_mm = blank.top_mm - cut_out.thickness_mm;
    let floor_mm = underside_mm - cut_out.through_mm + FLOOR_MM;
    let index = |mm: f64| (mm / STEP_MM).floor() as i64;
    let across = [-radius, lattice.width_mm + radius, lattice.height_mm + radius].map(index);
    let along = |length_mm: f64| (index(-radius), (index(length_mm + radius) - index(-radius) + 1) as usize);
    let (column, columns) = along(lattice.width_mm);
    let (row, rows) = along(lattice.height_mm);
    let lines = [
        Window { column, row: across[0], columns, rows: 1 },
        Window { column, row: across[2], columns, rows: 1 },
        Window { column: across[0], row, columns: 1, rows },
        Window { column: across[1], row, columns: 1, rows },
    ];
    let tab = cut_out.tab;
    let wanted = tab.map_or(0, |tab| 4 * tab.count as usize);
    let mut slot = Slot {
        operation,
        wanted,
        standing: 0,
        narrowest_mm: f64::INFINITY,
        lowest_mm: f64::INFINITY,
        cut_out,
    };
    for line in lines {
        let swept = verify::sweep(blank.heights(line, STEP_MM, 0.0), STEP_MM, 0.0, programs);
        let high = |z: &f32| !z.is_nan() && f64::from(*z) > floor_mm;
        for run in swept.heights.z_mm.chunk_by(|a, b| high(a) == high(b)).filter(|run| high(&run[0])) {
            slot.standing += 1;
            let top_mm = run.iter().map(|&z| f64::from(z)).fold(f64::NEG_INFINITY, f64::max) - underside_mm;
            let full_mm = tab.map_or(top_mm, |tab| tab.height_mm.min(top_mm));
            let wide = run.iter().filter(|&&z| f64::from(z) - underside_mm >= full_mm - 1e-4).count();
            slot.narrowest_mm = slot.narrowest_mm.min(wide as f64 * STEP_MM);
            slot.lowest_mm = slot.lowest_mm.min(top_mm);
        }
    }
    slot
}
