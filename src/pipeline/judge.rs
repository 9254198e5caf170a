//! One tile's cut, block by block: the design, the closing by every cutter, the exact passes and the surface that the
//! read-back programs leave, all at full resolution and none of it held beyond a row of blocks.

use super::Error;
use super::light::{self, Sight};
use crate::compensation::{self, Closings, Profile, RowPass, RowTarget, Tables};
use crate::fidelity::cavities::{self, Labelled};
use crate::fidelity::light::LightTally;
use crate::fidelity::{self, Cavities, Found, Layers, Lower, Peaks, Pixels, Tally, polish};
use crate::grid::{Heights, Lattice, Window};
use crate::in_order::in_order;
use crate::progress::Progress;
use crate::surface::Surface;
use crate::toolpath::{Axis, Layout};
use crate::verify::{self, Blank, Judged, ProgramCut};

const BLOCK_COLUMNS: usize = 2048;
const BLOCK_ROWS: usize = 800;
/// Blocks begin at multiples of this, as what is bounded by squares does.
const BLOCK_STEP: usize = 16;
/// Rows that are handed on together.
const STRIP_ROWS: usize = 128;

/// The passes of a finishing operation that leaves no stock.
pub struct ExactPasses {
    pub layout: Layout,
    pub profile: Profile,
}

/// What is judged.
pub struct Case<'a> {
    pub surface: &'a dyn Surface,
    /// In the tile's frame.
    pub blank: Blank,
    /// The programs of each post in run order.
    pub posts: &'a [Vec<Judged<'a>>],
    /// Every cutter of the job once.
    pub cutters: &'a [Tables],
    pub passes: &'a [ExactPasses],
    pub tally: fidelity::Params,
    pub cavities: cavities::Params,
    pub sight: Option<&'a Sight<'a>>,
    /// Removal of the model of polishing, if its light is wanted.
    pub polish_mm: Option<f64>,
    /// Longest side of the pictures that are made on the way, in pixels.
    pub most_pixels: usize,
}

/// What was found in one tile.
pub struct Verdict {
    /// One for each post.
    pub tallies: Vec<Tally>,
    /// For each post and program.
    pub cuts: Vec<Vec<ProgramCut>>,
    pub cavities: Found,
    pub light_designed: LightTally,
    /// For each post.
    pub light_machined: Vec<LightTally>,
    /// Of the first post's cut, polished by the model.
    pub light_polished: LightTally,
    /// Until they are drawn.
    pub pictures: Option<Pictures>,
}

/// Means over pixels of a tile, as the first post cuts it.
#[derive(Clone)]
pub struct Pictures {
    /// Error of the normals in degrees.
    pub normals: Pixels,
    /// Shares on the audience of the design and of the cut, if it is a screen.
    pub light: Option<[Pixels; 2]>,
}

impl Pictures {
    fn merge(&mut self, other: &Pictures) {
        self.normals.merge(&other.normals);
        if let (Some(mine), Some(theirs)) = (&mut self.light, &other.light) {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| mine.merge(theirs));
        }
    }

    fn part(&self, window: Window) -> Pictures {
        let light = self.light.as_ref().map(|maps| [maps[0].part(window), maps[1].part(window)]);
        Pictures { normals: self.normals.part(window), light }
    }
}

/// Some rows of the tile, lowest first, as the first post cuts it.
pub struct Strip {
    pub design: Heights,
    pub machined: Heights,
    pub cavity: Heights,
}

struct Block {
    design: Heights,
    machined: Heights,
    cavity: Heights,
    labelled: Labelled,
    tallies: Vec<Tally>,
    cuts: Vec<Vec<ProgramCut>>,
    light_designed: LightTally,
    light_machined: Vec<LightTally>,
    light_polished: LightTally,
    pictures: Pictures,
}

/// Judges a tile; `each` receives its rows from the lowest y up.
pub fn judge(
    case: &Case,
    progress: &dyn Progress,
    each: &mut (dyn FnMut(Strip) -> Result<(), Error> + Send),
) -> Result<Verdict, Error> {
    let lattice = case.surface.lattice();
    let mut sums = Sums::new(case, &lattice);
    let empty = sums.pictures.clone();
    let rows = blocks(&lattice);
    let windows = rows.concat();
    let make = |index: usize| -> Result<Block, Error> {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let window = windows[index];
        let block = case.block(window, &empty);
        progress.advance(window.samples() as u64);
        block
    };
    // The blocks of a row are summed together; meanwhile, and while the last of a row are made, others of the next row are.
    let mut columns = rows.iter().map(Vec::len);
    let mut wanted = columns.next().unwrap_or(0);
    let ahead = wanted.min(2 * rayon::current_num_threads()).max(2);
    let mut row = Vec::new();
    in_order(windows.len(), ahead, make, |block| {
        row.push(block);
        if row.len() == wanted {
            sums.take(std::mem::take(&mut row), lattice.columns, each)?;
            wanted = columns.next().unwrap_or(0);
        }
        Ok(())
    })?;
    Ok(sums.verdict())
}

