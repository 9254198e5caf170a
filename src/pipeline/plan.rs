//! From a tile to program files, and the files read back.

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::Error;
use super::judge::ExactPasses;
use super::part::TileSurface;
use super::shop::Shop;
use crate::compensation::Profile;
use crate::cutter::Shape;
use crate::job::{self, Job, ZZero};
use crate::machine::{Bounds, Setup, Tool, ZNeed};
use crate::post::{self, Dialect};
use crate::progress::Progress;
use crate::surface::Surface;
use crate::tolerance::Budget;
use crate::toolpath::{self, Site, finish, rough};
use crate::verify::{self, Extent, Reading, Timing};

/// Passes between two places where a zigzag program can start again.
const RESTART_PASSES: usize = 50;

/// A tile on the machine: its surface, its blank and the frames between them.
pub struct TileSetup {
    pub setup: Setup,
    pub piece: TileSurface,
    /// The blank's top above the tile's highest design point.
    pub allowance_mm: f64,
    /// The program's Z0 above the tile's highest design point.
    pub z_zero_mm: f64,
}

/// One program as it was written and read back.
pub struct Program {
    /// Relative to the job's folder.
    pub file: PathBuf,
    /// Position among the job's operations.
    pub operation: usize,
    pub reading: Reading,
    pub extent: Extent,
    pub timing: Timing,
}

/// The programs of a tile in one dialect.
pub struct PostPrograms {
    pub dialect: String,
    pub budget: Budget,
    pub programs: Vec<Program>,
    pub passes: Vec<ExactPasses>,
}

impl TileSetup {
    pub fn new(job: &Job, shop: &Shop, setup: Setup, piece: TileSurface, part_top_mm: f64) -> TileSetup {
        let allowance_mm = match job.stock.blanks {
            job::Blanks::PerTile => job.stock.top_allowance_mm,
            // One sheet has one top, whatever the tile's own highest point.
            job::Blanks::One => part_top_mm - piece.surface.top_mm() + shop.stock.top_allowance_mm,
        };
        let z_zero_mm = match job.stock.z_zero {
            ZZero::StockTop => allowance_mm,
            ZZero::PartTop => 0.0,
        };
        TileSetup { setup, piece, allowance_mm, z_zero_mm }
    }

    pub fn surface(&self) -> &dyn Surface {
        &*self.piece.surface
    }

    /// The Z that the design asks for, before any path is planned.
    pub fn need(&self, job: &Job) -> ZNeed {
        ZNeed {
            depth_mm: self.surface().top_mm() - self.surface().bottom_mm(),
            top_allowance_mm: self.allowance_mm,
            clearance_mm: job.machine.clearance_mm,
        }
    }

    /// The program's zero in the part's frame.
    pub fn program_zero_mm(&self) -> [f64; 3] {
        let zero = self.piece.rotation * glam::DVec3::new(0.0, 0.0, self.z_zero_mm);
        (self.piece.origin_mm + zero).to_array()
    }
}

/// How far from its axis, in mm, a cutter touches a face of this slope, at most.
fn contact_radius_mm(shape: &Shape, slope: f64) -> f64 {
    match shape {
        Shape::Ball { .. } => shape.radius_mm() * slope / slope.hypot(1.0),
        _ => shape.radius_mm(),
    }
}

/// How far past the tile's edges an operation may go.
pub fn overrun_mm(job: &Job, shape: &Shape, steepest: [f64; 2]) -> f64 {
    let slope = steepest[0].max(steepest[1]);
    let reach_mm = match job.stock.blanks {
        job::Blanks::PerTile => contact_radius_mm(shape, slope),
        job::Blanks::One => shape.radius_mm(),
    };
    reach_mm + 3.0 * job.part.step_mm
}

