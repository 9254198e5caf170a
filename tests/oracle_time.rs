//! Times worked by hand from the controllers' published equations.

#[path = "linuxcnc-sim/programs.rs"]
mod linuxcnc_programs;

use std::collections::HashMap;

use screenmill::machine::Machine;
use screenmill::pipeline::{calibrate_machine, programs_to_measure};
use screenmill::post::Dialect;
use screenmill::verify::{Corner, Kinematics, Options, Reading, Timing, time};

fn grbl(acceleration: f64) -> Kinematics {
    Kinematics {
        feed_max_mm_min: [6000.0; 3],
        rapid_mm_min: [6000.0; 3],
        acceleration_mm_s2: [acceleration; 3],
        path_max_mm_min: f64::INFINITY,
        arc_mm: 0.002,
        corner: Corner::JunctionDeviation { mm: 0.01 },
        look_ahead_blocks: 16,
        block_s: 0.0,
        servo_period_s: 0.0,
        bytes_per_s: None,
    }
}

fn run(body: &str, machine: &Kinematics) -> Timing {
    let text = format!("G21 G90 M3\nG0 Z0\nG0 X0 Y0\n{body}\nM2\n");
    time(&Reading::of(text.as_bytes(), &Options::default()).expect("a sound program"), machine)
}

fn close(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{a} is not {b}");
}

#[test]
fn one_long_move_is_a_trapezoid() {
    // 30 mm at 10 mm/s and 100 mm/s2: 0.1 s and 0.5 mm to speed up and to brake, 29 mm at speed.
    let timing = run("G1 X30 F600", &grbl(100.0));
    close(timing.total_s, 0.1 + 2.9 + 0.1);
    close(timing.at_feed_s, 3.0);
    close(timing.in_corners_s, 0.1);
}

#[test]
fn one_short_move_is_a_triangle() {
    // 0.1 mm at 100 mm/s2 from rest to rest: 2 sqrt(L / a).
    close(run("G1 X0.1 F6000", &grbl(100.0)).total_s, 2.0 * (0.1f64 / 100.0).sqrt());
}

#[test]
fn a_rapid_moves_at_the_slowest_axis() {
    let mut machine = grbl(500.0);
    machine.rapid_mm_min = [6000.0, 6000.0, 3000.0];
    // (40, 0, 30) at 50 mm/s in Z: 83.33 mm/s along 50 mm, and 500 mm/s2 in X is 625 along.
    let timing = run("G0 X40 Z30", &machine);
    let v = 50.0 / 0.6;
    close(timing.rapid_s, 50.0 / v + v / 625.0);
}

/// Time of two long legs with a corner taken at `v_j`.
fn with_corner(v: f64, v_j: f64, a: f64, length: f64) -> f64 {
    let leg = (2.0 * v - v_j) / a + (length - (2.0 * v * v - v_j * v_j) / (2.0 * a)) / v;
    2.0 * leg
}

#[test]
fn corners_follow_grbl() {
    // v_j for 0.01 mm: the published planner's equation at these turns.
    for (a, degrees, v_j) in [
        (100.0, 10.0, 16.2),
        (100.0, 30.0, 5.32),
        (100.0, 60.0, 2.54),
        (100.0, 90.0, 1.55),
        (500.0, 10.0, 36.2),
        (500.0, 30.0, 11.9),
        (500.0, 60.0, 5.69),
        (500.0, 90.0, 3.47),
        (1000.0, 10.0, 51.2),
        (1000.0, 30.0, 16.8),
        (1000.0, 90.0, 4.91f64),
    ] {
        let s = (0.5 * f64::to_radians(degrees)).cos();
        let law = (a * 0.01 * s / (1.0 - s)).sqrt();
        assert!((law - v_j).abs() < 0.005 * v_j, "{degrees} degrees at {a}: {law} and {v_j}");
        // On an axis-free machine the corner's acceleration is a when the turn lies along an axis:
        // directions at +-turn/2 about X, so the change is along Y.
        let (sin, cos) = (0.5 * f64::to_radians(degrees)).sin_cos();
        let body = format!("F6000\nG1 X{:.9} Y{:.9}\nG1 X{:.9} Y0", 100.0 * cos, 100.0 * sin, 200.0 * cos);
        let timing = run(&body, &grbl(a));
        let along = a / cos.abs().max(sin.abs());
        let v = 100.0f64.min(6000.0 / 60.0 / cos.max(sin));
        let wanted = with_corner(v, law.min(v), along, 100.0);
        assert!(
            (timing.total_s - wanted).abs() < 1e-6 * wanted,
            "{degrees} at {a}: {} {wanted}",
            timing.total_s
        );
    }
}

