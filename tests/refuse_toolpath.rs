//! Operations that are refused, each with its exact message in `tests/refuse/toolpath/`.

mod relief;

use relief::{Relief, site};
use screenmill::tolerance::Budget;
use screenmill::toolpath::finish::{self, Params, Pattern, Spacing};
use screenmill::toolpath::{Site, rough};

fn refused(case: &str, message: String) {
    let path = format!("{}/tests/refuse/toolpath/{case}.txt", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}; it says: {message}"));
    assert_eq!(message, text.lines().next().unwrap_or_default(), "{path}");
}

fn part() -> Relief {
    Relief::new([0.5, 0.4], 0.01, [0.3, 0.2], |x, y| 0.3 * x - 0.2 * y)
}

fn params() -> Params {
    Params {
        shape: "ball:0.2".parse().unwrap(),
        spacing: Spacing::StepoverMm(0.05),
        direction_deg: 0.0,
        pattern: Pattern::Zigzag,
        stock_to_leave_mm: 0.0,
        restart_passes: 0,
    }
}

fn finish_message(site: &Site, params: &Params) -> String {
    finish::finish(site, params, &|_| ()).unwrap_err().to_string()
}

#[test]
fn finishing_that_cannot_be() {
    let relief = part();
    let good = site(&relief, 0.01, 0.0);
    let spacing = |spacing| Params { spacing, ..params() };
    let cases = [
        ("stepover-zero", spacing(Spacing::StepoverMm(0.0))),
        ("stepover-negative", spacing(Spacing::StepoverMm(-0.1))),
        ("stepover-nan", spacing(Spacing::StepoverMm(f64::NAN))),
        ("stepover-over-diameter", spacing(Spacing::StepoverMm(0.3))),
        ("stepover-below-grid", spacing(Spacing::StepoverMm(0.004))),
        ("scallop-below-grid", spacing(Spacing::ScallopMm(1e-6))),
        ("scallop-zero", spacing(Spacing::ScallopMm(0.0))),
        ("scallop-over-radius", spacing(Spacing::ScallopMm(0.2))),
        ("scallop-flat", Params { shape: "flat:0.2".parse().unwrap(), ..spacing(Spacing::ScallopMm(0.001)) }),
        ("leave-negative", Params { stock_to_leave_mm: -0.01, ..params() }),
        ("direction-nan", Params { direction_deg: f64::NAN, ..params() }),
        (
            "cutter-below-sample",
            Params { shape: "ball:0.015".parse().unwrap(), spacing: Spacing::StepoverMm(0.01), ..params() },
        ),
    ];
    for (case, params) in cases {
        refused(case, finish_message(&good, &params));
    }
    refused("clearance", finish_message(&Site { clearance_mm: 0.0, ..good }, &params()));
    refused("grid-unit", finish_message(&Site { unit_mm: -0.01, ..good }, &params()));
    refused("grid-overflow", finish_message(&Site { unit_mm: 1e-10, ..good }, &params()));
    refused("margin", finish_message(&Site { margin_mm: f64::NAN, ..good }, &params()));
}

#[test]
fn a_part_without_data() {
    let mut relief = part();
    relief.z_mm.fill(f32::NAN);
    let site = site(&relief, 0.01, 0.0);
    refused("no-data", finish_message(&site, &params()));
    let message = rough::rough(&site, &rough_params(), &|_| ()).unwrap_err().to_string();
    refused("no-data", message);
}

fn rough_params() -> rough::Params {
    rough::Params {
        shape: "flat:0.2".parse().unwrap(),
        stepdown_mm: 0.1,
        stepover_mm: None,
        stock_to_leave_mm: 0.05,
        direction_deg: 0.0,
        pattern: Pattern::Zigzag,
        ramp_slope: f64::INFINITY,
        clear_mm: 0.2,
    }
}

#[test]
fn roughing_that_cannot_be() {
    let relief = part();
    let good = site(&relief, 0.01, 0.0);
    let cases = [
        ("stepdown-zero", rough::Params { stepdown_mm: 0.0, ..rough_params() }),
        ("stepdown-below-grid", rough::Params { stepdown_mm: 0.005, ..rough_params() }),
        ("stepdown-infinite", rough::Params { stepdown_mm: f64::INFINITY, ..rough_params() }),
        ("rough-stepover", rough::Params { stepover_mm: Some(0.25), ..rough_params() }),
        ("rough-leave-negative", rough::Params { stock_to_leave_mm: -1.0, ..rough_params() }),
        ("direction", rough::Params { direction_deg: 45.0, ..rough_params() }),
        ("clear-negative", rough::Params { clear_mm: -0.1, ..rough_params() }),
    ];
    for (case, params) in cases {
        refused(case, rough::rough(&good, &params, &|_| ()).unwrap_err().to_string());
    }
    let level = Relief::new([0.5, 0.4], 0.01, [0.0, 0.0], |_, _| 0.0);
    let params = rough::Params { stock_to_leave_mm: 0.5, ..rough_params() };
    let flush = Site { top_allowance_mm: 0.0, z_zero_mm: 0.0, ..site(&level, 0.01, 0.0) };
    let message = rough::rough(&flush, &params, &|_| ()).unwrap_err().to_string();
    refused("nothing-to-rough", message);
}

#[test]
fn budgets_that_cannot_be() {
    let split = |gouge_mm, path_tolerance_mm| {
        Budget::split(gouge_mm, path_tolerance_mm, [0.4, 0.3], 3.0).unwrap_err().to_string()
    };
    refused("budget-zero", split(0.0, 0.0));
    refused("budget-spent", split(0.002, 0.002));
    refused("budget-tolerance", split(0.002, -0.001));
}