/// What is summed up, in the order of the blocks.
struct Sums {
    tallies: Vec<Tally>,
    cuts: Vec<Vec<ProgramCut>>,
    light_designed: LightTally,
    light_machined: Vec<LightTally>,
    light_polished: LightTally,
    pictures: Pictures,
    cavities: Cavities,
}

impl Sums {
    fn new(case: &Case, lattice: &Lattice) -> Sums {
        let picture = || Pixels::new(lattice.columns, lattice.rows, case.most_pixels);
        let nothing = |programs: &Vec<Judged>| vec![ProgramCut::default(); programs.len()];
        Sums {
            tallies: case.posts.iter().map(|_| Tally::new(case.tally)).collect(),
            cuts: case.posts.iter().map(nothing).collect(),
            light_designed: LightTally::default(),
            light_machined: case.posts.iter().map(|_| LightTally::default()).collect(),
            light_polished: LightTally::default(),
            pictures: Pictures { normals: picture(), light: case.sight.map(|_| [picture(), picture()]) },
            cavities: Cavities::new(case.cavities, lattice.window()),
        }
    }

    /// Takes a row of blocks, and hands on its rows of samples.
    fn take(
        &mut self,
        blocks: Vec<Block>,
        columns: usize,
        each: &mut (dyn FnMut(Strip) -> Result<(), Error> + Send),
    ) -> Result<(), Error> {
        let mut layers = Vec::new();
        for block in blocks {
            for (sum, tally) in self.tallies.iter_mut().zip(&block.tallies) {
                sum.merge(tally);
            }
            for (sum, cut) in self.cuts.iter_mut().flatten().zip(block.cuts.iter().flatten()) {
                sum.merge(cut);
            }
            self.light_designed.merge(&block.light_designed);
            for (sum, light) in self.light_machined.iter_mut().zip(&block.light_machined) {
                sum.merge(light);
            }
            self.light_polished.merge(&block.light_polished);
            self.pictures.merge(&block.pictures);
            self.cavities.add(block.labelled)?;
            layers.push([block.design, block.machined, block.cavity]);
        }
        let Some(Window { row, rows, .. }) = layers.first().map(|layers| layers[0].window) else {
            return Ok(());
        };
        // A few rows at a time: a copy of all would be as much as the blocks themselves.
        for first in (0..rows).step_by(STRIP_ROWS) {
            let rows = STRIP_ROWS.min(rows - first);
            let window = Window { column: 0, row: row + first as i64, columns, rows };
            let [design, machined, cavity] = std::array::from_fn(|layer| {
                let mut strip = Heights::empty(window);
                layers.iter().for_each(|layers| paste(&mut strip, &layers[layer]));
                strip
            });
            each(Strip { design, machined, cavity })?;
        }
        Ok(())
    }

    fn verdict(self) -> Verdict {
        Verdict {
            tallies: self.tallies,
            cuts: self.cuts,
            cavities: self.cavities.finish(),
            light_designed: self.light_designed,
            light_machined: self.light_machined,
            light_polished: self.light_polished,
            pictures: Some(self.pictures),
        }
    }
}

/// The blocks of a tile, row by row, lowest y first; all about as large, as what a block sees around itself is worked
/// out for narrow ones too.
pub fn blocks(lattice: &Lattice) -> Vec<Vec<Window>> {
    let alike = |samples: usize, most: usize| {
        samples.div_ceil(samples.div_ceil(most).max(1)).next_multiple_of(BLOCK_STEP).clamp(BLOCK_STEP, most)
    };
    blocks_of(lattice, [alike(lattice.columns, BLOCK_COLUMNS), alike(lattice.rows, BLOCK_ROWS)])
}

/// Blocks of so many columns and rows, row by row, lowest y first.
pub fn blocks_of(lattice: &Lattice, [columns, rows]: [usize; 2]) -> Vec<Vec<Window>> {
    let starts = |count: usize, step: usize| (0..count).step_by(step);
    starts(lattice.rows, rows)
        .map(|row| {
            let rows = rows.min(lattice.rows - row);
            starts(lattice.columns, columns)
                .map(|column| {
                    let columns = columns.min(lattice.columns - column);
                    Window { column: column as i64, row: row as i64, columns, rows }
                })
                .collect()
        })
        .collect()
}

