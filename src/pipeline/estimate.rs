//! `estimate` of a job: every program planned, written and read back for its time, nothing judged.

use std::path::Path;

use super::cut::setups;
use super::part::Part;
use super::shop::Shop;
use super::{Error, plan};
use crate::job::Job;
use crate::progress::Progress;
use crate::report::Parts;

/// Machine time of a job in its first dialect.
#[derive(Clone, Debug, Default)]
pub struct Estimated {
    pub machine: String,
    pub post: String,
    pub total_s: f64,
    pub by_operation: Parts,
    pub by_tool: Parts,
    pub by_tile: Parts,
    /// What the time goes to: feed, corners, block rate, rapids and so on, largest first.
    pub limits: Vec<(&'static str, f64)>,
    pub cutting_mm: f64,
    pub rapid_mm: f64,
    pub blocks: u64,
    pub tiles: usize,
    /// Sections of the machine's profile that no source confirms.
    pub unconfirmed: Vec<&'static str>,
    pub hours_max: Option<f64>,
}

/// Plans a job under `scratch`, which the caller removes.
pub fn estimate(
    job: &Job,
    folder: &Path,
    scratch: &Path,
    progress: &dyn Progress,
) -> Result<Estimated, Error> {
    let shop = Shop::open(job, folder)?;
    let part = Part::load(job, progress)?;
    let tiles = setups(job, &shop, &part)?;
    let dialect = &shop.dialects[0];
    let mut estimated = Estimated {
        machine: shop.machine.name.clone(),
        post: dialect.name.clone(),
        tiles: tiles.len(),
        unconfirmed: shop.machine.unconfirmed(),
        hours_max: job.limits.hours_max,
        ..Estimated::default()
    };
    for tile in &tiles {
        tile.piece.hold()?;
        let planned = plan::programs(job, &shop, tile, dialect, scratch, progress)?;
        tile.piece.shed();
        for program in &planned.programs {
            let tool = &shop.tools[program.operation].name;
            let kind = job.operations[program.operation].kind.word();
            let time_s = program.timing.total_s;
            estimated.total_s += time_s;
            estimated.by_operation.add(&format!("{:02}-{kind}-{tool}", program.operation + 1), time_s);
            estimated.by_tool.add(tool, time_s);
            estimated.by_tile.add(&tile.setup.tile.name, time_s);
            estimated.cutting_mm += program.extent.cutting_mm;
            estimated.rapid_mm += program.extent.rapid_mm;
            estimated.blocks += program.reading.summary.blocks;
            for (name, seconds) in program.timing.limits() {
                match estimated.limits.iter_mut().find(|limit| limit.0 == name) {
                    Some(limit) => limit.1 += seconds,
                    None => estimated.limits.push((name, seconds)),
                }
            }
            let file = scratch.join(&program.file);
            std::fs::remove_file(&file).map_err(|source| Error::Output { path: file.clone(), source })?;
        }
    }
    estimated.limits.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(estimated)
}
