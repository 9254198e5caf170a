//! Small surfaces given by a formula, and a sweep of the cutter by dense sampling, which shares nothing
//! with the planner.
#![allow(dead_code)]

use screenmill::cutter::Shape;
use screenmill::grid::{Heights, Lattice, Window};
use screenmill::surface::{Error, Surface};
use screenmill::tolerance::Budget;
use screenmill::toolpath::{Kind, Site, Toolpath};

/// A height over every sample of a rectangle; NaN where the function says so.
pub struct Relief {
    pub lattice: Lattice,
    pub z_mm: Vec<f32>,
    pub top_mm: f64,
    pub bottom_mm: f64,
    pub steepest: [f64; 2],
    /// Corners of its faces, in its own z; none where only the samples are known.
    pub outlines: Vec<Vec<[f64; 3]>>,
}

impl Relief {
    pub fn new(
        size_mm: [f64; 2],
        step_mm: f64,
        steepest: [f64; 2],
        height: impl Fn(f64, f64) -> f64,
    ) -> Relief {
        let lattice = Lattice::covering(size_mm[0], size_mm[1], step_mm);
        let mut z_mm = Vec::new();
        for row in 0..lattice.rows as i64 {
            for column in 0..lattice.columns as i64 {
                z_mm.push(height(lattice.x_mm(column), lattice.y_mm(row)) as f32);
            }
        }
        let fold = |f: fn(f32, f32) -> f32| z_mm.iter().copied().fold(f32::NAN, f);
        let (top_mm, bottom_mm) = (f64::from(fold(f32::max)), f64::from(fold(f32::min)));
        Relief { lattice, z_mm, top_mm, bottom_mm, steepest, outlines: Vec::new() }
    }
}

impl Surface for Relief {
    fn lattice(&self) -> Lattice {
        self.lattice
    }
    fn top_mm(&self) -> f64 {
        self.top_mm
    }
    fn bottom_mm(&self) -> f64 {
        self.bottom_mm
    }
    fn steepest(&self) -> [f64; 2] {
        self.steepest
    }
    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        let whole = Heights {
            window: self.lattice.window(),
            z_mm: self.z_mm.iter().map(|&z| (f64::from(z) - datum_mm) as f32).collect(),
        };
        Ok(whole.crop(window))
    }
    fn outlines(&self, _low_mm: [f64; 2], _high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        self.outlines.clone()
    }
}

/// A blank around the relief: the stock's top at 0.2 mm, the program's zero on it.
pub fn site<'a>(relief: &'a Relief, unit_mm: f64, path_tolerance_mm: f64) -> Site<'a> {
    let depth_mm = relief.top_mm - relief.bottom_mm;
    let budget = Budget::split(0.002, path_tolerance_mm, relief.steepest, depth_mm).unwrap();
    Site {
        surface: relief,
        origin_mm: [0.0, 0.0],
        neighbours: false,
        margin_mm: 0.6,
        top_allowance_mm: 0.2,
        z_zero_mm: 0.2,
        clearance_mm: 2.0,
        retract: None,
        unit_mm,
        apart_mm: unit_mm,
        budget,
        tightest: budget,
    }
}

/// What is left of a blank, sample by sample, margin included, in the tile's frame.
pub struct Stock {
    pub step_mm: f64,
    pub margin: i64,
    pub columns: i64,
    pub rows: i64,
    pub z_mm: Vec<f64>,
}

/// What one operation did to the stock.
#[derive(Debug, Default)]
pub struct Cut {
    pub deepest_bite_mm: f64,
    pub deepest_rapid_mm: f64,
    pub deepest_plunge_mm: f64,
}

impl Stock {
    pub fn blank(site: &Site) -> Stock {
        let lattice = site.surface.lattice();
        let margin = (site.margin_mm / lattice.step_mm).round() as i64;
        let (columns, rows) = (lattice.columns as i64 + 2 * margin, lattice.rows as i64 + 2 * margin);
        let z_mm = vec![site.top_allowance_mm; (columns * rows) as usize];
        Stock { step_mm: lattice.step_mm, margin, columns, rows, z_mm }
    }