/// Copies the rows of a block that a strip of the tile has.
fn paste(strip: &mut Heights, block: &Heights) {
    let columns = strip.window.columns;
    for row in strip.window.row..strip.window.row_end() {
        let start = (row - strip.window.row) as usize * columns + block.window.column as usize;
        strip.z_mm[start..start + block.window.columns].copy_from_slice(block.row(row));
    }
}

impl Case<'_> {
    fn block(&self, window: Window, pictures: &Pictures) -> Result<Block, Error> {
        let datum_mm = self.surface.top_mm();
        let lattice = self.surface.lattice();
        let reach = self.cutters.iter().map(|tables| tables.profile().reach()).max().unwrap_or(0);
        // Normals need one sample around the block, rays more.
        let pad = self.polish_mm.map_or(0, |_| polish::reach(lattice.step_mm));
        let halo = if self.sight.is_some() { light::halo(lattice.step_mm) + pad } else { 1 };
        let around = self.surface.heights(window.grown((2 * reach).max(halo)), datum_mm)?;
        let design = around.crop(window);
        let cavity = self.cavity(&around, &design);
        let passes = self.exact_passes(&around, window);
        let labelled = cavities::label(window, &cavity, &[], &self.cavities)?;
        let mut block = Block {
            machined: Heights::empty(window),
            tallies: Vec::new(),
            cuts: Vec::new(),
            light_designed: LightTally::default(),
            light_machined: Vec::new(),
            light_polished: LightTally::default(),
            pictures: pictures.part(window),
            design,
            cavity,
            labelled,
        };
        let near = around.crop(window.grown(halo));
        drop(around);
        if let Some(sight) = self.sight {
            let map = block.pictures.light.as_mut().map(|maps| &mut maps[0]);
            sight.add(&mut block.light_designed, &near, window, lattice.step_mm, map);
        }
        // What stands around the tile, walls or a neighbour's design, is in no file beside the report: figures that
        // leaned on it could not be found again from those.
        let own = |heights: &Heights| {
            let inside = heights.window.intersection(&lattice.window())?;
            (inside != heights.window).then(|| heights.crop(inside))
        };
        let own_design = own(&near);
        for (post, programs) in self.posts.iter().enumerate() {
            let stock = self.blank.heights(self.swept_window(window, halo as i64), lattice.step_mm, 0.0);
            let swept = verify::sweep(stock, lattice.step_mm, 0.0, programs);
            let wanted = window.grown(halo);
            let mut machined = match swept.heights.window == wanted {
                true => swept.heights,
                false => swept.heights.crop(wanted),
            };
            let mut tally = Tally::new(self.tally);
            let own_machined = own(&machined);
            let layers = Layers {
                design: own_design.as_ref().unwrap_or(&near),
                machined: own_machined.as_ref().unwrap_or(&machined),
                cavity: (!self.cutters.is_empty()).then_some(&block.cavity),
                passes: passes.as_ref(),
            };
            let normals = (post == 0).then_some(&mut block.pictures.normals);
            tally.add_with(window, layers, normals)?;
            block.tallies.push(tally);
            block.cuts.push(swept.programs);
            mask(&mut machined, &near);
            let mut light = LightTally::default();
            if let Some(sight) = self.sight {
                let map = block.pictures.light.as_mut().filter(|_| post == 0).map(|maps| &mut maps[1]);
                sight.add(&mut light, &machined, window, lattice.step_mm, map);
                if let Some(removal_mm) = self.polish_mm.filter(|_| post == 0) {
                    let part = polish::polished(&machined, lattice.step_mm, removal_mm);
                    sight.add(&mut block.light_polished, &part, window, lattice.step_mm, None);
                }
            }
            block.light_machined.push(light);
            if post == 0 {
                block.machined = machined.crop(window);
            }
        }
        Ok(block)
    }

    /// The block and `halo` samples around it; at the tile's edges all of the blank's margin too, so that what is
    /// cut there is seen.
    fn swept_window(&self, window: Window, halo: i64) -> Window {
        let lattice = self.surface.lattice();
        let low = |edge: bool, first: i64, axis: usize| {
            if edge { (self.blank.low_mm[axis] / lattice.step_mm).floor() as i64 } else { first - halo }
        };
        let high = |edge: bool, end: i64, axis: usize| {
            if edge { (self.blank.high_mm[axis] / lattice.step_mm).ceil() as i64 } else { end + halo }
        };
        let column = low(window.column == 0, window.column, 0).min(window.column - halo);
        let row = low(window.row == 0, window.row, 1).min(window.row - halo);
        let column_end = high(window.column_end() == lattice.columns as i64, window.column_end(), 0);
        let row_end = high(window.row_end() == lattice.rows as i64, window.row_end(), 1);
        Window {
            column,
            row,
            columns: (column_end.max(window.column_end() + halo) - column) as usize,
            rows: (row_end.max(window.row_end() + halo) - row) as usize,
        }
    }

    /// Minimum over the cutters of the closing, less the design. The smallest cutter is closed with everywhere,
    /// others where they could get lower.
    fn cavity(&self, around: &Heights, design: &Heights) -> Heights {
        let mut cutters: Vec<&Tables> = self.cutters.iter().collect();
        cutters.sort_by(|a, b| a.profile().radius_mm().total_cmp(&b.profile().radius_mm()));
        let Some((smallest, others)) = cutters.split_first() else { return Heights::empty(design.window) };
        let mut closings = Closings::new();
        let mut lowest = closings.of(around, smallest, design.window).clone();
        let mut peaks = None;
        for tables in others {
            let peaks = peaks.get_or_insert_with(|| Peaks::of(around));
            let step_mm = self.surface.lattice().step_mm;
            let Lower { within, marks } =
                peaks.lower_within(&tables.profile().shape(), step_mm, &lowest, design);
            for within in within {
                let closed = match &marks {
                    Some([positions, marked]) => {
                        closings.of_flat_at(around, tables, within, [positions, marked])
                    }
                    None => closings.of(around, tables, within),
                };
                lower(&mut lowest, closed);
            }
        }
        compensation::residual(&lowest, design)
    }

    /// What the passes leave before any simplification and rounding; None where they run at an angle to the
    /// samples, or their positions are not as dense.
    fn exact_passes(&self, around: &Heights, window: Window) -> Option<Heights> {
        let step_mm = self.surface.lattice().step_mm;
        let mut lowest: Option<Heights> = None;
        for passes in self.passes {
            if passes.layout.slope != 0.0 || (passes.layout.pitch_mm() - step_mm).abs() > 1e-9 * step_mm {
                return None;
            }
            let left = match passes.layout.along {
                Axis::X => passes.left(around, window),
                Axis::Y => transposed(&passes.left(&transposed(around), swapped(window))),
            };
            match &mut lowest {
                None => lowest = Some(left),
                Some(lowest) => lower(lowest, &left),
            }
        }
        lowest
    }
}