/// Plans, writes and reads back every operation of a tile in one dialect; files go under `folder`, the job's staging
/// folder.
pub fn programs(
    job: &Job,
    shop: &Shop,
    tile: &TileSetup,
    dialect: &Dialect,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<PostPrograms, Error> {
    let surface = tile.surface();
    let steepest = surface.steepest();
    let lattice = surface.lattice();
    let need = tile.need(job);
    let budget = Budget::split(
        job.limits.gouge_or_default_mm(),
        dialect.path_tolerance_mm + dialect.merge_tolerance_mm,
        steepest,
        need.depth_mm,
    )?;
    let site = Site {
        surface,
        origin_mm: [tile.setup.tile.x_mm, tile.setup.tile.y_mm],
        neighbours: job.stock.blanks == job::Blanks::One,
        margin_mm: job.stock.margin_mm,
        top_allowance_mm: tile.allowance_mm,
        z_zero_mm: tile.z_zero_mm,
        clearance_mm: job.machine.clearance_mm,
        unit_mm: dialect.unit_mm,
        budget,
    };
    let mut planned =
        PostPrograms { dialect: dialect.name.clone(), budget, programs: Vec::new(), passes: Vec::new() };
    for (index, operation) in job.operations.iter().enumerate() {
        let tool = &shop.tools[index];
        let refused = |source| Error::Toolpath {
            number: index + 1,
            operation: operation.kind.word(),
            tool: tool.name.clone(),
            tile: tile.setup.tile.name.clone(),
            source,
        };
        progress.begin(&format!("{} {}", operation.kind.word(), tool.name), 1000);
        let told = std::cell::Cell::new(0u64);
        let tell = |part: f64| {
            let now = (part * 1000.0) as u64;
            progress.advance(now.saturating_sub(told.replace(now)));
        };
        let path = match operation.kind {
            job::Kind::Rough => {
                let later = &shop.tools[index + 1..];
                let clear_mm = later
                    .iter()
                    .map(|tool| tool.shape.radius_mm() + overrun_mm(job, &tool.shape, steepest))
                    .fold(0.0, f64::max);
                let params = rough::Params {
                    shape: tool.shape,
                    stepdown_mm: operation.stepdown_mm.unwrap_or_default(),
                    stepover_mm: operation.stepover_mm,
                    stock_to_leave_mm: operation.stock_to_leave_mm,
                    direction_deg: operation.direction_deg,
                    clear_mm,
                };
                rough::rough(&site, &params, &tell).map_err(refused)?
            }
            job::Kind::Finish => {
                let spacing = match (operation.stepover_mm, operation.scallop_mm) {
                    (Some(stepover_mm), _) => finish::Spacing::StepoverMm(stepover_mm),
                    (None, scallop_mm) => finish::Spacing::ScallopMm(scallop_mm.unwrap_or_default()),
                };
                let params = finish::Params {
                    shape: tool.shape,
                    spacing,
                    direction_deg: operation.direction_deg,
                    pattern: match operation.pattern {
                        job::Pattern::Zigzag => finish::Pattern::Zigzag,
                        job::Pattern::OneWay => finish::Pattern::OneWay,
                    },
                    stock_to_leave_mm: operation.stock_to_leave_mm,
                    restart_passes: RESTART_PASSES,
                };
                if operation.stock_to_leave_mm == 0.0 {
                    let layout = finish::layout(&site, &params).map_err(refused)?;
                    let profile = Profile::new(tool.shape, lattice.step_mm, 0.0)?;
                    planned.passes.push(ExactPasses { layout, profile });
                }
                finish::finish(&site, &params, &tell).map_err(refused)?
            }
        };
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        progress.begin("write", 1);
        let file = program_file(job, shop, &tile.setup.tile.name, dialect, index, tool);
        write(job, shop, tile, dialect, index, &path, &folder.join(&file))?;
        drop(path);
        progress.begin("read back", 1);
        planned.programs.push(read_back(shop, dialect, folder, file, index)?);
    }
    Ok(planned)
}

/// `programs/<tile>-<nn>-<operation>-<tool>.<ext>`, in a folder for each post where there are several.
fn program_file(job: &Job, shop: &Shop, tile: &str, dialect: &Dialect, index: usize, tool: &Tool) -> PathBuf {
    let tool = tool.name.replace(':', "-");
    let kind = job.operations[index].kind.word();
    let name = format!("{tile}-{:02}-{kind}-{tool}.{}", index + 1, dialect.extension);
    let programs = Path::new("programs");
    if shop.dialects.len() > 1 { programs.join(&dialect.name).join(name) } else { programs.join(name) }
}

fn read_back(
    shop: &Shop,
    dialect: &Dialect,
    folder: &Path,
    file: PathBuf,
    operation: usize,
) -> Result<Program, Error> {
    let path = folder.join(&file);
    let open = File::open(&path).map_err(|source| Error::Output { path: path.clone(), source })?;
    let options = verify::Options { rml_unit_mm: dialect.unit_mm };
    let reading = Reading::from(&mut BufReader::with_capacity(1 << 20, open), &options)
        .map_err(|source| Error::ReadBack { path: file.clone(), source })?;
    let extent = reading.extent();
    let timing = verify::time(&reading, &(&shop.machine).into());
    Ok(Program { file, operation, reading, extent, timing })
}

/// Writes one program; a file that could not be finished keeps no name.
fn write(
    job: &Job,
    shop: &Shop,
    tile: &TileSetup,
    dialect: &Dialect,
    index: usize,
    path: &toolpath::Toolpath,
    file: &Path,
) -> Result<(), Error> {
    let output = |source| Error::Output { path: file.to_path_buf(), source };
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder).map_err(output)?;
    }
    let blank = tile.setup.blank;
    let stock = post::StockFacts {
        material: job.stock.material.clone(),
        width_mm: blank.high_mm[0] - blank.low_mm[0],
        height_mm: blank.high_mm[1] - blank.low_mm[1],
        thickness_mm: job.stock.thickness_mm,
        top_allowance_mm: tile.allowance_mm,
    };
    let program = post::Program {
        path,
        part: &job.name,
        tile: &tile.setup.tile.name,
        operation: job.operations[index].kind.word(),
        tool: &shop.tools[index],
        stock: &stock,
        z_zero: match job.stock.z_zero {
            ZZero::StockTop => post::ZZero::StockTop,
            ZZero::PartTop => post::ZZero::PartTop,
        },
        wcs: &job.machine.wcs,
        clearance_mm: tile.allowance_mm - tile.z_zero_mm + job.machine.clearance_mm,
        notes: &[],
    };
    let mut out = BufWriter::with_capacity(1 << 20, File::create(file).map_err(output)?);
    post::write(&program, dialect, &shop.machine, &mut out)?;
    out.flush().map_err(output)
}

/// The box of a program's motions as the setup checks it: z above the stock's top.
pub fn bounds_over_stock(extent: &Extent, tile: &TileSetup) -> Bounds {
    let shift_mm = tile.z_zero_mm - tile.allowance_mm;
    let mut bounds = Bounds { low_mm: extent.low_mm, high_mm: extent.high_mm };
    bounds.low_mm[2] += shift_mm;
    bounds.high_mm[2] += shift_mm;
    bounds
}
