//! Programs for comparing times with LinuxCNC's motion controller: the kinds that a job writes, each
//! under several path modes, made the same on every machine.

use std::fmt::Write;

/// A program and the name under which its measured time stands in `measured.csv`.
pub struct Program {
    pub kind: &'static str,
    pub mode: &'static str,
    pub text: String,
}

impl Program {
    /// As in `measured.csv`, and of its file.
    pub fn name(&self) -> String {
        format!("{} {}", self.kind, self.mode).replace(' ', "_")
    }
}

const MODES: [&str; 3] = ["G64 P0.002", "G64 P0.001 Q0", "G61"];

/// Every program, kind by kind.
pub fn programs() -> Vec<Program> {
    let mut all = Vec::new();
    let kinds = [
        ("long passes", long_passes as fn() -> String),
        ("faceted passes", faceted_passes),
        ("steep facets", steep_facets),
        ("short blocks", short_blocks),
        ("fast short blocks", fast_short_blocks),
        ("curved relief", curved_relief),
        ("many retracts", many_retracts),
        ("roughing", roughing),
        ("contours with arcs", contours_with_arcs),
        ("collinear blocks", collinear_blocks),
    ];
    for (kind, body) in kinds {
        for mode in MODES {
            all.push(Program { kind, mode, text: around(mode, &body()) });
        }
    }
    for (kind, body, mode) in [
        ("faceted passes", faceted_passes as fn() -> String, "G64"),
        ("many retracts", many_retracts, "G61.1"),
        ("short blocks", short_blocks, "G64 P0.002 Q0.001"),
        ("roughing", roughing, "G64 P0.01"),
    ] {
        all.push(Program { kind, mode, text: around(mode, &body()) });
    }
    all
}

fn around(mode: &str, body: &str) -> String {
    format!("G17 G21 G40 G49 G54 G80 G90 G94\n{mode}\nG0 Z5\nS12000 M3\nG4 P0.5\n{body}G0 Z5\nM5\nM2\n")
}

/// Numerical Recipes' linear congruence: the same numbers everywhere.
struct Noise(u32);

impl Noise {
    /// Evenly spread between -1 and 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0 >> 8) / f64::from(1u32 << 23) - 1.0
    }
}

fn long_passes() -> String {
    let mut text = String::from("G0 X0 Y0\nG1 Z-0.1 F200\n");
    for pass in 0..14 {
        let (y, x) = (f64::from(pass) * 0.12, if pass % 2 == 0 { 36.0 } else { 0.0 });
        let feed = if pass == 0 { " F1800" } else { "" };
        let _ = writeln!(text, "G1 X{x:.4} Z-0.1{feed}\nG1 Y{:.4}", y + 0.12);
    }
    text
}

/// Passes over flat mirrors of about a millimetre that tilt a few degrees.
fn facets(steepest: f64, feed: f64, passes: u32) -> String {
    let mut noise = Noise(7);
    let mut text = String::from("G0 X0 Y0\nG1 Z0 F300\n");
    for pass in 0..passes {
        let y = f64::from(pass) * 0.05;
        let forward = pass % 2 == 0;
        let (mut ends, mut x, mut z) = (vec![(0.0, 0.0)], 0.0, 0.0);
        while x < 16.0 {
            let length = 0.8 + 0.5 * noise.next();
            x += length;
            z += length * steepest * noise.next() - 0.1 * z;
            ends.push((x, z));
        }
        if !forward {
            ends.reverse();
        }
        let _ = writeln!(text, "G1 X{:.4} Y{y:.4} Z{:.4} F{feed}", ends[0].0, ends[0].1);
        for (x, z) in &ends[1..] {
            let _ = writeln!(text, "X{x:.4} Z{z:.4}");
        }
    }
    text
}

fn faceted_passes() -> String {
    facets(0.12, 900.0, 14)
}

fn steep_facets() -> String {
    facets(0.6, 2400.0, 20)
}

