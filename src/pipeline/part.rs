//! What a job cuts, and the piece of it that each tile is.

use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::Error;
use super::levelled::Levelled;
use crate::fidelity::light::Pose;
use crate::grid::Window;
use crate::job::{Blanks, Edge, Form, Job, Level, Unit, Up};
use crate::machine::{Quantum, Tile};
use crate::progress::Progress;
use crate::screen::{self, CellRange, Design, Scene};
use crate::surface::{self, Designed, Die, Surface, Walled};

/// The part as it was given, before tiles, dies and levelling.
pub struct Part {
    /// The cells, if it is a designed screen.
    pub design: Option<Arc<Design>>,
    /// All of them as they stand in the design; None where they are turned as one.
    flat: Option<Arc<Designed>>,
    pub scene: Option<Scene>,
    /// The whole part as it is cut: turned level if it is a mesh, turned into its die.
    pub whole: Arc<dyn Surface>,
    pub notes: Vec<String>,
    /// Wedge angles of what was turned as a whole; tiles of a design on blanks of their own are levelled one by one.
    wedge_deg: [f64; 2],
    undercuts: Option<Undercuts>,
    /// A design that is cut from one sheet, and so turned as one.
    turned: Option<Turned>,
}

/// A point of what was turned is back . (p - shift) of what it was.
#[derive(Clone, Copy)]
struct Turned {
    back: DMat3,
    shift_mm: DVec3,
}

/// Faces that lean over after levelling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Undercuts {
    pub faces: usize,
    pub area_mm2: f64,
}

/// The surface of one tile in its own frame, and how it lies in the part.
pub struct TileSurface {
    pub surface: Arc<dyn Surface>,
    /// What of it need not be held all the time.
    levelled: Option<Arc<Levelled>>,
    /// Wedge angles about X and Y that mount it.
    pub wedge_deg: [f64; 2],
    pub undercuts: Option<Undercuts>,
    /// A point p of the tile's frame (z = 0 at its highest design point) in the part's frame is
    /// rotation . p + origin.
    pub rotation: DMat3,
    pub origin_mm: DVec3,
}

impl TileSurface {
    /// Has ready what [`TileSurface::shed`] let go.
    pub fn hold(&self) -> Result<(), Error> {
        if let Some(levelled) = &self.levelled {
            levelled.hold()?;
        }
        Ok(())
    }

    /// Lets go what is as large as the tile and can be made again.
    pub fn shed(&self) {
        if let Some(levelled) = &self.levelled {
            levelled.shed();
        }
    }
}

impl Part {
    /// Loads or designs what the job names.
    pub fn load(job: &Job, progress: &dyn Progress) -> Result<Part, Error> {
        let mut part = match &job.part {
            spec if spec.screen.is_some() || spec.design.is_some() => Part::designed(job, progress)?,
            spec => {
                let path = spec.mesh.as_deref().or(spec.heights.as_deref()).unwrap_or(Path::new(""));
                let options = surface::Options {
                    step_mm: spec.step_mm,
                    pixel_mm: spec.pixel_mm,
                    unit: match spec.unit {
                        None | Some(Unit::Mm) => surface::Unit::Mm,
                        Some(Unit::M) => surface::Unit::Metre,
                        Some(Unit::Inch) => surface::Unit::Inch,
                    },
                    up: match spec.up {
                        Some(Up::X) => surface::Up::X,
                        Some(Up::Y) => surface::Up::Y,
                        None | Some(Up::Z) => surface::Up::Z,
                    },
                    z_min_mm: spec.z_min_mm,
                    z_max_mm: spec.z_max_mm,
                };
                let opened = surface::open(path, &options)?;
                let mut part = Part {
                    design: None,
                    flat: None,
                    scene: None,
                    whole: Arc::from(opened.surface),
                    notes: opened.notes,
                    wedge_deg: [0.0; 2],
                    undercuts: None,
                    turned: None,
                };
                if spec.level == Level::Plane {
                    part.turn(job)?;
                }
                part
            }
        };
        if job.part.form == Form::Die {
            part.whole = Arc::new(Die::new(part.whole));
        }
        Ok(part)
    }

