//! Planned paths against a sweep by brute force: never a gouge, nothing left that need not be.

mod curves;
mod relief;

use curves::strays;
use proptest::prelude::*;
use relief::{Relief, Stock, assert_rules, site};
use screenmill::grid::{Heights, Lattice, Window};
use screenmill::surface::{Surface, Walled};
use screenmill::toolpath::finish::{self, Pattern, Spacing};
use screenmill::toolpath::{Axis, Kind, Site, Toolpath, rough};

const STEP: f64 = 0.01;
const GOUGE: f64 = 0.002;
/// 32-bit heights a few mm below their datum.
const FLOAT: f64 = 2e-6;

fn surfaces() -> Vec<(&'static str, Relief)> {
    let size = [0.5, 0.4];
    let make = |steepest: [f64; 2], z: &dyn Fn(f64, f64) -> f64| Relief::new(size, STEP, steepest, z);
    vec![
        ("level plane", make([0.0, 0.0], &|_, _| 3.0)),
        ("tilted plane", make([0.35, 0.2], &|x, y| 0.35 * x - 0.2 * y)),
        ("ridge", make([0.4, 0.3], &|x, y| -(0.4 * (x - 0.203).abs()) - 0.3 * (y - 0.21).abs())),
        ("valley", make([0.5, 0.0], &|x, _| 0.5 * (x - 0.25).abs())),
        ("dome", make([0.8, 0.6], &|x, y| -(x - 0.33).powi(2) - (y - 0.27).powi(2))),
        ("steps", make([0.0, 0.0], &|x, y| 0.05 * (x * 6.0).floor() - 0.08 * (y * 5.0).floor())),
        ("wall across", make([0.0, 0.0], &|x, _| if x < 0.253 { 0.0 } else { 0.6 })),
        ("wall along", make([0.0, 0.0], &|_, y| if y < 0.24 { 0.0 } else { -0.5 })),
        ("wall aslant", make([0.1, 0.1], &|x, y| if 2.0 * x + y < 0.7 { 0.1 * x } else { -0.4 - 0.1 * y })),
        (
            "spikes",
            make([0.0, 0.0], &|x, y| {
                let on = (x / STEP) as i64 % 17 == 5 && (y / STEP) as i64 % 13 == 4;
                if on { 0.3 } else { 0.0 }
            }),
        ),
        (
            "hole",
            make([0.2, 0.0], &|x, y| {
                if (x - 0.23).hypot(y - 0.2) < 0.12 { f64::NAN } else { 0.2 * x }
            }),
        ),
        ("torn edge", make([0.0, 0.3], &|x, y| if x + y < 0.25 { f64::NAN } else { -0.3 * y })),
        ("cliffs", make([3.0, 0.0], &|x, _| -3.0 * (x % 0.2))),
    ]
}

fn params(cutter: &str, stepover_mm: f64) -> finish::Params {
    finish::Params {
        shape: cutter.parse().unwrap(),
        spacing: Spacing::StepoverMm(stepover_mm),
        direction_deg: 0.0,
        pattern: Pattern::Zigzag,
        stock_to_leave_mm: 0.0,
        restart_passes: 0,
    }
}

fn plan(site: &Site, params: &finish::Params) -> Toolpath {
    let path = finish::finish(site, params, &|_| ()).unwrap();
    assert_rules(site, &path);
    path
}

#[test]
fn finishing_never_gouges() {
    let cutters = ["ball:0.2", "flat:0.16", "bull:0.2:0.04", "vee:60:0.05:0.2", "taper:0.1:15:0.2"];
    for (i, (name, relief)) in surfaces().into_iter().enumerate() {
        for (k, cutter) in cutters.into_iter().enumerate() {
            let unit_mm = [0.0001, 0.001, 0.01, 0.025][(i + k) % 4];
            let site = site(&relief, unit_mm, 0.0);
            let direction_deg = [0.0, 30.0, 90.0, 111.7, -45.0][(i + 2 * k) % 5];
            let params = finish::Params { direction_deg, ..params(cutter, 0.05) };
            let path = plan(&site, &params);
            let mut stock = Stock::blank(&site);
            let cut = stock.cut(&site, params.shape, &path, 0.002, 0.0);
            let gouge = stock.gouge_mm(&relief);
            assert!(gouge <= GOUGE + FLOAT, "{name}, {cutter}, {unit_mm}, {direction_deg}: {gouge}");
            assert!(cut.deepest_rapid_mm == 0.0, "{name}, {cutter}: {}", cut.deepest_rapid_mm);
        }
    }
}