/// A wavy relief in blocks of `step` mm.
fn waves(step: f64, feed: f64, passes: u32, height: f64, length: f64) -> String {
    let mut text = String::from("G0 X0 Y0\nG1 Z0 F300\n");
    let blocks = (length / step).round() as i32;
    for pass in 0..passes {
        let y = f64::from(pass) * 0.06;
        for block in 0..=blocks {
            let block = if pass % 2 == 0 { block } else { blocks - block };
            let x = f64::from(block) * step;
            let z = height * ((1.9 * x + 0.4 * y).sin() + 0.5 * (4.7 * x - y).cos() - 0.5);
            let feed = if block == 0 || block == blocks { format!(" F{feed}") } else { String::new() };
            let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4}{feed}");
        }
    }
    text
}

fn short_blocks() -> String {
    waves(0.03, 600.0, 16, 0.15, 12.0)
}

fn fast_short_blocks() -> String {
    waves(0.02, 2400.0, 20, 0.15, 10.0)
}

fn curved_relief() -> String {
    waves(0.12, 1500.0, 20, 0.6, 18.0)
}

fn many_retracts() -> String {
    let mut noise = Noise(3);
    let mut text = String::new();
    for hole in 0..24 {
        let x = f64::from(hole % 6) * 4.0 + noise.next();
        let y = f64::from(hole / 6) * 5.0 + noise.next();
        let _ = writeln!(text, "G0 Z2\nG0 X{x:.4} Y{y:.4}\nG0 Z0.3\nG1 Z-0.2 F240");
        let _ = writeln!(text, "G1 X{:.4} Y{:.4} F1200", x + 2.0 + noise.next(), y + noise.next());
        let _ = writeln!(text, "G1 Y{:.4}", y + 3.0);
    }
    text
}

/// Levels of offset outlines, corners square and slanted.
fn roughing() -> String {
    let mut text = String::new();
    for level in 0..3 {
        let z = -0.3 * f64::from(level + 1);
        for ring in 0..4 {
            let inset = f64::from(ring) * 1.2;
            let (low, high) = (inset, 12.0 - inset);
            let cut = 1.0 + 0.3 * f64::from(level);
            let corners = [
                (low, low),
                (high - cut, low),
                (high, low + cut),
                (high, high),
                (low + 2.0 * cut, high),
                (low, high - cut),
                (low, low),
            ];
            let (x, y) = corners[0];
            if ring == 0 {
                let _ = writeln!(text, "G0 Z2\nG0 X{x:.4} Y{y:.4}\nG0 Z{:.4}\nG1 Z{z:.4} F300", z + 0.5);
            } else {
                let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} F2000");
            }
            for (x, y) in &corners[1..] {
                let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} F2000");
            }
        }
    }
    text
}

/// Rounded rectangles: arcs that leave and meet their lines in their direction, and some that do not.
fn contours_with_arcs() -> String {
    let mut text = String::from("G0 X3 Y0\nG1 Z-0.2 F300\nF1800\n");
    for ring in 0..6 {
        let r = 0.5 + 0.5 * f64::from(ring);
        let (w, h) = (16.0, 10.0);
        let _ = writeln!(text, "G1 X{:.4} Y0", w - r);
        let _ = writeln!(text, "G3 X{w:.4} Y{r:.4} I0 J{r:.4}\nG1 Y{:.4}", h - r);
        let _ = writeln!(text, "G3 X{:.4} Y{h:.4} I{:.4} J0\nG1 X{r:.4}", w - r, -r);
        let _ = writeln!(text, "G3 X0 Y{:.4} I0 J{:.4}\nG1 Y{r:.4}", h - r, -r);
        let _ = writeln!(text, "G2 X{r:.4} Y0 I{r:.4} J0");
    }
    text
}

/// Straight lines cut into blocks, as programs sampled at a step have them.
fn collinear_blocks() -> String {
    let mut text = String::from("G0 X0 Y0\nG1 Z0 F300\nF1500\n");
    for pass in 0..10 {
        let y = f64::from(pass) * 0.2;
        for block in 0..=400 {
            let block = if pass % 2 == 0 { block } else { 400 - block };
            let x = f64::from(block) * 0.05;
            let z = -0.02 * (x / 3.0).floor() - 0.05 * (x % 3.0);
            let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4}");
        }
    }
    text
}