    fn designed(job: &Job, progress: &dyn Progress) -> Result<Part, Error> {
        let spec = &job.part;
        let cells = spec.cells.map(|[c0, r0, c1, r1]| CellRange { c0, r0, c1, r1 });
        let (design, scene) = match (&spec.screen, &spec.design) {
            (Some(path), _) => {
                let scene = Scene::read(path)?;
                let elevation = match &spec.elevation {
                    Some(path) => Some(screen::Elevation::read(path)?),
                    None => None,
                };
                progress.begin("design", 1);
                let design = screen::design(&scene, cells, elevation.as_ref(), &|_, _| {})?;
                (design, Some(scene))
            }
            (None, path) => {
                let mut design = Design::read(path.as_deref().unwrap_or(Path::new("")))?;
                if let Some(cells) = cells {
                    let core = design.core;
                    let inside = cells.c0 >= core.c0 && cells.c1 <= core.c1;
                    if !(inside && cells.r0 >= core.r0 && cells.r1 <= core.r1) {
                        return Err(Error::CellsOutside { cells, core });
                    }
                    design.core = cells;
                }
                (design, None)
            }
        };
        let design = Arc::new(design);
        let flat = Arc::new(Designed::whole(Arc::clone(&design), spec.step_mm)?);
        let mut part = Part {
            design: Some(design),
            whole: Arc::clone(&flat) as Arc<dyn Surface>,
            flat: Some(flat),
            scene,
            notes: Vec::new(),
            wedge_deg: [0.0; 2],
            undercuts: None,
            turned: None,
        };
        if spec.level == Level::Plane && job.stock.blanks == Blanks::One {
            part.turned = Some(part.turn(job)?);
            part.flat = None;
        }
        Ok(part)
    }

    /// Turns the whole part level.
    fn turn(&mut self, job: &Job) -> Result<Turned, Error> {
        let level = self.whole.levelled()?;
        self.wedge_deg = wedge(job, &level);
        self.undercuts = undercuts(&level);
        let (back, shift_mm) = (back(&level), DVec3::from_array(level.shift_mm));
        self.whole = Arc::new(level.surface);
        Ok(Turned { back, shift_mm })
    }

    /// Refuses a limit on the light of a part that has none.
    pub fn check_light(&self, job: &Job) -> Result<(), Error> {
        match (self.lightless(job), job.limits.on_audience_min) {
            (Some(what), Some(limit)) => Err(Error::NoLight { limit, what }),
            _ => Ok(()),
        }
    }

