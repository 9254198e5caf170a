//! `cargo bench --bench estimate [-- MILLIONS]`: programs of that many million blocks (10 if left out), of a relief and of
//! a zigzag, read and timed for each of some machines, and a million moves written; blocks a second without the making
//! of the text, and the peak of memory.

use std::hint::black_box;
use std::io::{BufReader, Read};
use std::time::Instant;

use screenmill::machine::{Library, Machine};
use screenmill::post::{self, Dialect, Program, StockFacts, ZZero};
use screenmill::toolpath::{Kind, Move, Toolpath};
use screenmill::verify::{self, Clock, Kinematics, Options, Travel};

/// What blocks of 0.05 mm run along.
#[derive(Clone, Copy, Debug)]
enum Form {
    /// A wavy relief, row by row.
    Relief,
    /// Corners of 90 degrees, each block to the other side.
    Zigzag,
}

impl Form {
    fn place(self, block: u64) -> [f64; 3] {
        let (row, column) = (block / 1000, block % 1000);
        let column = if row.is_multiple_of(2) { column } else { 999 - column };
        match self {
            Form::Relief => {
                let (x, y) = (0.05 * column as f64, 0.05 * row as f64);
                [x, y, 0.15 * ((1.9 * x + 0.4 * y).sin() + 0.5 * (4.7 * x - y).cos() - 0.5)]
            }
            Form::Zigzag => {
                let side = 0.05 * 0.5f64.sqrt();
                [side * column as f64, side * (row + block % 2) as f64, 0.0]
            }
        }
    }
}

/// The text of blocks of 0.05 mm, made as it is read, so that no memory holds it.
struct Relief {
    form: Form,
    left: u64,
    block: u64,
    line: Vec<u8>,
    at: usize,
    head: &'static [u8],
}

impl Read for Relief {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        if self.at == self.line.len() {
            self.at = 0;
            self.line.clear();
            self.line.extend_from_slice(std::mem::take(&mut self.head));
            // Some lines at once.
            for _ in 0..256.min(self.left) {
                self.left -= 1;
                let [x, y, z] = self.form.place(self.block);
                use std::io::Write;
                writeln!(self.line, "G1 X{x:.4} Y{y:.4} Z{z:.4}")?;
                self.block += 1;
                if self.left == 0 {
                    self.line.extend_from_slice(b"G0 Z5\nM5\nM2\n");
                }
            }
        }
        let count = (self.line.len() - self.at).min(out.len());
        out[..count].copy_from_slice(&self.line[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}

fn relief(form: Form, blocks: u64, head: &'static [u8]) -> BufReader<Relief> {
    BufReader::with_capacity(1 << 16, Relief { form, left: blocks, block: 0, line: Vec::new(), at: 0, head })
}

/// Peak resident set in MB, where the system tells.
fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

/// Writes a million moves that name three axes each.
fn write() {
    let dialect = Dialect::find("linuxcnc", None).expect("embedded");
    let machine = Machine::find("linuxcnc-mill", None).expect("embedded");
    let library = Library::find("tools", None).expect("embedded");
    let mut moves = vec![Move { kind: Kind::Rapid, to: [0, 0, 50_000] }];
    moves.extend(
        (0..1_000_000).map(|i| Move { kind: Kind::Cut, to: [i * 3, i / 1000 * 500, -(i * 7 % 9973)] }),
    );
    let path = Toolpath { unit_mm: dialect.unit_mm, moves, pass_starts: vec![0], tilt: None };
    let stock = StockFacts {
        material: "aluminium".into(),
        width_mm: 10.0,
        height_mm: 10.0,
        thickness_mm: 10.0,
        top_allowance_mm: 0.2,
    };
    let program = Program {
        path: &path,
        part: "p",
        tile: "r0c0",
        operation: "finish",
        number: 1,
        section: None,
        spindle: true,
        tool: library.tool("ball-1").expect("in it"),
        stock: &stock,
        z_zero: ZZero::StockTop,
        wcs: "G54",
        clearance_mm: 5.0,
        notes: &[],
    };
    let mut text = Vec::new();
    let start = Instant::now();
    post::write(&program, &dialect, &machine, &mut text).expect("written");
    let seconds = start.elapsed().as_secs_f64();
    println!("written: {:.2} million moves a second, {} MB", 1.0 / seconds, text.len() / 1_000_000);
}

fn main() {
    let millions: f64 = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(10.0);
    let blocks = (millions * 1e6) as u64;
    let making = |form: Form| {
        let start = Instant::now();
        black_box(
            std::io::copy(&mut relief(form, blocks, b""), &mut std::io::sink()).expect("no file is read"),
        );
        start.elapsed().as_secs_f64()
    };
    let modes: [(&str, &'static [u8]); 4] = [
        ("linuxcnc-sim", b"G21 G90 G64 P0.001 Q0\nM3 S1000\nG0 Z5\nG0 X0 Y0\nF600\n"),
        ("linuxcnc-sim", b"G21 G90 G64 P0.002\nM3 S1000\nG0 Z5\nG0 X0 Y0\nF600\n"),
        ("linuxcnc-sim", b"G21 G90 G61\nM3 S1000\nG0 Z5\nG0 X0 Y0\nF600\n"),
        ("grbl-router", b"G21 G90\nM3 S1000\nG0 Z5\nG0 X0 Y0\nF600\n"),
    ];
    write();
    for (form, (name, head)) in [Form::Relief, Form::Zigzag].into_iter().flat_map(|f| modes.map(|m| (f, m))) {
        let making = making(form);
        let machine = Machine::find(name, None).expect("a machine that comes along");
        let mut clock = Clock::new(&Kinematics::from(&machine), Travel::default());
        let start = Instant::now();
        let summary = verify::read(&mut relief(form, blocks, head), &Options::default(), &mut |event| {
            clock.event(event);
            Ok(())
        })
        .expect("a sound program");
        let hours = clock.finish(summary.bytes).total_s / 3600.0;
        let seconds = start.elapsed().as_secs_f64() - making;
        let mode = String::from_utf8_lossy(head).lines().next().unwrap_or("").replace("G21 G90 ", "");
        println!(
            "{form:?}, {name:<13} {mode:<14} {:.2} million blocks a second, program of {hours:.2} h, peak {:.1} MB",
            1e-6 * summary.blocks as f64 / seconds,
            peak_mb().unwrap_or(f64::NAN)
        );
    }
}
