//! Arguments, output and exit codes; one file per subcommand. The only place that prints, looks at
//! the clock or asks for files by name.

mod calibrate;
mod calibrate_machine;
mod check;
mod compensate;
mod console;
mod design;
mod estimate;
mod evaluate;
mod fixtures;
mod light;
mod limits;
mod machines;
mod mill;
mod part;
mod posts;
mod program;
mod raster;
mod resume;
mod simulate;
mod simulated;
mod staging;
mod tools;

use std::error::Error;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Directional projection screens and other reliefs, from design to proved programs.
#[derive(Parser)]
#[command(name = "screenmill", version, max_term_width = 100)]
struct Arguments {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// Flags that every command takes.
#[derive(clap::Args, Clone, Debug)]
pub struct Common {
    /// Print one JSON object on standard output instead of text
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress
    #[arg(long, global = true)]
    pub quiet: bool,
    /// Worker threads; all cores if left out
    #[arg(long, global = true, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Log stages with their times
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

#[derive(Subcommand)]
enum Command {
    Mill(mill::Arguments),
    Check(check::Arguments),
    Estimate(estimate::Arguments),
    Design(design::Arguments),
    Limits(limits::Arguments),
    Calibrate(calibrate::Arguments),
    Evaluate(evaluate::Arguments),
    Raster(raster::Arguments),
    Compensate(compensate::Arguments),
    Simulate(simulate::Arguments),
    Resume(resume::Arguments),
    Light(light::Arguments),
    CalibrateMachine(calibrate_machine::Arguments),
    Machines(machines::Arguments),
    Posts(posts::Arguments),
    Fixtures(fixtures::Arguments),
    Tools(tools::Arguments),
}

/// How a command that was not refused ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Done and within limits: exit 0.
    Within,
    /// Done, but limits are not met or something was found: exit 1.
    Found,
}

/// A command was refused: one message, exit 2.
pub type Refusal = Box<dyn Error + Send + Sync>;

/// Parses the arguments, runs the command and gives the exit code.
pub fn run() -> ExitCode {
    let arguments = Arguments::parse();
    if let Some(threads) = arguments.common.threads {
        let built = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build_global();
        if let Err(error) = built {
            eprintln!("error: {error}");
            return ExitCode::from(2);
        }
    }
    if let Err(error) = console::listen_for_interrupt() {
        eprintln!("error: {error}");
        return ExitCode::from(2);
    }
    let common = &arguments.common;
    let outcome: Result<Outcome, Refusal> = match &arguments.command {
        Command::Mill(arguments) => mill::run(arguments, common),
        Command::Check(arguments) => check::run(arguments, common),
        Command::Estimate(arguments) => estimate::run(arguments, common),
        Command::Design(arguments) => design::run(arguments, common),
        Command::Limits(arguments) => limits::run(arguments, common),
        Command::Calibrate(arguments) => calibrate::run(arguments, common),
        Command::Evaluate(arguments) => evaluate::run(arguments, common),
        Command::Raster(arguments) => raster::run(arguments, common),
        Command::Compensate(arguments) => compensate::run(arguments, common),
        Command::Simulate(arguments) => simulate::run(arguments, common),
        Command::Resume(arguments) => resume::run(arguments, common),
        Command::Light(arguments) => light::run(arguments, common),
        Command::CalibrateMachine(arguments) => calibrate_machine::run(arguments, common),
        Command::Machines(arguments) => machines::run(arguments, common),
        Command::Posts(arguments) => posts::run(arguments, common),
        Command::Fixtures(arguments) => fixtures::run(arguments, common),
        Command::Tools(arguments) => tools::run(arguments, common),
    };
    match outcome {
        Ok(Outcome::Within) => ExitCode::SUCCESS,
        Ok(Outcome::Found) => ExitCode::from(1),
        Err(refusal) => {
            eprintln!("error: {refusal}");
            ExitCode::from(2)
        }
    }
}

/// A machine time as an operator reads it.
fn hours(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..60 => format!("{seconds:.1} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
    }
}
