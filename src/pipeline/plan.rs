//! From a tile to program files, and the files read back.

use std::path::{Path, PathBuf};

use super::cut::distinct;
use super::judge::ExactPasses;
use super::part::TileSurface;
use super::press::Press;
use super::shop::Shop;
use super::{Error, beside};
use crate::compensation::Profile;
use crate::cutter::Shape;
use crate::job::{self, Face, Job, ZZero};
use crate::machine::{Bounds, Guard, Setup, Tool, ZNeed};
use crate::post::{Dialect, Section};
use crate::progress::Progress;
use crate::surface::Surface;
use crate::tolerance::Budget;
use crate::toolpath::{self, JobGrid, Rest, Retract, Site, finish, rough};
use crate::verify::{Extent, Reading, Timing};

/// Passes between two places where a zigzag program can start again.
const RESTART_PASSES: usize = 50;

/// Cutting between two places where a program can be parted, in lives of the cutter and at most in mm.
const RESTART_LIVES: f64 = 0.05;
const RESTART_MM: f64 = 10e3;

/// Room around a shank that goes below the stock's top.
const SHANK_ROOM_MM: f64 = 0.2;

/// Room around clamps that an outline run keeps.
pub const SPARE_MM: f64 = 1.0;

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
    /// Which side of the blank is up.
    pub face: Face,
    /// None where the operation is one program.
    pub section: Option<Section>,
    /// Its motions are kept until the tile is judged.
    pub reading: Reading,
    pub extent: Extent,
    /// The lowest place that it comes to.
    pub lowest_mm: Option<[f64; 3]>,
    pub timing: Timing,
    /// What rounding does to the mirrors; known of a finish that leaves no stock.
    pub tilt: Option<toolpath::Tilt>,
}

/// The programs of a tile in one dialect.
pub struct PostPrograms {
    pub dialect: String,
    pub budget: Budget,
    pub programs: Vec<Program>,
    /// Operations that have nothing to cut here.
    pub left_out: Vec<usize>,
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

    /// The program's Z0 above the blank's face that is up.
    pub fn zero_over_face_mm(&self, face: Face) -> f64 {
        match face {
            Face::Top => self.z_zero_mm - self.allowance_mm,
            Face::Underside => 0.0,
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

/// Metal beside the tile that roughing takes out of the way of the cutters after operation `index`, and of its own
/// shank.
fn clear_mm(job: &Job, shop: &Shop, index: usize, steepest: [f64; 2], cut_mm: f64) -> f64 {
    let deep = |tool: &Tool| tool.body.is_some_and(|body| cut_mm > body.neck_length_mm);
    let later = shop.tools.iter().zip(&shop.kinds).enumerate().skip(index);
    let later = later.filter(|(_, (_, kind))| kind.shapes());
    let later = later.filter(|(nth, (tool, _))| *nth > index || deep(tool)).map(|(_, (tool, _))| tool);
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
                let [along, across] = rough::overrun_mm(radius, stepover, clear);
                (along.max(across) + job.part.step_mm, stepover)
            }
            job::Kind::Finish | job::Kind::Rest => {
                (overrun_mm(job, &tool.shape, steepest), operation.stepover_mm.unwrap_or(0.1 * radius))
            }
            job::Kind::CutOut => (radius, 0.0),
            // Where they lie is the job's own choice; their motions are checked as they are read back.
            job::Kind::Outline | job::Kind::Drill | job::Kind::Mark => continue,
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
    let split = |path_tolerance_mm: f64| {
        Budget::split(job.limits.gouge_or_default_mm(), path_tolerance_mm, steepest, need.depth_mm)
    };
    let budget = split(dialect.path_tolerance_mm + dialect.merge_tolerance_mm)?;
    let controllers = shop
        .dialects
        .iter()
        .map(|dialect| (dialect.unit_mm, dialect.path_tolerance_mm + dialect.merge_tolerance_mm));
    let job_grid = JobGrid::of(&controllers.collect::<Vec<_>>());
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
        apart_mm: job_grid.apart_mm(dialect.unit_mm),
        budget,
        tightest: split(job_grid.loosest_mm())?,
    };
    let mut planned = PostPrograms {
        dialect: dialect.name.clone(),
        budget,
        programs: Vec::new(),
        left_out: Vec::new(),
        passes: Vec::new(),
    };
    // Other tiles of the part, and other operations, may have enough to cut.
    let mut idle = None;
    // Last of all, since they go around the others.
    let outlines = |index: &usize| job.operations[*index].kind == job::Kind::Outline;
    let (last, first): (Vec<usize>, Vec<usize>) = (0..job.operations.len()).partition(outlines);
    for index in first.into_iter().chain(last) {
        let operation = &job.operations[index];
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
                    stepdown_mm: stepdown_mm(operation, tool).unwrap_or_default(),
                    stepover_mm: operation.stepover_mm,
                    stock_to_leave_mm: operation.stock_to_leave_mm,
                    direction_deg: operation.direction_deg,
                    pattern: pattern(operation),
                    ramp_slope: ramp_slope(operation, tool),
                    clear_mm,
                };
                let path = rough::rough(&job_grid.site(&site, &params), &params, &tell);
                match path.and_then(|path| path.in_units(site.unit_mm)) {
                    Err(source @ toolpath::Error::NothingToRough { .. }) => {
                        idle = idle.or(Some(refused(source)));
                        planned.left_out.push(index);
                        continue;
                    }
                    path => path.map_err(refused)?,
                }
            }
            job::Kind::Finish => {
                let params = finishing(operation, tool);
                if operation.stock_to_leave_mm == 0.0 {
                    let layout = finish::layout(&site, &params).map_err(refused)?;
                    let profile = Profile::new(tool.shape, lattice.step_mm, 0.0)?;
                    planned.passes.push(ExactPasses { layout, profile });
                }
                finish::finish(&site, &params, &tell).map_err(refused)?
            }
            job::Kind::Rest => {
                let before = job.operations[..index].iter().zip(&shop.tools);
                let before = before.filter(|(operation, _)| operation.finishes()).map(|(_, tool)| tool.shape);
                let before = distinct(before, lattice.step_mm)?;
                let (over_mm, radius_mm) = (operation.leftover_or_default_mm(), tool.shape.radius_mm());
                let rest = Rest::find(surface, &before, over_mm, radius_mm, &tell).map_err(refused)?;
                progress.begin(&format!("{} {}", operation.kind.word(), tool.name), 1000);
                told.set(0);
                let stay_mm = stay_mm(shop, tool, above_mm + tile.allowance_mm + 0.5 * need.depth_mm);
                finish::rest(&site, &finishing(operation, tool), &rest, stay_mm, &tell).map_err(refused)?
            }
            _ => {
                let work = beside::Work { operation, tool, tile, shop, guard: &guard };
                work.path(&site, &planned.programs).map_err(refused)?
            }
        };
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        if path.moves.is_empty() {
            planned.left_out.push(index);
            continue;
        }
        let number = planned.programs.len() as u32 + 1;
        let press = Press { job, shop, tile, dialect, folder, progress };
        planned.programs.extend(press.print(index, number, &path)?);
    }
    if let (true, Some(idle)) = (planned.programs.is_empty(), idle) {
        return Err(idle);
    }
    if job.operations.iter().any(|operation| operation.kind == job::Kind::Rest) {
        // What passes leave that are only here and there is not worked out.
        planned.passes.clear();
    }
    // In run order.
    planned.programs.sort_by_key(|program| program.operation);
    Ok(planned)
}