#[test]
fn a_reversal_stops_and_a_straight_line_does_not() {
    let machine = grbl(100.0);
    let two = run("F600\nG1 X10\nG1 X20", &machine).total_s;
    close(two, run("G1 X20 F600", &machine).total_s);
    close(run("F600\nG1 X10\nG1 X0", &machine).total_s, 2.0 * run("G1 X10 F600", &machine).total_s);
}

#[test]
fn look_ahead_limits_short_blocks() {
    // 0.01 mm blocks in line: with n blocks ahead the speed can be at most sqrt(2 a n L).
    let mut body = String::from("F6000");
    for i in 1..=20_000 {
        body += &format!("\nG1 X{:.2}", f64::from(i) * 0.01);
    }
    let machine = grbl(100.0);
    let timing = run(&body, &machine);
    // Of 16 blocks the one that runs is not ahead: 15 remain to brake in.
    let v = (2.0f64 * 100.0 * 15.0 * 0.01).sqrt();
    assert!((timing.total_s - 200.0 / v).abs() < 0.02 * timing.total_s, "{} {}", timing.total_s, 200.0 / v);
    let deep = Kinematics { look_ahead_blocks: 20_000, ..machine };
    close(run(&body, &deep).total_s, run("G1 X200 F6000", &machine).total_s);
}

#[test]
fn a_block_takes_its_time() {
    let mut body = String::from("F6000");
    for i in 1..=1000 {
        body += &format!("\nG1 X{:.2}", f64::from(i) * 0.02);
    }
    let machine = Kinematics { block_s: 0.01, look_ahead_blocks: 2000, ..grbl(1e6) };
    let timing = run(&body, &machine);
    assert!((timing.total_s - 10.0).abs() < 0.01, "{}", timing.total_s);
    assert_eq!(timing.limits()[0].0, "block rate");
}

#[test]
fn dwells_and_a_slow_line_count() {
    let timing = run("G4 P2.5\nG1 X30 F600", &grbl(100.0));
    close(timing.dwell_s, 2.5);
    close(timing.total_s, 5.6);
    let slow = Kinematics { bytes_per_s: Some(5.0), ..grbl(100.0) };
    let text = b"G21 G90 M3\nG0 Z0\nG0 X0 Y0\nG1 X1 F600\nM2\n";
    let reading = Reading::of(text, &Options::default()).expect("a sound program");
    close(time(&reading, &slow).total_s, text.len() as f64 / 5.0);
}

#[test]
fn the_parts_add_up() {
    let mut body = String::from("F900");
    for i in 0..500 {
        let t = f64::from(i) * 0.1;
        body += &format!("\nG1 X{:.3} Y{:.3} Z{:.3}", t.cos() * t, t.sin() * t, (t * 3.0).sin());
    }
    let timing = run(&(body + "\nG0 Z5\nG4 P1"), &grbl(50.0));
    let sum: f64 = timing.limits().iter().map(|p| p.1).sum();
    close(sum, timing.total_s);
    close(timing.cutting_s + timing.rapid_s + timing.dwell_s, timing.total_s);
}

/// The machine of tests/linuxcnc-sim/machine.ini.
fn linuxcnc() -> Kinematics {
    Kinematics {
        feed_max_mm_min: [4800.0, 4800.0, 3000.0],
        rapid_mm_min: [4800.0, 4800.0, 3000.0],
        acceleration_mm_s2: [500.0, 500.0, 300.0],
        path_max_mm_min: 4800.0,
        corner: Corner::Blend { mm: 0.0 },
        look_ahead_blocks: 50,
        servo_period_s: 0.001,
        ..grbl(500.0)
    }
}