/// A roof whose ridge, and a plateau whose edge, lie between the samples: (x from, x to, z from, z to).
const PROFILE: [[f64; 4]; 3] =
    [[0.0, 0.2437, -0.1, -0.0025], [0.2437, 0.35333, -0.0025, -0.0408], [0.35333, 0.5, 0.06, 0.06]];

fn roof(step_mm: f64, turned: bool) -> Relief {
    let z = |u: f64| {
        let [a, b, za, zb] = *PROFILE.iter().rev().find(|part| u >= part[0]).unwrap();
        za + (zb - za) * (u - a) / (b - a)
    };
    let place = |u: f64, v: f64| if turned { [v, u] } else { [u, v] };
    let (size, steepest) = (place(0.5, 0.4), place(0.4, 0.0));
    let mut relief = Relief::new(size, step_mm, steepest, |x, y| z(place(x, y)[0]));
    (relief.top_mm, relief.bottom_mm) = (0.06, -0.1);
    let corner = |u: f64, v: f64, z: f64| {
        let [x, y] = place(u, v);
        [x, y, z]
    };
    relief.outlines = PROFILE
        .iter()
        .map(|&[a, b, za, zb]| {
            vec![corner(a, 0.0, za), corner(b, 0.0, zb), corner(b, 0.4, zb), corner(a, 0.4, za)]
        })
        .collect();
    relief
}

#[test]
fn what_stands_between_the_samples_is_not_gouged() {
    for (i, cutter) in ["ball:0.2", "flat:0.16", "bull:0.2:0.04"].into_iter().enumerate() {
        for turned in [false, true] {
            let relief = roof(STEP, turned);
            let site = site(&relief, [0.0001, 0.01, 0.001][i], 0.0);
            let params = params(cutter, 0.05);
            let paths = [
                (plan(&site, &params), 0.0),
                (rough::rough(&site, &rough_params("flat:0.2"), &|_| ()).unwrap(), 0.05),
            ];
            for (path, leave_mm) in paths {
                // Judged on samples five times as dense, whose own misses are a fifth.
                let fine = roof(0.2 * STEP, turned);
                let over = self::site(&fine, site.unit_mm, 0.0);
                let mut stock = Stock::blank(&over);
                let shape = if leave_mm > 0.0 { rough_params("flat:0.2").shape } else { params.shape };
                stock.cut(&over, shape, &path, 0.002, 0.0);
                let least = stock.deviation(&fine).iter().map(|d| d.2).fold(f64::INFINITY, f64::min);
                assert!(least >= leave_mm - GOUGE - FLOAT, "{cutter}, {turned}: {least} of {leave_mm}");
            }
        }
    }
}

