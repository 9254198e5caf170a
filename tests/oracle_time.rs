//! Times worked by hand from the controllers' published equations.

use screenmill::verify::{Corner, Kinematics, Options, Reading, Timing, time};

fn grbl(acceleration: f64) -> Kinematics {
    Kinematics {
        feed_max_mm_min: [6000.0; 3],
        rapid_mm_min: [6000.0; 3],
        acceleration_mm_s2: [acceleration; 3],
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

#[test]
fn linuxcnc_blends_as_grbl_with_0_866_a() {
    let machine = Kinematics { corner: Corner::Blend { mm: 0.01 }, servo_period_s: 0.001, ..grbl(500.0) };
    let (sin, cos) = (15.0f64.to_radians()).sin_cos();
    let body = format!("F6000\nG1 X{:.9} Y{:.9}\nG1 X{:.9} Y0", 100.0 * cos, 100.0 * sin, 200.0 * cos);
    let v_j = (0.866 * 500.0 * 0.01 * cos / (1.0 - cos)).sqrt();
    let wanted = with_corner(100.0, v_j, 500.0 / cos, 100.0);
    let got = run(&body, &machine).total_s;
    assert!((got - wanted).abs() < 1e-6 * wanted, "{got} {wanted}");
    let wide = run(&format!("G64 P0.1\n{body}"), &machine).total_s;
    let exact = run(&format!("G61\n{body}"), &machine).total_s;
    assert!(wide < got && got < exact, "{wide} {got} {exact}");
}

#[test]
fn a_circle_is_held_by_its_radius() {
    let machine = grbl(100.0);
    let timing = run("G0 X1\nG3 X1 Y0 I-1 F6000", &machine);
    let v = (0.866f64 * 100.0).sqrt();
    let ideal = std::f64::consts::TAU / v;
    // Half of the acceleration is left to speed up from the speed of the corner, and to brake.
    let most = ideal + v / 50.0;
    assert!(timing.cutting_s > most - 2.0 / 50.0 && timing.cutting_s < most, "{} {ideal}", timing.cutting_s);
}
