//! From a tile to program files, and the files read back.

use std::path::{Path, PathBuf};

use super::Error;
use super::judge::ExactPasses;
use super::part::TileSurface;
use super::press::Press;
use super::shop::Shop;
use crate::compensation::Profile;
use crate::cutter::Shape;
use crate::job::{self, Job, ZZero};
use crate::machine::{Bounds, Guard, Setup, Tool, ZNeed};
use crate::post::{Dialect, Section};
use crate::progress::Progress;
use crate::surface::Surface;
use crate::tolerance::Budget;
use crate::toolpath::{self, Retract, Site, finish, rough};
use crate::verify::{Extent, Reading, Timing};

/// Passes between two places where a zigzag program can start again.
const RESTART_PASSES: usize = 50;

/// Cutting between two places where a program can be parted, in lives of the cutter and at most in mm.
const RESTART_LIVES: f64 = 0.05;
const RESTART_MM: f64 = 10e3;

/// Room around a shank that goes below the stock's top.
const SHANK_ROOM_MM: f64 = 0.2;

/// A tile on the machine: its surface, its blank and the frames between them.
pub struct TileSetup {
    pub setup: Setup,
    pub piece: TileSurface,
    /// The blank's top above the tile's highest design point.
    pub allowance_mm: f64,
    /// The program's Z0 above the tile's highest design point.
    pub z_zero_mm: f64,
    /// The clearance plane above the blank's top: the job's, or higher for clamps.
    pub clearance_mm: f64,
}

/// One program as it was written and read back.
pub struct Program {
    /// Relative to the job's folder.
    pub file: PathBuf,
    /// Position among the job's operations.
    pub operation: usize,
    /// None where the operation is one program.
    pub section: Option<Section>,
    pub reading: Reading,
    pub extent: Extent,
    pub timing: Timing,
    /// What rounding does to the mirrors; known of a finish that leaves no stock.
    pub tilt: Option<toolpath::Tilt>,
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
        let clearance_mm = setup.clearance_mm(job.machine.clearance_mm);
        TileSetup { setup, piece, allowance_mm, z_zero_mm, clearance_mm }
    }

    pub fn surface(&self) -> &dyn Surface {
        &*self.piece.surface
    }

    /// The Z that the design asks for, before any path is planned.
    pub fn need(&self) -> ZNeed {
        ZNeed {
            depth_mm: self.surface().top_mm() - self.surface().bottom_mm(),
            top_allowance_mm: self.allowance_mm,
            clearance_mm: self.clearance_mm,
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

/// Radius of what of a tool goes below the stock's top where it is cut `cut_mm` deep: past its neck that is the shank.
fn widest_mm(tool: &Tool, cut_mm: f64) -> f64 {
    let radius_mm = tool.shape.radius_mm();
    match tool.body {
        Some(body) if cut_mm > body.neck_length_mm => {
            radius_mm.max(0.5 * body.shank_diameter_mm + SHANK_ROOM_MM)
        }
        _ => radius_mm,
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

/// Metal beside the tile that roughing takes out of the way of the cutters after operation `index`.
fn clear_mm(job: &Job, shop: &Shop, index: usize, steepest: [f64; 2], cut_mm: f64) -> f64 {
    let later = shop.tools[index + 1..].iter();
    later.map(|tool| widest_mm(tool, cut_mm) + overrun_mm(job, &tool.shape, steepest)).fold(0.0, f64::max)
}

/// How far past the tile's edges the operations reach with their cutters, in mm: surely, and at most with what of a
/// tool is wider than its cutter. `cut_mm` is the deepest cut below the stock's top.
pub fn reach_mm(job: &Job, shop: &Shop, steepest: [f64; 2], cut_mm: f64) -> [f64; 2] {
    let (mut sure, mut most) = (0.0f64, 0.0f64);
    for (index, (operation, tool)) in job.operations.iter().zip(&shop.tools).enumerate() {
        let radius = tool.shape.radius_mm();
        let (axis_mm, stepover_mm) = match operation.kind {
            job::Kind::Rough => {
                let clear = clear_mm(job, shop, index, steepest, cut_mm).min(job.stock.margin_mm);
                let stepover = operation.stepover_mm.unwrap_or(rough::STEPOVER * 2.0 * radius);
                (radius.max(clear - radius) + job.part.step_mm, stepover)
            }
            job::Kind::Finish => {
                (overrun_mm(job, &tool.shape, steepest), operation.stepover_mm.unwrap_or(0.1 * radius))
            }
        };
        let shank = tool.body.map_or(0.0, |body| 0.5 * body.shank_diameter_mm);
        sure = sure.max(axis_mm + radius);
        // The last row may lie up to a stepover further out.
        most = most.max(axis_mm + stepover_mm + radius.max(shank));
    }
    [sure, most]
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
    let need = tile.need();
    let cut_mm = need.depth_mm + need.top_allowance_mm;
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
        clearance_mm: tile.clearance_mm,
        retract: None,
        unit_mm: dialect.unit_mm,
        budget,
    };
    let mut planned =
        PostPrograms { dialect: dialect.name.clone(), budget, programs: Vec::new(), passes: Vec::new() };
    for (index, operation) in job.operations.iter().enumerate() {
        let tool = &shop.tools[index];
        let guard = Guard::new(&tile.setup.obstacles, tool.columns(shop.machine.spindle.nose_diameter_mm));
        let above_mm = job.machine.clearance_mm;
        let life_mm = tool.tool_life_m.map_or(f64::INFINITY, |life_m| 1e3 * life_m);
        let restart_mm = (RESTART_LIVES * life_mm).min(RESTART_MM);
        let retract = Retract { above_mm, restart_mm, guard: &guard };
        let retract = (above_mm < tile.clearance_mm).then_some(retract);
        let site = Site { retract, ..site };
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
                let clear_mm = clear_mm(job, shop, index, steepest, cut_mm);
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
        let number = planned.programs.len() as u32 + 1;
        let press = Press { job, shop, tile, dialect, folder, progress };
        planned.programs.extend(press.print(index, number, &path)?);
    }
    Ok(planned)
}

/// A place of the program as the setup has it: z above the stock's top.
pub fn over_stock(place_mm: [f64; 3], tile: &TileSetup) -> [f64; 3] {
    let [x, y, z] = place_mm;
    [x, y, z + tile.z_zero_mm - tile.allowance_mm]
}

/// The box of a program's motions as the setup checks it: z above the stock's top.
pub fn bounds_over_stock(extent: &Extent, tile: &TileSetup) -> Bounds {
    Bounds { low_mm: over_stock(extent.low_mm, tile), high_mm: over_stock(extent.high_mm, tile) }
}
