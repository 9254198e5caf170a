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
            let lattice = tile.surface().lattice();
            slot(index, cut_out, [lattice.width_mm, lattice.height_mm], blank, programs)
        })
        .collect()
}

fn slot(operation: usize, cut_out: CutOut, size_mm: [f64; 2], blank: &Blank, programs: &[Judged]) -> Slot {
    let [width_mm, height_mm] = size_mm;
    let radius = cut_out.shape.radius_mm();
    let underside_mm = blank.top_mm - cut_out.thickness_mm;
    let floor_mm = underside_mm - cut_out.through_mm + FLOOR_MM;
    let index = |mm: f64| (mm / STEP_MM).floor() as i64;
    let across = [-radius, width_mm + radius, height_mm + radius].map(index);
    let along = |length_mm: f64| (index(-radius), (index(length_mm + radius) - index(-radius) + 1) as usize);
    let (column, columns) = along(width_mm);
    let (row, rows) = along(height_mm);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toolpath::beside::Tab;
    use crate::verify::{Options, Reading};

    /// Around a tile of 10 x 8 mm with a cutter of 2 mm in a blank of 5 mm, to 0.2 mm under it; over each tab of the
    /// list (side, width of its metal, height from the underside) the cutter is raised.
    fn cut(tabs: &[(usize, f64, f64)]) -> Slot {
        let corners: [[f64; 2]; 5] = [[-1.0, -1.0], [-1.0, 9.0], [11.0, 9.0], [11.0, -1.0], [-1.0, -1.0]];
        let mut text = String::from("G21 G90 M3\nG0 Z5\nG0 X-1 Y-1\nF300\nG1 Z-5.2\n");
        for (side, pair) in corners.windows(2).enumerate() {
            for (_, width_mm, height_mm) in tabs.iter().filter(|tab| tab.0 == side) {
                for (off, z) in [(-0.5 * width_mm - 1.0, height_mm - 5.0), (0.5 * width_mm + 1.0, -5.2)] {
                    let middle = [0, 1].map(|axis| 0.5 * (pair[0][axis] + pair[1][axis]));
                    let [dx, dy] = [0, 1].map(|axis| pair[1][axis] - pair[0][axis]);
                    let at = [
                        middle[0] + off * dx.signum() * f64::from(dx != 0.0),
                        middle[1] + off * dy.signum() * f64::from(dy != 0.0),
                    ];
                    text += &format!("G1 X{:.4} Y{:.4}\nG1 Z{z:.4}\n", at[0], at[1]);
                }
            }
            text += &format!("G1 X{} Y{}\n", pair[1][0], pair[1][1]);
        }
        text += "G0 Z5\nM2\n";
        let reading = Reading::of(text.as_bytes(), &Options::default()).expect("a sound program");
        let cut_out = CutOut {
            shape: "flat:2".parse().expect("a cutter"),
            stepdown_mm: 0.5,
            thickness_mm: 5.0,
            through_mm: 0.2,
            sacrificial_mm: 1.0,
            tab: Some(Tab { count: 1, width_mm: 2.0, height_mm: 1.0 }),
        };
        let blank = Blank { low_mm: [-6.0; 2], high_mm: [16.0, 14.0], top_mm: 0.0 };
        let judged = [Judged::new(&reading, cut_out.shape, [0.0; 3])];
        slot(0, cut_out, [10.0, 8.0], &blank, &judged)
    }

    #[test]
    fn a_tab_that_is_missing_or_too_weak_is_seen() {
        let whole = [(0, 2.0, 1.0), (1, 2.0, 1.0), (2, 2.0, 1.0), (3, 2.0, 1.0)];
        assert!(cut(&whole).holds(), "{:?}", cut(&whole));
        let none = cut(&[]);
        assert!(none.standing == 0 && !none.holds(), "{none:?}");
        let three = cut(&whole[1..]);
        assert!(three.standing == 3 && !three.holds(), "{three:?}");
        let narrow = cut(&[(0, 1.5, 1.0), whole[1], whole[2], whole[3]]);
        assert!((narrow.narrowest_mm - 1.5).abs() < 0.05 && !narrow.holds(), "{narrow:?}");
        let low = cut(&[whole[0], (1, 2.0, 0.6), whole[2], whole[3]]);
        assert!((low.lowest_mm - 0.6).abs() < 1e-4 && !low.holds(), "{low:?}");
    }
}