#[test]
fn linuxcnc_rounds_a_corner_by_its_law() {
    // R = P s / (1 - s), v^2 = 0.866 a R, s = cos(turn / 2): Grbl's law with P for $11.
    let (turn, p, a) = (30.0f64.to_radians(), 0.01, 500.0);
    let s = (0.5 * turn).cos();
    let r = p * s / (1.0 - s);
    let v = (0.75f64.sqrt() * a * r).sqrt();
    // From rest to 50 mm/s, down to v, through the arc, up again, and at last to rest: with nothing to
    // blend into, the last line has half of its acceleration.
    let (sin, cos) = (0.5 * turn).sin_cos();
    let leg = 40.0 - r * sin / cos;
    let ramp = |from: f64, to: f64, a: f64, length: f64| {
        let ways = ((2500.0 - from * from) + (2500.0 - to * to)) / (2.0 * a);
        (50.0 - from) / a + (50.0 - to) / a + (length - ways) / 50.0
    };
    let wanted = ramp(0.0, v, a / cos, leg) + r * turn / v + ramp(v, 0.0, 0.5 * a / cos, leg);
    let (x, y) = (40.0 * cos, 40.0 * sin);
    let body = format!("G64 P{p}\nG1 X{x:.9} Y{y:.9} F3000\nG1 X{:.9} Y0", 2.0 * x);
    let got = run(&body, &linuxcnc()).total_s;
    assert!((got - wanted).abs() < 0.004, "{got} {wanted}");
    // Every block of G61.1 stops, with all of its acceleration.
    let stops = run(&body.replace("G64 P0.01", "G61.1"), &linuxcnc()).total_s;
    let twice = 2.0 * ramp(0.0, 0.0, a / cos, 40.0);
    assert!((stops - twice).abs() < 0.004, "{stops} {twice}");
}

#[test]
fn linuxcnc_holds_a_circle_by_its_radius() {
    // v^2 = 0.866 a r leaves half of the acceleration along the path, of which the last half of that.
    let timing = run("G64 P0.001\nG0 X2\nG3 X2 Y0 I-2 F4800", &linuxcnc());
    let v = (0.75f64.sqrt() * 500.0 * 2.0).sqrt();
    let (up, down) = (v / (0.5 * 250.0), v / (0.5 * 250.0));
    let wanted = up + down + (std::f64::consts::TAU * 2.0 - 0.5 * v * (up + down)) / v;
    let got = timing.cutting_s;
    assert!((got - wanted).abs() < 0.01 * wanted, "{got} {wanted}");
}

#[test]
fn linuxcnc_merges_blocks_in_line() {
    let mut blocks = String::from("F1200");
    for i in 1..=100 {
        blocks += &format!("\nG1 X{:.2} Y{:.4}", f64::from(i) * 0.05, 0.0018 * f64::from(i % 2));
    }
    let whole = run("G64 P0.002\nG1 X5 F1200", &linuxcnc()).total_s;
    let merged = run(&format!("G64 P0.002 Q0.002\n{blocks}"), &linuxcnc()).total_s;
    let apart = run(&format!("G64 P0.002 Q0\n{blocks}"), &linuxcnc()).total_s;
    close(merged, whole);
    assert!(apart > 1.08 * merged, "{merged} {apart}");
    // Without Q, P is the tolerance of both.
    let without = run(&format!("G64 P0.002\n{blocks}"), &linuxcnc()).total_s;
    close(without, run(&format!("G64 P0.002 Q0.002\n{blocks}"), &linuxcnc()).total_s);
}

#[test]
fn grbl_cuts_an_arc_into_chords() {
    // n = floor(angle r / (2 sqrt(t (2 r - t)))): 7 chords of a circle of 5 mm, every corner by the law.
    let (r, t, a, feed) = (5.0f64, 0.5f64, 100.0f64, 6.0f64);
    let n = (0.5 * std::f64::consts::TAU * r / (t * (2.0 * r - t)).sqrt()).floor();
    assert_eq!(n, 7.0);
    let turn = std::f64::consts::TAU / n;
    let (s, length) = ((0.5 * turn).cos(), 2.0 * r * (0.5 * turn).sin());
    // An axis that makes a share of the way has so much more along it.
    let along = |angle: f64| a / angle.cos().abs().max(angle.sin().abs());
    let corner = |i: f64| {
        let v = (along(turn * i) * 0.01 * s / (1.0 - s)).sqrt();
        if i == 0.0 || i == n { 0.0 } else { v }
    };
    let mut wanted = 0.0;
    for i in 0..7 {
        let i = f64::from(i);
        let chord = along(turn * (i + 0.5) + 0.5 * std::f64::consts::PI);
        let (from, to) = (corner(i), corner(i + 1.0));
        let ways = ((feed * feed - from * from) + (feed * feed - to * to)) / (2.0 * chord);
        wanted += (2.0 * feed - from - to) / chord + (length - ways) / feed;
    }
    let machine = Kinematics { arc_mm: t, ..grbl(a) };
    close(run("G0 X5\nG4 P0\nG3 X5 Y0 I-5 F360", &machine).cutting_s, wanted);
}

