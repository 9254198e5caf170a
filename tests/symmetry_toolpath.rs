//! What must not change a path: the axis it runs along, a mirror, the part it is cut out of, threads.

mod relief;

use std::collections::BTreeSet;

use relief::{Relief, site};
use screenmill::toolpath::finish::{self, Params, Pattern, Spacing};
use screenmill::toolpath::{Kind, Site, Toolpath, rough};

/// Binary fractions, so that mirrored sums are the same sums.
const STEP: f64 = 1.0 / 64.0;
const UNIT: f64 = 1.0 / 1024.0;

fn hills(x: f64, y: f64) -> f64 {
    let z = (0.4 * x - 0.3 * y).min(0.3 * y - 0.2 * x).min(0.1 - 0.5 * (x - 0.4).abs());
    let wall = if x > 0.75 && y > 0.5 { 0.25 } else { 0.0 };
    // Heights that a mirror moves without rounding.
    ((z + wall) * 4096.0).round() / 4096.0
}

fn params() -> Params {
    Params {
        shape: "ball:0.25".parse().unwrap(),
        spacing: Spacing::StepoverMm(0.0625),
        direction_deg: 0.0,
        pattern: Pattern::Zigzag,
        stock_to_leave_mm: 0.0,
        restart_passes: 0,
    }
}

fn plan(site: &Site, params: &Params) -> Toolpath {
    finish::finish(site, params, &|_| ()).unwrap()
}

fn cuts(path: &Toolpath) -> BTreeSet<[i32; 3]> {
    path.moves.iter().filter(|m| m.kind != Kind::Rapid).map(|m| m.to).collect()
}

#[test]
fn passes_along_y_are_passes_along_x_of_the_transposed_part() {
    let part = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], hills);
    let turned = Relief::new([0.75, 1.0], STEP, [0.4, 0.5], |x, y| hills(y, x));
    let along_x = plan(&site(&part, UNIT, 0.0), &params());
    let along_y = plan(&site(&turned, UNIT, 0.0), &Params { direction_deg: 90.0, ..params() });
    let swapped: Vec<_> = along_y.moves.iter().map(|m| (m.kind, [m.to[1], m.to[0], m.to[2]])).collect();
    let straight: Vec<_> = along_x.moves.iter().map(|m| (m.kind, m.to)).collect();
    assert_eq!(straight, swapped);
    let aslant = plan(&site(&part, UNIT, 0.0), &Params { direction_deg: 30.0, ..params() });
    let turned_back = plan(&site(&turned, UNIT, 0.0), &Params { direction_deg: 60.0, ..params() });
    let swapped: Vec<_> = turned_back.moves.iter().map(|m| (m.kind, [m.to[1], m.to[0], m.to[2]])).collect();
    assert_eq!(aslant.moves.iter().map(|m| (m.kind, m.to)).collect::<Vec<_>>(), swapped);
    let clear = |direction_deg| rough::Params {
        shape: "flat:0.25".parse().unwrap(),
        stepdown_mm: 0.125,
        stepover_mm: Some(0.125),
        stock_to_leave_mm: 0.0625,
        direction_deg,
        pattern: Pattern::Zigzag,
        ramp_slope: f64::INFINITY,
        clear_mm: 0.25,
    };
    let along_x = rough::rough(&site(&part, UNIT, 0.0), &clear(0.0), &|_| ()).unwrap();
    let along_y = rough::rough(&site(&turned, UNIT, 0.0), &clear(90.0), &|_| ()).unwrap();
    let swapped: Vec<_> = along_y.moves.iter().map(|m| (m.kind, [m.to[1], m.to[0], m.to[2]])).collect();
    assert_eq!(along_x.moves.iter().map(|m| (m.kind, m.to)).collect::<Vec<_>>(), swapped);
}

#[test]
fn a_part_mirrored_across_the_passes_has_the_mirrored_cuts() {
    let part = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], hills);
    let mirrored = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], |x, y| hills(x, 0.75 - y));
    let one_way = Params { pattern: Pattern::OneWay, ..params() };
    let there = cuts(&plan(&site(&part, UNIT, 0.0), &one_way));
    let here = cuts(&plan(&site(&mirrored, UNIT, 0.0), &one_way));
    let height = (0.75 / UNIT) as i32;
    let back: BTreeSet<[i32; 3]> = here.iter().map(|&[x, y, z]| [x, height - y, z]).collect();
    assert_eq!(there, back);
}

#[test]
fn tiles_of_a_part_have_their_passes_on_one_lattice() {
    let part = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], hills);
    let whole = finish::layout(&site(&part, UNIT, 0.0), &params()).unwrap();
    let tile = Relief::new([0.5, 0.5], STEP, [0.5, 0.4], |x, y| hills(x + 0.5, y + 0.21875));
    let place = Site { origin_mm: [0.5, 0.21875], ..site(&tile, UNIT, 0.0) };
    let part_of = finish::layout(&place, &params()).unwrap();
    let shift = (0.21875 / UNIT) as i32;
    assert!(part_of.passes.iter().all(|v| whole.passes.contains(&(v + shift))));
    assert_eq!((part_of.start + (0.5 / UNIT) as i32 - whole.start) % whole.pitch, 0);
    let aslant = Params { direction_deg: 30.0, ..params() };
    let cut = |site: &Site| cuts(&plan(site, &Params { pattern: Pattern::OneWay, ..aslant }));
    let (whole, part_of) = (cut(&site(&part, UNIT, 0.0)), cut(&place));
    // Vertices of one tile lie on lines of the other: whole units from one pass to the next.
    let lines = |points: &BTreeSet<[i32; 3]>, at: [f64; 2]| -> BTreeSet<i64> {
        let line = |p: &[i32; 3]| {
            let [x, y] = [0, 1].map(|axis| f64::from(p[axis]) + at[axis] / UNIT);
            (y - (30f64.to_radians().tan() * x).round()) as i64
        };
        points.iter().map(line).collect()
    };
    assert!(lines(&part_of, [0.5, 0.21875]).is_subset(&lines(&whole, [0.0; 2])));
}

#[test]
fn height_above_the_datum_does_not_matter() {
    let low = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], hills);
    let high = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], |x, y| 40.0 + hills(x, y));
    assert_eq!(plan(&site(&low, UNIT, 0.0), &params()), plan(&site(&high, UNIT, 0.0), &params()));
}

#[test]
fn the_program_zero_moves_z_and_nothing_else() {
    let part = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], hills);
    let top = Site { top_allowance_mm: 0.125, z_zero_mm: 0.125, ..site(&part, UNIT, 0.0) };
    let zero = Site { z_zero_mm: 0.0, ..top };
    let (a, b) = (plan(&top, &params()), plan(&zero, &params()));
    let lifted: Vec<_> = a.moves.iter().map(|m| [m.to[0], m.to[1], m.to[2] + 128]).collect();
    assert_eq!(lifted, b.moves.iter().map(|m| m.to).collect::<Vec<_>>());
}

#[test]
fn threads_do_not_matter() {
    let part = Relief::new([1.0, 0.75], STEP, [0.5, 0.4], hills);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| plan(&site(&part, UNIT, 0.0005), &params()))
    };
    assert_eq!(on(1), on(5));
}
