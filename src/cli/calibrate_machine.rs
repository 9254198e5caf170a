//! `calibrate-machine`: programs to measure, and how their times go into the profile.

use std::fs;
use std::path::{Path, PathBuf};

use screenmill::machine::Machine;
use screenmill::pipeline::{Measured, calibrate_machine, programs_to_measure};
use screenmill::post::Dialect;
use screenmill::whole::Whole;
use serde_json::json;

use super::program::clock;
use super::{Common, Outcome, Refusal};

/// Measure a machine's acceleration, corners and blocks with a stopwatch, for its profile
///
/// Without --times, writes three short programs that run in air and a sheet that says what to time.
/// With --times, writes the profile with what the times say.
#[derive(clap::Args)]
pub struct Arguments {
    /// Machine profile: a name or a file
    #[arg(long, value_name = "NAME")]
    machine: String,
    /// Times of the three programs in seconds, in their order
    #[arg(long, num_args = 3, value_names = ["T1", "T2", "T3"], allow_hyphen_values = true)]
    times: Option<Vec<f64>>,
    /// Folder for the programs; with --times, file for the profile (.toml)
    #[arg(long, value_name = "DIR|FILE")]
    out: PathBuf,
}

#[derive(Debug, thiserror::Error)]
enum Refused {
    #[error("{path} cannot be written: {source}; hint: choose another --out")]
    Output { path: PathBuf, source: std::io::Error },
    #[error("{path} is a folder; hint: with --times, --out names the profile to write, like mine.toml")]
    Folder { path: PathBuf },
    #[error("{path} does not end in .toml; hint: with --times, --out names the profile to write")]
    NotToml { path: PathBuf },
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let machine = Machine::find(&arguments.machine, None)?;
    let dialect = machine.dialects.first().map_or("", String::as_str);
    let dialect = Dialect::find(dialect, None)?;
    match arguments.times.as_deref() {
        Some(&[a, b, c]) => profile(&machine, &dialect, [a, b, c], &arguments.out, common),
        _ => programs(&machine, &dialect, &arguments.out, common),
    }
}

fn programs(machine: &Machine, dialect: &Dialect, out: &Path, common: &Common) -> Result<Outcome, Refusal> {
    let programs = programs_to_measure(machine, dialect)?;
    fs::create_dir_all(out).map_err(|source| Refused::Output { path: out.into(), source })?;
    let files: Vec<String> =
        programs.iter().map(|program| format!("{}.{}", program.name, dialect.extension)).collect();
    for (program, file) in programs.iter().zip(&files) {
        place(&out.join(file), &program.text)?;
    }
    let sheet = sheet(machine, dialect, &programs, &files);
    place(&out.join("sheet.txt"), sheet.as_bytes())?;
    if common.json {
        let programs: Vec<_> = programs
            .iter()
            .zip(&files)
            .map(|(program, file)| json!({ "file": file, "what": program.what, "expected_s": program.expected_s }))
            .collect();
        println!("{}", json!({ "machine": machine.name, "programs": programs, "sheet": "sheet.txt" }));
    } else {
        print!("{sheet}");
    }
    Ok(Outcome::Within)
}

fn sheet(machine: &Machine, dialect: &Dialect, programs: &[Measured], files: &[String]) -> String {
    use std::fmt::Write;
    let mut text = format!("Calibration of {} ({}, {})\n\n", machine.name, machine.title, dialect.title);
    text += "The programs cut nothing: they move 5 mm above Z0, within 60 x 60 mm from X0 Y0, and turn the\n\
             spindle. Take the tool out. Set X0 Y0 where 60 mm are free to the right and to the back, and Z0 so\n\
             that 5 mm above it nothing stands in the way. Feed and rapid override at 100 %.\n\n\
             Before each program, move to X0 Y0 Z0. Time it from the start button until everything rests.\n\
             Twice each; write down the shorter time.\n\n";
    for (program, file) in programs.iter().zip(files) {
        let name = format!("{file}:");
        let _ = writeln!(
            text,
            "  {name:<22} ______ s   (about {} by the profile as it stands)\n  {:<22} {}",
            clock(program.expected_s),
            "",
            program.what
        );
    }
    let _ = writeln!(
        text,
        "\nThen: screenmill calibrate-machine --machine {} --times T1 T2 T3 --out mine.toml\n\
         and: screenmill estimate PROGRAM --machine mine.toml\n\
         Z is not measured: its acceleration changes as that of X and Y does.",
        machine.name
    );
    text
}

fn profile(
    machine: &Machine,
    dialect: &Dialect,
    times_s: [f64; 3],
    out: &Path,
    common: &Common,
) -> Result<Outcome, Refusal> {
    if out.is_dir() {
        return Err(Refused::Folder { path: out.into() }.into());
    }
    if out.extension().is_none_or(|extension| extension != "toml") {
        return Err(Refused::NotToml { path: out.into() }.into());
    }
    let found = calibrate_machine(machine, dialect, times_s)?;
    place(out, toml::to_string_pretty(&found.machine)?.as_bytes())?;
    let (was, motion) = (&machine.motion, &found.machine.motion);
    if common.json {
        let report = json!({
            "machine": machine.name, "file": out.display().to_string(),
            "acceleration_mm_s2": motion.acceleration_mm_s2, "corner_mm": motion.corner_mm,
            "corner_found": found.corner_found, "block_s": motion.block_s, "off": found.off,
        });
        println!("{report}");
        return Ok(Outcome::Within);
    }
    let (a, old) = (motion.acceleration_mm_s2, was.acceleration_mm_s2);
    println!(
        "acceleration X {:.1}, Y {:.1}, Z {:.1} mm/s2 (was {}, {}, {})",
        a.x, a.y, a.z, old.x, old.y, old.z
    );
    if found.corner_found {
        println!("corner {:.5} mm (was {})", motion.corner_mm, was.corner_mm);
    } else {
        println!(
            "corners follow the controller's own rule; the profile is {:+.1} % off time 2",
            100.0 * found.off[1]
        );
    }
    println!("block {:.2} ms (was {:.2})", 1e3 * motion.block_s, 1e3 * was.block_s);
    println!("{}", out.display());
    Ok(Outcome::Within)
}

/// A file that appears whole or not at all.
fn place(path: &Path, bytes: &[u8]) -> Result<(), Refused> {
    let refused = |source| Refused::Output { path: path.into(), source };
    let mut file = Whole::beside(path).map_err(refused)?;
    std::io::Write::write_all(&mut file, bytes).map_err(refused)?;
    file.publish().map_err(refused)
}