/// The same programs timed with other constants give those constants back.
#[test]
fn calibration_finds_what_the_times_were_made_with() {
    for name in ["roland-egx-600", "roland-srm-20", "grbl-router", "linuxcnc-mill"] {
        let machine = Machine::find(name, None).expect("a profile that comes along");
        let dialect = Dialect::find(&machine.dialects[0], None).expect("a dialect that comes along");
        let mut other = machine.clone();
        let motion = &mut other.motion;
        for a in [&mut motion.acceleration_mm_s2.x, &mut motion.acceleration_mm_s2.y] {
            *a *= 0.63;
        }
        motion.acceleration_mm_s2.z *= 0.63;
        motion.corner_mm *= 1.7;
        // LinuxCNC's blocks take what its servo loop takes.
        motion.block_s = if name == "linuxcnc-mill" { 0.0 } else { 0.0125 };
        let programs = programs_to_measure(&other, &dialect).expect("programs");
        let times = programs.map(|program| program.expected_s);
        let found = calibrate_machine(&machine, &dialect, times).expect("times that can be");
        let got = &found.machine.motion;
        let near = |a: f64, b: f64| assert!((a - b).abs() < 2e-3 * b, "{name}: {a} is not {b}");
        near(got.acceleration_mm_s2.x, other.motion.acceleration_mm_s2.x);
        near(got.acceleration_mm_s2.z, other.motion.acceleration_mm_s2.z);
        assert!((got.block_s - other.motion.block_s).abs() < 1e-5, "{name}: {}", got.block_s);
        if found.corner_found {
            near(got.corner_mm, other.motion.corner_mm);
        }
        assert_eq!(found.corner_found, name != "linuxcnc-mill");
        assert!(found.off.iter().all(|off| off.abs() < 1e-3), "{name}: {:?}", found.off);
        assert!(!got.unconfirmed);
        // A block that adds nothing at this feed is not made up.
        other.motion.block_s = 0.0;
        let times = programs_to_measure(&other, &dialect).expect("programs").map(|p| p.expected_s);
        let found = calibrate_machine(&machine, &dialect, times).expect("times that can be");
        assert_eq!(found.machine.motion.block_s, 0.0);
        // What no machine does is refused.
        let [a, b, c] = times;
        for (wrong, message) in [
            ([1.0, b, c], "time 1 is 1 s"),
            ([a, 2.0 * b, c], "time 2 is"),
            ([a, b, 0.5 * c], "time 3 is"),
            ([-a, b, c], "above 0"),
            ([f64::NAN, b, c], "above 0"),
        ] {
            match calibrate_machine(&machine, &dialect, wrong) {
                Err(error) => assert!(error.to_string().contains(message), "{name}: {error}"),
                Ok(found) => assert!(!found.corner_found && message == "time 2 is", "{name}: {found:?}"),
            }
        }
    }
}

/// Times that LinuxCNC's own controller took for the programs of tests/linuxcnc-sim/programs.rs, in
/// seconds by the wall and in motion. `measured.csv` is written by tests/linuxcnc-sim/measure.
#[test]
fn linuxcnc_takes_as_long_as_its_controller_does() {
    let mut measured: HashMap<&str, [f64; 2]> = HashMap::new();
    for line in include_str!("linuxcnc-sim/measured.csv").lines().skip(1) {
        let mut fields = line.split(',');
        let name = fields.next().expect("a name");
        let seconds: Vec<f64> = fields.map(|s| s.parse().expect("seconds")).collect();
        measured.insert(name, [seconds[0], seconds[1]]);
    }
    let programs = linuxcnc_programs::programs();
    assert_eq!(programs.len(), measured.len());
    for program in programs {
        let reading = Reading::of(program.text.as_bytes(), &Options::default()).expect("a sound program");
        let timing = time(&reading, &linuxcnc());
        let [wall_s, moving_s] = measured[program.name().as_str()];
        let off = timing.total_s / wall_s - 1.0;
        let moving_off = (timing.total_s - timing.dwell_s) / moving_s - 1.0;
        println!("{:<40} {wall_s:8.2} {:8.2} {:+.2} %", program.name(), timing.total_s, 100.0 * off);
        assert!(off.abs() < 0.01, "{}: {} s, the controller took {wall_s} s", program.name(), timing.total_s);
        assert!(moving_off.abs() < 0.0005, "{}: motion {moving_off}", program.name());
    }
}

/// Writes the programs for tests/linuxcnc-sim/measure into the folder $PROGRAMS.
#[test]
#[ignore = "writes files; tests/linuxcnc-sim/measure needs them"]
fn write_the_programs_to_measure() {
    let folder = std::env::var_os("PROGRAMS").expect("PROGRAMS names a folder");
    for program in linuxcnc_programs::programs() {
        let file = std::path::Path::new(&folder).join(format!("{}.ngc", program.name()));
        std::fs::write(file, &program.text).expect("the folder can be written");
    }
}