/// The wall's own edge lies between two samples.
#[test]
fn a_wall_around_a_part_stands_up_to_its_edge() {
    for (i, cutter) in ["ball:0.2", "flat:0.16", "bull:0.2:0.04"].into_iter().enumerate() {
        let part = |step_mm: f64| Relief::new([0.5, 0.4], step_mm, [0.1, 0.0], |x, _| 0.1 * x);
        let relief = part(STEP);
        let open = site(&relief, [0.0001, 0.01, 0.001][i], 0.0);
        let walled = Walled::new(&relief, relief.top_mm + open.top_allowance_mm);
        let site = Site { surface: &walled, ..open };
        let finish = finish::Params { direction_deg: [0.0, 90.0, 30.0][i], ..params(cutter, 0.05) };
        let rough = rough_params("flat:0.2");
        for (path, shape) in [
            (plan(&site, &finish), finish.shape),
            (rough::rough(&site, &rough, &|_| ()).unwrap(), rough.shape),
        ] {
            let fine = part(0.2 * STEP);
            let over = Site { margin_mm: 0.1, ..self::site(&fine, site.unit_mm, 0.0) };
            let mut stock = Stock::blank(&over);
            stock.cut(&over, shape, &path, 0.002, 0.0);
            let lattice = fine.lattice;
            let (mut least, mut cut) = (f64::INFINITY, false);
            for (at, z_mm) in stock.z_mm.iter().enumerate() {
                let (row, column) =
                    (at as i64 / stock.columns - stock.margin, at as i64 % stock.columns - stock.margin);
                let inside =
                    (0..lattice.rows as i64).contains(&row) && (0..lattice.columns as i64).contains(&column);
                cut |= inside && *z_mm < site.top_allowance_mm;
                if !inside {
                    least = least.min(*z_mm);
                }
            }
            assert!(cut && least >= site.top_allowance_mm - GOUGE - FLOAT, "{cutter}: {least}");
        }
    }
}

#[test]
fn a_controller_that_strays_does_not_gouge() {
    for (i, (name, relief)) in surfaces().into_iter().enumerate() {
        for (k, cutter) in ["ball:0.2", "flat:0.16", "bull:0.2:0.04"].into_iter().enumerate() {
            let direction_deg = [0.0, 90.0][(i + k) % 2];
            let site = site(&relief, 0.001, 0.0008);
            let params = finish::Params { direction_deg, ..params(cutter, 0.06) };
            let path = plan(&site, &params);
            let mut stock = Stock::blank(&site);
            stock.cut(&site, params.shape, &path, 0.0015, 0.0008);
            let gouge = stock.gouge_mm(&relief);
            assert!(gouge <= GOUGE + FLOAT, "{name}, {cutter}, {direction_deg}: {gouge}");
        }
    }
}

#[test]
fn planes_are_few_moves_and_nothing_is_left_but_scallops() {
    for steep in [[0.0, 0.0], [0.35, -0.2], [0.0, 0.4]] {
        let relief = Relief::new([0.5, 0.4], STEP, steep.map(f64::abs), |x, y| steep[0] * x + steep[1] * y);
        for unit_mm in [0.0001, 0.001, 0.01] {
            let site = site(&relief, unit_mm, 0.0);
            let params = params("ball:0.3", 0.02);
            let path = plan(&site, &params);
            let layout = finish::layout(&site, &params).unwrap();
            let mut stock = Stock::blank(&site);
            stock.cut(&site, params.shape, &path, 0.004, 0.0);
            // w^2 / 8R in the facet's plane, a unit, the stated excess, and what the budget did not cover;
            // near an open border, where the ball rolls off steeper than the face, a step of the slope.
            let w = 0.02 * 1.0f64.hypot(steep[1]);
            let most = w * w / (8.0 * 0.15) * 1.1 + unit_mm + screenmill::tolerance::EXCESS_MM + 5e-4;
            for (x, y, deviation) in stock.deviation(&relief) {
                let inside = (0.15..0.35).contains(&x) && (0.15..0.25).contains(&y);
                let border = if inside { 0.0 } else { STEP * steep[0].hypot(steep[1]) };
                let most = most + border;
                assert!(deviation <= most, "{steep:?} {unit_mm}: {deviation} of {most} at {x} {y}");
            }
            // On a plane a pass is one move, and a few around the borders; three make a link.
            let allowed = if unit_mm > 0.005 { 24 } else { 16 };
            assert!(path.moves.len() <= allowed * layout.passes.len(), "{} moves", path.moves.len());
        }
    }
}