impl ExactPasses {
    fn left(&self, around: &Heights, window: Window) -> Heights {
        let step_mm = self.profile.step_mm();
        let reach_mm = (self.profile.reach() + 1) as f64 * step_mm;
        let near = |low: i64, end: i64| (low as f64 * step_mm - reach_mm, end as f64 * step_mm + reach_mm);
        let (x_low, x_high) = near(window.column, window.column_end());
        let (y_low, y_high) = near(window.row, window.row_end());
        let layout = &self.layout;
        let index = |x_mm: f64| (x_mm - layout.start_mm()) / layout.pitch_mm();
        let first = index(x_low).floor().max(0.0) as usize;
        let end = (index(x_high).ceil().max(0.0) as usize + 1).min(layout.count);
        if first >= end {
            return Heights::empty(window);
        }
        let targets: Vec<RowTarget> = (0..layout.passes.len())
            .map(|k| layout.across_mm(k))
            .filter(|y_mm| (y_low..=y_high).contains(y_mm))
            .map(|y_mm| RowTarget {
                x0_mm: f64::from(layout.start + first as i32 * layout.pitch) * layout.unit_mm,
                y_mm,
                count: end - first,
            })
            .collect();
        let rows = compensation::rows(around, &self.profile, &targets);
        let passes: Vec<RowPass> = targets
            .iter()
            .zip(&rows)
            .map(|(target, z_mm)| RowPass { x0_mm: target.x0_mm, y_mm: target.y_mm, z_mm })
            .collect();
        compensation::machined_by_rows(&passes, &self.profile, window)
    }
}

/// Takes the lower of both where `other` is.
fn lower(lowest: &mut Heights, other: &Heights) {
    let (window, part) = (lowest.window, other.window);
    for row in part.row..part.row_end() {
        let start = (row - window.row) as usize * window.columns + (part.column - window.column) as usize;
        for (z, other) in lowest.z_mm[start..start + part.columns].iter_mut().zip(other.row(row)) {
            *z = z.min(*other);
        }
    }
}

/// Leaves the machined surface where there is a design.
fn mask(machined: &mut Heights, design: &Heights) {
    for (z, design) in machined.z_mm.iter_mut().zip(&design.z_mm) {
        *z = if design.is_nan() { f32::NAN } else { *z };
    }
}

fn swapped(window: Window) -> Window {
    Window { column: window.row, row: window.column, columns: window.rows, rows: window.columns }
}

fn transposed(heights: &Heights) -> Heights {
    let window = swapped(heights.window);
    let mut out = Heights::empty(window);
    for row in 0..window.rows {
        for column in 0..window.columns {
            out.z_mm[row * window.columns + column] = heights.z_mm[column * window.rows + row];
        }
    }
    out
}
