//! Arguments, output and exit codes; one file per subcommand. The only place that prints, looks at
//! the clock or asks for files by name.

mod console;
mod estimate;
mod program;
mod simulate;

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
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// Log stages with their times
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

#[derive(Subcommand)]
enum Command {
    Estimate(estimate::Arguments),
    Simulate(simulate::Arguments),
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
        let built = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build_global();
        if let Err(error) = built {
            eprintln!("error: {error}");
            return ExitCode::from(2);
        }
    }
    let outcome: Result<Outcome, Refusal> = match arguments.command {
        Command::Estimate(ref of) => estimate::run(of, &arguments.common),
        Command::Simulate(ref of) => simulate::run(of, &arguments.common),
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