/// On coarse grids, too, and on fine ones beside them, whose passes follow one curve.
#[test]
fn slanted_passes_over_a_plane_are_few_moves() {
    let relief = Relief::new([0.9, 0.8], STEP, [0.23, 0.17], |x, y| 0.23 * x - 0.17 * y);
    for (unit_mm, apart_mm) in [(0.025, 0.025), (0.01, 0.01), (0.001, 0.01), (0.0001, 0.01), (0.0001, 0.025)]
    {
        for direction_deg in [10.0, 30.0, 73.0] {
            let site = Site { apart_mm, ..site(&relief, unit_mm, 0.0) };
            let params = finish::Params { direction_deg, ..params("ball:0.6", 0.05) };
            let (path, layout) = (plan(&site, &params), finish::layout(&site, &params).unwrap());
            let each = path.moves.len() as f64 / layout.passes.len() as f64;
            assert!(each < 12.0, "{unit_mm} beside {apart_mm}, {direction_deg}: {each} moves a pass");
        }
    }
}

#[test]
fn a_zigzag_over_a_plane_never_retracts() {
    let relief = Relief::new([0.8, 0.6], STEP, [0.3, 0.2], |x, y| 0.3 * x + 0.2 * y);
    let site = site(&relief, 0.001, 0.0);
    let path = plan(&site, &params("ball:0.4", 0.05));
    assert_eq!(path.pass_starts, vec![0]);
    let restarted = plan(&site, &finish::Params { restart_passes: 4, ..params("ball:0.4", 0.05) });
    let layout = finish::layout(&site, &params("ball:0.4", 0.05)).unwrap();
    assert_eq!(restarted.pass_starts.len(), layout.passes.len().div_ceil(4));
}

#[test]
fn climbing_passes_run_with_the_uncut_material_on_their_right() {
    let relief = Relief::new([0.4, 0.3], STEP, [0.0, 0.0], |_, _| 0.0);
    let site = site(&relief, 0.001, 0.0);
    for (direction_deg, axis, sign) in [(0.0, 0, -1), (90.0, 1, 1)] {
        let params = finish::Params { direction_deg, pattern: Pattern::OneWay, ..params("ball:0.2", 0.05) };
        let path = plan(&site, &params);
        for pair in path.moves.windows(2) {
            let run = pair[1].to[axis] - pair[0].to[axis];
            if pair[1].kind == screenmill::toolpath::Kind::Cut {
                assert_eq!(run.signum(), sign);
            }
        }
    }
}

#[test]
fn scallop_height_is_kept_on_the_steepest_face() {
    for (slope, direction_deg) in [(0.0, 0.0), (0.5, 0.0), (0.0, 45.0), (0.5, 33.0), (0.5, 150.0)] {
        let relief = Relief::new([0.6, 0.6], STEP, [0.0, slope], |_, y| -slope * y);
        let site = site(&relief, 0.0001, 0.0);
        let spacing = Spacing::ScallopMm(0.001);
        let params = finish::Params { spacing, direction_deg, ..params("ball:0.4", 1.0) };
        let path = plan(&site, &params);
        let mut stock = Stock::blank(&site);
        stock.cut(&site, params.shape, &path, 0.002, 0.0);
        let inside = |x: f64, y: f64| (0.1..0.5).contains(&x) && (0.1..0.5).contains(&y);
        let left = stock.deviation(&relief).into_iter().filter(|d| inside(d.0, d.1)).map(|d| d.2);
        let most = left.fold(0.0, f64::max);
        // Measured in z, a scallop on a slope is 1 / cos(slope) as high.
        let limit = 0.001 * 1.0f64.hypot(slope) + screenmill::tolerance::EXCESS_MM + 0.0001;
        assert!(most <= limit && most > 0.0005, "slope {slope}, {direction_deg}: {most} of {limit}");
    }
}

/// A plane without end, under a tile.
struct Plane {
    lattice: Lattice,
    slopes: [f64; 2],
}

impl Plane {
    fn at(&self, x: f64, y: f64) -> f64 {
        self.slopes[0] * x + self.slopes[1] * y
    }
}