/// The longest gap over which it takes no longer to go on cutting than to retract by `height_mm`, travel and come down.
fn stay_mm(shop: &Shop, tool: &Tool, height_mm: f64) -> f64 {
    let rate = &shop.machine.rate;
    let minutes = 2.0 * height_mm / rate.rapid_z_mm_min + toolpath::APPROACH_MM / tool.plunge_mm_min;
    tool.feed_mm_min * minutes
}

/// The stepdown that an operation is cut with: as the job asks, but no deeper than the tool may bite.
pub fn stepdown_mm(operation: &job::Operation, tool: &Tool) -> Option<f64> {
    operation
        .stepdown_mm
        .map(|wanted_mm| tool.max_depth_mm.map_or(wanted_mm, |most_mm| most_mm.min(wanted_mm)))
}

/// How steeply roughing goes down: as the job asks, but no faster than the tool plunges.
fn ramp_slope(operation: &job::Operation, tool: &Tool) -> f64 {
    match operation.ramp_or_default_deg() {
        deg if deg >= 90.0 => f64::INFINITY,
        deg => deg.to_radians().tan().min(tool.plunge_mm_min / tool.feed_mm_min),
    }
}

fn pattern(operation: &job::Operation) -> finish::Pattern {
    match operation.pattern {
        job::Pattern::Zigzag => finish::Pattern::Zigzag,
        job::Pattern::OneWay => finish::Pattern::OneWay,
    }
}

/// What a finishing operation asks for.
fn finishing(operation: &job::Operation, tool: &Tool) -> finish::Params {
    finish::Params {
        shape: tool.shape,
        spacing: match (operation.stepover_mm, operation.scallop_mm) {
            (Some(stepover_mm), _) => finish::Spacing::StepoverMm(stepover_mm),
            (None, scallop_mm) => finish::Spacing::ScallopMm(scallop_mm.unwrap_or_default()),
        },
        direction_deg: operation.direction_deg,
        pattern: pattern(operation),
        stock_to_leave_mm: operation.stock_to_leave_mm,
        restart_passes: RESTART_PASSES,
    }
}

/// A place of a program as the setup has it: z above the face of the blank that is up.
pub fn over_stock(place_mm: [f64; 3], tile: &TileSetup, face: Face) -> [f64; 3] {
    let [x, y, z] = place_mm;
    [x, y, z + tile.zero_over_face_mm(face)]
}

/// The box of a program's motions as the setup checks it: z above the face of the blank that is up.
pub fn bounds_over_stock(extent: &Extent, tile: &TileSetup, face: Face) -> Bounds {
    let place = |mm| over_stock(mm, tile, face);
    Bounds { low_mm: place(extent.low_mm), high_mm: place(extent.high_mm) }
}