    /// Why no light is followed from the part, if it is not.
    pub fn lightless(&self, job: &Job) -> Option<&'static str> {
        match (&self.scene, job.part.form) {
            (None, _) => Some("not designed from a scene"),
            (_, Form::Die) => Some("a die, which reflects nothing"),
            _ => None,
        }
    }

    /// What the part may be cut between.
    pub fn quantum(&self) -> Quantum {
        match (&self.design, self.turned) {
            (Some(design), None) => Quantum::Cell { cell_mm: design.cell_mm },
            _ => Quantum::Sample { step_mm: self.whole.lattice().step_mm },
        }
    }

    /// Width and height in mm.
    pub fn size_mm(&self) -> [f64; 2] {
        let lattice = self.whole.lattice();
        [lattice.width_mm, lattice.height_mm]
    }

    /// The surface of one tile.
    pub fn tile(&self, job: &Job, tile: &Tile) -> Result<TileSurface, Error> {
        let step_mm = job.part.step_mm;
        let one_sheet = job.stock.blanks == Blanks::One;
        let part_top_mm = self.whole.top_mm();
        let mut wedge_deg = self.wedge_deg;
        let mut undercut = self.undercuts;
        let mut rotation = DMat3::IDENTITY;
        let mut shift_mm = DVec3::ZERO;
        let mut levelled = None;
        let surface: Arc<dyn Surface> = match &self.design {
            Some(design) if self.turned.is_none() && !(one_sheet && job.part.edge == Edge::Wall) => {
                let cell_mm = design.cell_mm;
                let count = |length_mm: f64| (length_mm / cell_mm).round() as i32;
                let die = job.part.form == Form::Die;
                // A die is the part seen from behind: its left tile is the part's right one.
                let x_mm = if die { self.size_mm()[0] - tile.x_mm - tile.width_mm } else { tile.x_mm };
                let (c0, r0) = (design.core.c0 + count(x_mm), design.core.r0 + count(tile.y_mm));
                let own = CellRange { c0, r0, c1: c0 + count(tile.width_mm), r1: r0 + count(tile.height_mm) };
                let material = if one_sheet { design.core } else { own };
                let size_mm = [tile.width_mm, tile.height_mm];
                let piece = self.cut_out(design, material, [x_mm, tile.y_mm], size_mm, step_mm)?;
                let piece: Arc<dyn Surface> = if job.part.level == Level::Plane {
                    let flat = piece;
                    let level = flat.levelled()?;
                    wedge_deg = wedge(job, &level);
                    undercut = undercuts(&level);
                    rotation = back(&level);
                    shift_mm = DVec3::from_array(level.shift_mm);
                    if die {
                        // A die is its part turned half round Y and moved right by the width, M p + w: with the part's
                        // p' = R p + s the die's turns by M R M, and moves by w' - M R M w + M s.
                        let about = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
                        let turned = level.surface.lattice().width_mm;
                        rotation = about * rotation * about;
                        shift_mm = DVec3::new(turned, 0.0, 0.0)
                            - rotation.transpose() * DVec3::new(tile.width_mm, 0.0, 0.0)
                            + about * shift_mm;
                    }
                    let turned = Arc::new(Levelled::new(flat, level));
                    levelled = Some(Arc::clone(&turned));
                    turned
                } else {
                    piece
                };
                if die { Arc::new(Die::new(piece)) } else { piece }
            }
            _ => self.piece_of_samples(job, tile)?,
        };
        let top_mm = surface.top_mm();
        // Source z of the tile's frame: the tile's own top is its zero.
        let corner = rotation * (DVec3::new(0.0, 0.0, top_mm) - shift_mm);
        let origin_mm = corner + DVec3::new(tile.x_mm, tile.y_mm, -part_top_mm);
        let surface = match job.part.edge {
            Edge::Wall if !one_sheet => {
                let wall_mm = top_mm + job.stock.top_allowance_mm;
                Arc::new(Walled::new(surface, wall_mm)) as Arc<dyn Surface>
            }
            _ => surface,
        };
        Ok(TileSurface { surface, levelled, wedge_deg, undercuts: undercut, rotation, origin_mm })
    }

    /// A rectangle of the design. What its facets leave of each other is not worked out again for all of it.
    fn cut_out(
        &self,
        design: &Arc<Design>,
        material: CellRange,
        origin_mm: [f64; 2],
        [width_mm, height_mm]: [f64; 2],
        step_mm: f64,
    ) -> Result<Arc<Designed>, Error> {
        let all = self.flat.as_ref().filter(|flat| {
            let lattice = flat.lattice();
            flat.material() == material
                && flat.origin_mm() == origin_mm
                && [lattice.width_mm, lattice.height_mm] == [width_mm, height_mm]
        });
        match all {
            Some(flat) => Ok(Arc::clone(flat)),
            None => {
                let size_mm = [width_mm, height_mm];
                Ok(Arc::new(Designed::new(Arc::clone(design), material, origin_mm, size_mm, step_mm)?))
            }
        }
    }

    /// A tile on whole samples of the part, with its neighbours if it is one sheet.
    fn piece_of_samples(&self, job: &Job, tile: &Tile) -> Result<Arc<dyn Surface>, Error> {
        let lattice = self.whole.lattice();
        let step_mm = lattice.step_mm;
        let start = |mm: f64| (mm / step_mm).round() as i64;
        // At the part's own end the last sample need not stand for a whole step.
        let end = |mm: f64, size_mm: f64, count: usize| match mm > size_mm - 1e-6 * step_mm {
            true => count as i64,
            false => start(mm),
        };
        let (column, row) = (start(tile.x_mm), start(tile.y_mm));
        let columns = end(tile.x_mm + tile.width_mm, lattice.width_mm, lattice.columns) - column;
        let rows = end(tile.y_mm + tile.height_mm, lattice.height_mm, lattice.rows) - row;
        let window = Window { column, row, columns: columns.max(1) as usize, rows: rows.max(1) as usize };
        let one_sheet = job.stock.blanks == Blanks::One;
        let mut whole = Arc::clone(&self.whole);
        if one_sheet && job.part.edge == Edge::Wall {
            let wall_mm = whole.top_mm() + job.stock.top_allowance_mm;
            whole = Arc::new(Walled::new(whole, wall_mm));
        }
        if window == lattice.window() {
            return Ok(whole);
        }
        let piece = surface::Tile::new(whole, window, one_sheet)?;
        let piece = piece.ok_or_else(|| Error::EmptyTile { tile: tile.name.clone() })?;
        Ok(Arc::new(piece))
    }

    /// Width and height of the whole screen, and this part's lower left corner on it; None for what is no screen.
    pub fn on_screen_mm(&self) -> Option<([f64; 2], [f64; 2])> {
        let (scene, design) = (self.scene.as_ref()?, self.design.as_ref()?);
        let corner = [design.core.c0, design.core.r0].map(|cell| f64::from(cell) * design.cell_mm);
        Some(([scene.width_m * 1e3, scene.height_m * 1e3], corner))
    }

    /// Where a tile stands in front of its audience; None for what is no screen, and for dies, which reflect nothing.
    pub fn pose(&self, job: &Job, tile: &TileSurface) -> Option<Pose> {
        let (scene, design) = (self.scene.as_ref()?, self.design.as_ref()?);
        if job.part.form == Form::Die {
            return None;
        }
        let Turned { back, shift_mm } =
            self.turned.unwrap_or(Turned { back: DMat3::IDENTITY, shift_mm: DVec3::ZERO });
        let centre_m = 0.5 * DVec3::new(scene.width_m, scene.height_m, 0.0);
        let corner_mm =
            DVec3::new(f64::from(design.core.c0), f64::from(design.core.r0), 0.0) * design.cell_mm;
        let origin_mm = tile.origin_mm + DVec3::new(0.0, 0.0, self.whole.top_mm()) - shift_mm;
        let origin_m = (corner_mm + back * origin_mm) * 1e-3 - centre_m;
        Some(Pose { origin_m, rotation: back * tile.rotation })
    }
}

/// Wedge angles of what is cut: a die is its part turned half round Y, which reverses turns about X.
fn wedge(job: &Job, level: &surface::Level) -> [f64; 2] {
    match job.part.form {
        Form::Part => [level.about_x_deg, level.about_y_deg],
        Form::Die => [-level.about_x_deg, level.about_y_deg],
    }
}

/// The rotation that puts a levelled part back.
fn back(level: &surface::Level) -> DMat3 {
    // Columns of the transpose are the rows of the rotation.
    let rows = level.rotation.map(DVec3::from_array);
    DMat3::from_cols(rows[0], rows[1], rows[2])
}

fn undercuts(level: &surface::Level) -> Option<Undercuts> {
    (level.undercuts > 0).then_some(Undercuts { faces: level.undercuts, area_mm2: level.undercut_area_mm2 })
}