impl Surface for Plane {
    fn lattice(&self) -> Lattice {
        self.lattice
    }
    fn top_mm(&self) -> f64 {
        self.at(self.lattice.width_mm, 0.0)
    }
    fn bottom_mm(&self) -> f64 {
        self.at(0.0, self.lattice.height_mm)
    }
    fn steepest(&self) -> [f64; 2] {
        self.slopes.map(f64::abs)
    }
    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, screenmill::surface::Error> {
        let (rows, columns) = (window.row..window.row_end(), window.column..window.column_end());
        let place = |row: i64, column: i64| self.at(self.lattice.x_mm(column), self.lattice.y_mm(row));
        let z_mm =
            rows.flat_map(|row| columns.clone().map(move |column| (place(row, column) - datum_mm) as f32));
        Ok(Heights { window, z_mm: z_mm.collect() })
    }
    fn outlines(&self, _low_mm: [f64; 2], _high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        let corners = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]];
        vec![corners.map(|[x, y]| [x, y, self.at(x, y)]).to_vec()]
    }
}

/// What `rounding-tilt` tells, against the moves themselves: on a plane each pass is one mirror, and how far it is turned
/// is how much farther its end stands from the plane than its begin. Beside its line, where a slanted pass stands on a
/// coarse grid, the plane is higher or lower.
#[test]
fn mirrors_are_turned_by_what_the_path_says() {
    let plane = Plane { lattice: Lattice::covering(0.9, 0.8, STEP), slopes: [0.23, -0.17] };
    let relief = Relief::new([0.9, 0.8], STEP, plane.steepest(), |x, y| plane.at(x, y));
    for (unit_mm, direction_deg) in
        [(0.01, 0.0), (0.01, 30.0), (0.01, 10.0), (0.01, 73.0), (0.01, 45.0), (0.001, 118.0), (0.025, 26.57)]
    {
        let site = Site { surface: &plane, ..site(&relief, unit_mm, 0.0) };
        let params = finish::Params { direction_deg, ..params("ball:1.2", 0.06) };
        let path = plan(&site, &params);
        let layout = finish::layout(&site, &params).unwrap();
        let split = |at: [i32; 3]| if layout.along == Axis::X { [at[0], at[1]] } else { [at[1], at[0]] };
        let nearest = |at: [i32; 3]| {
            let [u, v] = split(at).map(f64::from);
            let away = |k: &usize| (f64::from(layout.passes[*k]) + layout.slope * u - v).abs();
            (0..layout.passes.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap()
        };
        let mut ends: Vec<Vec<[i32; 3]>> = vec![Vec::new(); layout.passes.len()];
        for pair in path.moves.windows(2) {
            let (from, to) = (pair[0].to, pair[1].to);
            if pair[1].kind == Kind::Cut && nearest(from) == nearest(to) && from[..2] != to[..2] {
                ends[nearest(to)].extend([from, to]);
            }
        }
        let stride = 1.0f64.hypot(layout.slope);
        let stepover = f64::from(layout.passes[1] - layout.passes[0]) * unit_mm / stride;
        let passes: Vec<[f64; 2]> = ends
            .iter()
            .filter_map(|ends| {
                let [from, .., to] = ends[..] else { return None };
                let above = |at: [i32; 3]| {
                    let [x, y, z] = at.map(|units| f64::from(units) * unit_mm);
                    z - plane.at(x, y)
                };
                let length = f64::from((split(to)[0] - split(from)[0]).abs()) * unit_mm * stride;
                let deg = ((above(to) - above(from)) / length).atan().to_degrees();
                (length >= stepover - 1e-9).then_some([deg.abs(), length])
            })
            .collect();
        let case = format!("{unit_mm}, {direction_deg}");
        assert!(passes.len() > 10, "{case}: {} passes", passes.len());
        let squares: f64 = passes.iter().map(|[deg, length]| deg * deg * length).sum();
        let rms = (squares / passes.iter().map(|pass| pass[1]).sum::<f64>()).sqrt();
        let worst = passes.iter().map(|pass| pass[0]).fold(0.0, f64::max);
        let tilt = path.tilt.expect("a finish");
        // 32-bit heights.
        let near = |told: f64, is: f64| (told - is).abs() < 1e-3;
        let told = (tilt.rms_deg().expect("mirrors"), tilt.worst.expect("a mirror").deg);
        assert!(near(told.0, rms) && near(told.1, worst), "{case}: {told:?}, {rms} and {worst}");
        assert!(worst > 0.0, "{case}");
    }
}

fn rough_params(cutter: &str) -> rough::Params {
    rough::Params {
        shape: cutter.parse().unwrap(),
        stepdown_mm: 0.15,
        stepover_mm: None,
        stock_to_leave_mm: 0.05,
        direction_deg: 0.0,
        pattern: Pattern::Zigzag,
        ramp_slope: f64::INFINITY,
        clear_mm: 0.3,
    }
}

#[test]
fn roughing_bites_no_deeper_than_its_stepdown_and_leaves_what_it_should() {
    let mut nth = 0;
    for (name, relief) in surfaces() {
        for cutter in ["flat:0.2", "ball:0.24", "bull:0.2:0.05"] {
            nth += 1;
            let unit_mm = [0.0001, 0.001, 0.01][nth % 3];
            let direction_deg = [0.0, 90.0][nth % 2];
            let site = site(&relief, unit_mm, 0.0);
            let ramp_slope = [f64::INFINITY, 0.1][nth / 2 % 2];
            let params = rough::Params { direction_deg, ramp_slope, ..rough_params(cutter) };
            let path = rough::rough(&site, &params, &|_| ()).unwrap();
            assert_rules(&site, &path);
            let mut stock = Stock::blank(&site);
            let cut = stock.cut(&site, params.shape, &path, 0.02, 0.0);
            let least = stock.deviation(&relief).iter().map(|d| d.2).fold(f64::INFINITY, f64::min);
            let case = format!("{name}, {cutter}, {unit_mm}");
            assert!(least >= 0.05 - GOUGE - FLOAT, "{case}: leaves {least}");
            assert_eq!(cut.deepest_rapid_mm, 0.0, "{case}");
            assert!(cut.deepest_bite_mm <= 0.15 + 1e-9, "{case}: bites {}", cut.deepest_bite_mm);
        }
    }
}

/// Down along the cut, and from row to row from the side, instead of into the metal from above.
#[test]
fn roughing_ramps_into_the_metal() {
    for (name, relief) in surfaces().into_iter().take(5) {
        let site = site(&relief, 0.001, 0.0);
        let cut = |ramp_slope: f64, pattern: Pattern| {
            let params = rough::Params { ramp_slope, pattern, ..rough_params("flat:0.2") };
            let mut stock = Stock::blank(&site);
            let path = rough::rough(&site, &params, &|_| ()).unwrap();
            (stock.cut(&site, params.shape, &path, 0.02, 0.0), stock)
        };
        for pattern in [Pattern::Zigzag, Pattern::OneWay] {
            let (straight, first) = cut(f64::INFINITY, pattern);
            let (ramped, second) = cut(0.2, pattern);
            assert!((straight.deepest_plunge_mm - 0.15).abs() < 1e-3, "{name}: {straight:?}");
            assert!(
                ramped.deepest_plunge_mm < 0.05 && ramped.deepest_bite_mm <= 0.15 + 1e-9,
                "{name}: {ramped:?}"
            );
            // The cut comes after its ramp, so nothing stays that would not stay without.
            assert!(first.z_mm.iter().zip(&second.z_mm).all(|(a, b)| *b <= a + 1e-9), "{name}");
        }
    }
}

#[test]
fn roughing_one_way_climbs_and_cuts_the_same() {
    let relief = Relief::new([0.8, 0.5], STEP, [0.3, 0.2], |x, y| -0.3 * (x - 0.4).abs() - 0.2 * y);
    let site = site(&relief, 0.001, 0.0);
    for (direction_deg, axis, sign) in [(0.0, 0, -1), (90.0, 1, 1)] {
        let zigzag = rough::Params { direction_deg, ..rough_params("flat:0.2") };
        let climbing = rough::Params { pattern: Pattern::OneWay, ..zigzag };
        let [mut one, mut other] = [Stock::blank(&site), Stock::blank(&site)];
        let path = rough::rough(&site, &climbing, &|_| ()).unwrap();
        assert_rules(&site, &path);
        let mut cuts = 0;
        for pair in path.moves.windows(2).filter(|pair| pair[1].kind == screenmill::toolpath::Kind::Cut) {
            assert_eq!((pair[1].to[axis] - pair[0].to[axis]).signum(), sign);
            assert_eq!(pair[1].to[1 - axis], pair[0].to[1 - axis]);
            cuts += 1;
        }
        assert!(cuts > 10);
        let climbed = one.cut(&site, climbing.shape, &path, 0.02, 0.0);
        other.cut(&site, zigzag.shape, &rough::rough(&site, &zigzag, &|_| ()).unwrap(), 0.02, 0.0);
        assert!(climbed.deepest_bite_mm <= 0.15 + 1e-9 && climbed.deepest_rapid_mm == 0.0);
        for (a, b) in one.deviation(&relief).iter().zip(other.deviation(&relief)) {
            // Links of a zigzag run at the height of the level above, where nothing is left to cut but cusps.
            assert!(a.2 >= 0.05 - GOUGE - FLOAT && a.2 >= b.2 - 1e-6, "{a:?} {b:?}");
        }
    }
}

#[test]
fn after_roughing_a_finish_bites_little_even_past_the_border() {
    let relief = Relief::new([0.8, 0.5], STEP, [0.3, 0.2], |x, y| -0.3 * (x - 0.4).abs() - 0.2 * y);
    for unit_mm in [0.001, 0.01] {
        let site = site(&relief, unit_mm, 0.0);
        let mut stock = Stock::blank(&site);
        let first = rough_params("flat:0.4");
        stock.cut(&site, first.shape, &rough::rough(&site, &first, &|_| ()).unwrap(), 0.02, 0.0);
        let ball = params("ball:0.3", 0.03);
        let cut = stock.cut(&site, ball.shape, &plan(&site, &ball), 0.003, 0.0);
        // The flat leaves steps of its own width: slope times radius, and the stock to leave.
        assert!(cut.deepest_bite_mm < 0.05 + 0.36 * 0.4 + 0.02, "bites {}", cut.deepest_bite_mm);
        assert!(stock.gouge_mm(&relief) <= GOUGE + FLOAT);
    }
}

fn facets() -> impl Strategy<Value = (Vec<[f64; 3]>, bool)> {
    let plane = (-0.9..0.9f64, -0.9..0.9f64, -0.3..0.0f64).prop_map(|(a, b, c)| [a, b, c]);
    (proptest::collection::vec(plane, 1..7), any::<bool>())
}

fn facetted(planes: &[[f64; 3]], bumps: bool, jump: f64) -> Relief {
    let steepest = [0, 1].map(|k| planes.iter().map(|p| p[k].abs()).fold(0.0, f64::max));
    Relief::new([0.36, 0.28], STEP, steepest, |x, y| {
        let all = planes.iter().map(|p| p[0] * (x - 0.18) + p[1] * (y - 0.14) + p[2]);
        let z = if bumps { all.fold(f64::INFINITY, f64::min) } else { all.fold(f64::NEG_INFINITY, f64::max) };
        if x + 0.3 * y > 0.21 { z + jump } else { z }
    })
}

/// Paths of one finish on several grids: the farthest that one of the finer is from the coarsest, or the other way round,
/// above the coarsest unit and twice the share of simplification.
fn disagreement(relief: &Relief, params: &finish::Params, units_mm: &[f64]) -> (f64, [f64; 3]) {
    let coarsest_mm = units_mm.iter().copied().fold(0.0, f64::max);
    let path = |unit_mm: f64| -> Vec<[f64; 3]> {
        let site = Site { apart_mm: coarsest_mm, ..site(relief, unit_mm, 0.0) };
        let moves = plan(&site, params).moves;
        moves.iter().map(|to| to.to.map(|units| f64::from(units) * unit_mm)).collect()
    };
    let budget = site(relief, coarsest_mm, 0.0).budget;
    // Half way between two grid points a whole unit is too much for a small share of simplification.
    let straight = params.direction_deg.rem_euclid(90.0) == 0.0;
    let narrow = !straight && budget.simplify_mm < coarsest_mm / 16.0;
    let unit_mm = if narrow { coarsest_mm * 1.25f64.sqrt() } else { coarsest_mm };
    let coarse = path(coarsest_mm);
    let fine = units_mm.iter().filter(|unit_mm| **unit_mm < coarsest_mm).map(|&unit_mm| path(unit_mm));
    fine.flat_map(|fine| [strays(&fine, &coarse), strays(&coarse, &fine)])
        .map(|(far_mm, at)| (far_mm - unit_mm - 2.0 * budget.simplify_mm, at))
        .fold((f64::NEG_INFINITY, [0.0; 3]), |most, at| if at.0 > most.0 { at } else { most })
}

#[test]
fn all_grids_of_a_job_follow_one_curve() {
    let cutters = ["ball:0.2", "flat:0.16", "bull:0.2:0.04", "vee:60:0.05:0.2", "taper:0.1:15:0.2"];
    let directions = [0.0, 7.0, 20.0, 26.57, 33.7, 45.0, 60.0, 78.0, 100.0, 125.0, 150.0, 171.0];
    for (i, (name, relief)) in surfaces().into_iter().enumerate() {
        for (k, cutter) in cutters.into_iter().enumerate() {
            for direction_deg in (0..3).map(|nth| directions[(i + 5 * k + 4 * nth) % directions.len()]) {
                let params = finish::Params { direction_deg, ..params(cutter, 0.05) };
                let (over_mm, at) = disagreement(&relief, &params, &[0.01, 0.001, 0.0001]);
                assert!(over_mm <= 0.0, "{name}, {cutter}, {direction_deg}: {over_mm} too far at {at:?}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_facets_are_never_gouged(
        (planes, bumps) in facets(),
        jump in 0.0..0.5f64,
        cutter in proptest::sample::select(vec!["ball:0.16", "flat:0.12", "bull:0.16:0.05", "ball:0.06"]),
        unit_mm in proptest::sample::select(vec![0.0001, 0.001, 0.01, 0.025]),
        times in proptest::sample::select(vec![1.0, 1.0, 10.0, 100.0]),
        stray_mm in proptest::sample::select(vec![0.0, 0.0006]),
        direction_deg in prop_oneof![Just(0.0), Just(90.0), -180.0..180.0f64],
    ) {
        let relief = facetted(&planes, bumps, jump);
        // Beside a coarser grid, up to 0.025 mm.
        let apart_mm = if unit_mm * times > 0.026 { unit_mm } else { unit_mm * times };
        let site = Site { apart_mm, ..site(&relief, unit_mm, stray_mm) };
        let params = finish::Params { direction_deg, ..params(cutter, 0.05) };
        let path = plan(&site, &params);
        let mut stock = Stock::blank(&site);
        let cut = stock.cut(&site, params.shape, &path, 0.002, stray_mm);
        prop_assert!(stock.gouge_mm(&relief) <= GOUGE + FLOAT, "{}", stock.gouge_mm(&relief));
        prop_assert!(stray_mm > 0.0 || cut.deepest_rapid_mm == 0.0);
    }

    #[test]
    fn random_facets_are_cut_alike_on_all_grids(
        (planes, bumps) in facets(),
        jump in 0.0..0.5f64,
        cutter in proptest::sample::select(vec!["ball:0.16", "flat:0.12", "bull:0.16:0.05", "ball:0.06"]),
        units_mm in proptest::sample::select(vec![[0.01, 0.001, 0.0001], [0.025, 0.005, 0.0001]]),
        direction_deg in prop_oneof![Just(0.0), Just(90.0), -180.0..180.0f64],
    ) {
        let params = finish::Params { direction_deg, ..params(cutter, 0.05) };
        let (over_mm, at) = disagreement(&facetted(&planes, bumps, jump), &params, &units_mm);
        prop_assert!(over_mm <= 0.0, "{} too far at {:?}", over_mm, at);
    }
}
