//! Machine, fixture, dialects and tools of a job, found and checked against each other.

use std::path::Path;

use super::Error;
use crate::cutter::Shape;
use crate::job::{self, Job};
use crate::machine::{Fixture, Library, Machine, Stock, Tool};
use crate::post::Dialect;

/// What a job is cut with.
pub struct Shop {
    pub machine: Machine,
    pub fixture: Fixture,
    /// In the job's order.
    pub dialects: Vec<Dialect>,
    pub library: Library,
    /// One for each operation, with the job's feeds.
    pub tools: Vec<Tool>,
    /// What each of them does.
    pub kinds: Vec<job::Kind>,
    pub stock: Stock,
}

impl Shop {
    /// Finds what the job names; files are looked for in the job's folder, then among those that come along.
    pub fn open(job: &Job, folder: &Path) -> Result<Shop, Error> {
        let machine = Machine::find(&job.machine.name, Some(folder))?;
        let fixture = Fixture::find(&job.machine.fixture, Some(folder))?;
        let names = match &job.machine.post {
            Some(names) if !names.is_empty() => names.clone(),
            _ => machine.dialects.iter().take(1).cloned().collect(),
        };
        let mut dialects: Vec<Dialect> = Vec::new();
        for name in &names {
            if dialects.iter().any(|dialect| dialect.name == *name) {
                return Err(Error::PostTwice { name: name.clone() });
            }
            dialects.push(Dialect::find(name, Some(folder))?);
        }
        let library = match &job.tools.library {
            Some(path) => Library::find(&path.display().to_string(), Some(Path::new("")))?,
            None => Library::find("tools", Some(folder))?,
        };
        let mut tools = Vec::new();
        for operation in &job.operations {
            let tool = tool(operation, &library)?;
            machine.run(&tool)?;
            tools.push(tool);
        }
        let stock = Stock {
            thickness_mm: job.stock.thickness_mm,
            top_allowance_mm: job.stock.top_allowance_mm,
            margin_mm: job.stock.margin_mm,
            min_floor_mm: job.stock.min_floor_mm,
            blanks: match job.stock.blanks {
                job::Blanks::PerTile => crate::machine::Blanks::PerTile,
                job::Blanks::One => crate::machine::Blanks::One,
            },
        };
        let kinds = job.operations.iter().map(|operation| operation.kind).collect();
        Ok(Shop { machine, fixture, dialects, library, tools, kinds, stock })
    }

    /// The tools that make the part's surface, not those for holes, marks and slots beside it.
    pub fn shaping(&self) -> impl DoubleEndedIterator<Item = &Tool> + Clone {
        let kinds = self.kinds.iter();
        self.tools.iter().zip(kinds).filter(|(_, kind)| kind.shapes()).map(|(tool, _)| tool)
    }
}

/// The tool of an operation: an entry of the library, or an inline cutter with its feeds beside it.
fn tool(operation: &job::Operation, library: &Library) -> Result<Tool, Error> {
    if operation.tool.contains(':') {
        let shape: Shape = operation.tool.parse()?;
        let missing = |key| Error::InlineFeed { tool: operation.tool.clone(), key };
        let feed = operation.feed_mm_min.ok_or_else(|| missing("feed_mm_min"))?;
        let plunge = operation.plunge_mm_min.ok_or_else(|| missing("plunge_mm_min"))?;
        let rpm = operation.spindle_rpm.ok_or_else(|| missing("spindle_rpm"))?;
        return Ok(Tool::inline(shape, feed, plunge, rpm)?);
    }
    let mut tool = library.tool(&operation.tool)?.clone();
    tool.feed_mm_min = operation.feed_mm_min.unwrap_or(tool.feed_mm_min);
    tool.plunge_mm_min = operation.plunge_mm_min.unwrap_or(tool.plunge_mm_min);
    tool.spindle_rpm = operation.spindle_rpm.unwrap_or(tool.spindle_rpm);
    Ok(tool)
}
