//! `resume`: a stopped program taken up again at a pass.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use screenmill::machine::Machine;
use screenmill::resume;
use screenmill::whole::Whole;
use serde_json::json;

use super::part::same_file;
use super::program::reading_options;
use super::{Common, Outcome, Refusal};

/// Writes a program that starts again at pass N of another, with its modal state
///
/// Passes are numbered as the program's comments mark them, `(pass 12)`. A text without such marks (RML-1 has no
/// comments) is counted: pass N begins where the cutter comes down for the Nth time from the plane it travels on.
#[derive(clap::Args)]
pub struct Arguments {
    /// A program in G-code or RML-1
    #[arg(value_name = "PROGRAM")]
    program: PathBuf,
    /// The pass to begin with
    #[arg(long, value_name = "N")]
    at: u64,
    /// File for the new program; standard output if left out
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Machine profile, for the unit of its RML-1: 0.01 mm if left out
    #[arg(long, value_name = "NAME")]
    machine: Option<String>,
}

/// Why no program was written.
#[derive(Debug, thiserror::Error)]
enum Refused {
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    #[error("{path}: {source}")]
    Text { path: PathBuf, source: resume::Error },
    #[error("{path} is the program itself; hint: --out names another file")]
    Same { path: PathBuf },
    #[error("--json and the program would both go to standard output; hint: add --out FILE")]
    Json,
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let path = &arguments.program;
    if common.json && arguments.out.is_none() {
        return Err(Refused::Json.into());
    }
    let machine = arguments.machine.as_deref().map(|name| Machine::find(name, None)).transpose()?;
    let text = std::fs::read(path).map_err(|source| Refused::File { path: path.clone(), source })?;
    let read_as = machine.as_ref().map(reading_options).transpose()?.unwrap_or_default();
    let resumed = resume::resume(&text, arguments.at, &read_as)
        .map_err(|source| Refused::Text { path: path.clone(), source })?;
    let Some(out) = &arguments.out else {
        std::io::stdout().write_all(&resumed.text)?;
        return Ok(Outcome::Within);
    };
    if same_file(path, out) {
        return Err(Refused::Same { path: out.clone() }.into());
    }
    write(out, &resumed.text)?;
    let [x, y, z] = resumed.at_mm;
    if common.json {
        let object = json!({
            "file": out.display().to_string(),
            "pass": arguments.at,
            "passes": [resumed.first, resumed.last],
            "line": resumed.line,
            "at_mm": [x, y, z],
            "bytes": resumed.text.len(),
        });
        println!("{object}");
    } else {
        println!(
            "{}: from pass {} of {} to {} (line {}), at X {x} Y {y} Z {z}",
            out.display(),
            arguments.at,
            resumed.first,
            resumed.last,
            resumed.line
        );
    }
    Ok(Outcome::Within)
}

/// Whole or not at all.
fn write(out: &Path, text: &[u8]) -> Result<(), Refused> {
    let refused = |source| Refused::File { path: out.to_path_buf(), source };
    let mut file = Whole::beside(out).map_err(refused)?;
    file.write_all(text).map_err(refused)?;
    file.publish().map_err(refused)
}