    /// Cuts a path by standing at points no more than `dense_mm` apart, off the path by up to
    /// `stray_mm` in changing directions.
    pub fn cut(&mut self, site: &Site, shape: Shape, path: &Toolpath, dense_mm: f64, stray_mm: f64) -> Cut {
        let mut cut = Cut::default();
        let mm = |p: [i32; 3]| {
            let at = p.map(|c| f64::from(c) * path.unit_mm);
            [at[0], at[1], at[2] + site.z_zero_mm]
        };
        let mut at = mm(path.moves[0].to);
        let mut turn = 0.0f64;
        for step in &path.moves[1..] {
            let to = mm(step.to);
            let length = (0..3).map(|k| (to[k] - at[k]).powi(2)).sum::<f64>().sqrt();
            // What a plunge goes into, it goes into at once.
            let once = step.kind == Kind::Plunge;
            let points = if once { 1 } else { (length / dense_mm).ceil().max(1.0) as usize };
            for i in 0..=points {
                let t = i as f64 / points as f64;
                turn += 2.4;
                let away = if step.kind == Kind::Rapid { 0.0 } else { stray_mm * 0.999 };
                let tilt = (turn * 0.37).sin();
                let flat = (1.0 - tilt * tilt).sqrt();
                let stray = [away * flat * turn.cos(), away * flat * turn.sin(), -away * tilt.abs()];
                let place: Vec<f64> = (0..3).map(|k| at[k] + t * (to[k] - at[k]) + stray[k]).collect();
                let bite = self.stand(shape, [place[0], place[1], place[2]]);
                if step.kind == Kind::Rapid {
                    cut.deepest_rapid_mm = cut.deepest_rapid_mm.max(bite);
                }
                if step.kind == Kind::Plunge {
                    cut.deepest_plunge_mm = cut.deepest_plunge_mm.max(bite);
                }
                cut.deepest_bite_mm = cut.deepest_bite_mm.max(bite);
            }
            at = to;
        }
        cut
    }

    fn stand(&mut self, shape: Shape, at: [f64; 3]) -> f64 {
        let radius = shape.radius_mm();
        let index = |mm: f64| mm / self.step_mm - 0.5 + self.margin as f64;
        let mut bite = 0.0f64;
        let rows = (index(at[1] - radius).floor().max(0.0) as i64)
            ..=(index(at[1] + radius).ceil() as i64).min(self.rows - 1);
        for row in rows {
            let columns = (index(at[0] - radius).floor().max(0.0) as i64)
                ..=(index(at[0] + radius).ceil() as i64).min(self.columns - 1);
            for column in columns {
                let x = (column as f64 - self.margin as f64 + 0.5) * self.step_mm;
                let y = (row as f64 - self.margin as f64 + 0.5) * self.step_mm;
                // A nanometre short of the rim, where a sample is under the cutter by rounding only.
                let d = (x - at[0]).hypot(y - at[1]);
                if d > radius - 1e-9 {
                    continue;
                }
                let Some(height) = shape.height_mm(d) else { continue };
                let z = &mut self.z_mm[(row * self.columns + column) as usize];
                // What stays within rounding is not cut.
                if at[2] + height < *z - 1e-12 {
                    bite = bite.max(*z - at[2] - height);
                    *z = at[2] + height;
                }
            }
        }
        bite
    }

    /// Machined less designed at every sample with data: (x, y, deviation).
    pub fn deviation(&self, relief: &Relief) -> Vec<(f64, f64, f64)> {
        let mut out = Vec::new();
        for row in 0..relief.lattice.rows as i64 {
            for column in 0..relief.lattice.columns as i64 {
                let design = f64::from(relief.z_mm[row as usize * relief.lattice.columns + column as usize]);
                if design.is_nan() {
                    continue;
                }
                let z = self.z_mm[((row + self.margin) * self.columns + column + self.margin) as usize];
                let deviation = z - (design - relief.top_mm);
                out.push((relief.lattice.x_mm(column), relief.lattice.y_mm(row), deviation));
            }
        }
        out
    }

    /// The largest gouge in mm, 0 if there is none.
    pub fn gouge_mm(&self, relief: &Relief) -> f64 {
        self.deviation(relief).iter().map(|d| -d.2).fold(0.0, f64::max)
    }
}

/// Refuses a path that breaks a rule of its type.
pub fn assert_rules(site: &Site, path: &Toolpath) {
    let top = ((site.top_allowance_mm - site.z_zero_mm) / site.unit_mm).round() as i32;
    let clearance = top + (site.clearance_mm / site.unit_mm).round() as i32;
    let first = path.moves[0];
    assert_eq!((first.kind, first.to[2]), (Kind::Rapid, clearance));
    let last = path.moves[path.moves.len() - 1];
    assert_eq!((last.kind, last.to[2]), (Kind::Rapid, clearance));
    assert_eq!(path.pass_starts[0], 0);
    let mut at = first.to;
    for (i, step) in path.moves.iter().enumerate().skip(1) {
        assert!(step.to != at || path.pass_starts.contains(&i), "move {i} goes nowhere");
        let level = step.to[0] == at[0] && step.to[1] == at[1];
        match step.kind {
            Kind::Rapid => assert!(level || at[2] >= clearance && step.to[2] >= clearance, "rapid {i}"),
            Kind::Plunge => assert!(level && step.to[2] < at[2], "plunge {i}"),
            Kind::Cut => assert!(!level || step.to[2] > at[2], "cut {i} goes down"),
        }
        at = step.to;
    }
    for &start in &path.pass_starts {
        assert_eq!((path.moves[start].kind, path.moves[start].to[2]), (Kind::Rapid, clearance));
    }
}
