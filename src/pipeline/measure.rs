//! What cutters leave of a part at best: deviations, normals and light of their closings, block by block.

use super::Error;
use super::check::Facts;
use super::judge::blocks_of;
use super::light::{self, Sight};
use super::plan::TileSetup;
use super::share::squares;
use crate::compensation::{self, Closings};
use crate::fidelity::light::{Known, LightTally};
use crate::fidelity::{self, Layers, Tally};
use crate::grid::{Heights, Window};
use crate::in_order::in_order;
use crate::progress::Progress;

/// Most cutters that are tried together.
pub(super) const MOST_CUTTERS: usize = 12;

/// Samples along a side of a block: a closing needs twice the cutter's reach around it, which large blocks share.
const BLOCK: usize = 2048;

/// What was measured of one set.
#[derive(Clone)]
pub(super) struct Measured {
    pub tally: Tally,
    pub light: LightTally,
    /// Sums of each block by itself.
    pub squares: Vec<Looked>,
}

/// Sums over one block, for standard errors.
#[derive(Clone, Copy)]
pub(super) struct Looked {
    pub samples: f64,
    pub unreachable: f64,
    pub cavity: f64,
    pub incident: f64,
    pub on_audience: f64,
}

/// What was measured of some sets over all tiles.
pub(super) struct OfSets {
    pub sets: Vec<Measured>,
    /// Block by block, how many samples each combination of the sets reaches.
    pub masks: Vec<Vec<u64>>,
    /// Of the design.
    pub designed: LightTally,
}

impl Measured {
    fn new(params: fidelity::Params) -> Measured {
        Measured { tally: Tally::new(params), light: LightTally::default(), squares: Vec::new() }
    }

    fn add(&mut self, block: &Measured) {
        self.tally.merge(&block.tally);
        self.light.merge(&block.light);
        let figures = block.tally.figures();
        let samples = figures.samples as f64;
        let [incident, on_audience] = block.light.incident_and_on_audience();
        self.squares.push(Looked {
            samples,
            unreachable: samples * (1.0 - figures.within_limit_fraction.unwrap_or(1.0)),
            cavity: samples * figures.cavity_area_fraction.unwrap_or(0.0),
            incident,
            on_audience,
        });
    }
}

impl Facts<'_> {
    /// Samples that are looked at.
    pub(super) fn looked_at(&self) -> u64 {
        self.windows().iter().flatten().map(|window| window.samples() as u64).sum()
    }

    /// Lets go what is held of a tile, unless it is the only one.
    pub(super) fn done(&self, tile: &TileSetup) {
        if self.tiles.len() > 1 {
            tile.piece.shed();
        }
    }

    /// The windows that are looked at, of each tile its own.
    fn windows(&self) -> Vec<Vec<Window>> {
        let lattices = self.tiles.iter().map(|tile| tile.surface().lattice());
        match self.share {
            share if share < 1.0 => squares(lattices, share),
            _ => lattices.map(|lattice| blocks_of(&lattice, [BLOCK; 2]).concat()).collect(),
        }
    }

    fn params(&self) -> fidelity::Params {
        let limit_mm = Some(self.job.limits.deviation_or_default_mm());
        fidelity::Params { step_mm: self.job.part.step_mm, limit_mm }
    }

    /// Measures each set over all tiles.
    pub(super) fn measure(&self, sets: &[Vec<usize>], progress: &dyn Progress) -> Result<OfSets, Error> {
        let new = |_| Measured::new(self.params());
        let mut of = OfSets {
            sets: sets.iter().map(new).collect(),
            masks: Vec::new(),
            designed: LightTally::default(),
        };
        for (tile, windows) in self.tiles.iter().zip(self.windows()) {
            if windows.is_empty() {
                continue;
            }
            tile.piece.hold()?;
            let sight = self.sight(tile);
            let make = |index: usize| {
                if progress.interrupted() {
                    return Err(Error::Interrupted);
                }
                let window = windows[index];
                let done = self.block(tile, sight.as_ref(), window, sets);
                progress.advance(window.samples() as u64);
                done
            };
            let ahead = 2 * rayon::current_num_threads();
            in_order(windows.len(), ahead, make, |(sets, counts, light)| {
                for (total, set) in of.sets.iter_mut().zip(&sets) {
                    total.add(set);
                }
                of.masks.push(counts);
                of.designed.merge(&light);
                Ok(())
            })?;
            self.done(tile);
        }
        Ok(of)
    }

    fn sight(&self, tile: &TileSetup) -> Option<Sight<'_>> {
        let steepest = self.part.whole.steepest();
        let pose = self.part.pose(self.job, &tile.piece)?;
        let scene = self.part.scene.as_ref()?;
        Some(Sight { scene, pose, steepest: steepest[0].hypot(steepest[1]), far_field: None })
    }

    fn block(
        &self,
        tile: &TileSetup,
        sight: Option<&Sight>,
        window: Window,
        sets: &[Vec<usize>],
    ) -> Result<(Vec<Measured>, Vec<u64>, LightTally), Error> {
        let surface = tile.surface();
        let step_mm = self.job.part.step_mm;
        let limit_mm = self.job.limits.deviation_or_default_mm() as f32;
        let reach =
            sets.iter().flatten().map(|&i| self.candidates[i].tables.profile().reach()).max().unwrap_or(0);
        // Normals need one sample around the block, rays as many as `light` gives them.
        let halo = if sight.is_some() { light::halo(step_mm) } else { 1 };
        let near = window.grown(halo);
        let around = surface.heights(near.grown(2 * reach), surface.top_mm())?;
        let design = around.crop(near);
        let room = sight.map(|sight| (sight.pose, sight.room()));
        let known = room.as_ref().map(|(pose, room)| Known::new(&design, window, step_mm, pose, room));
        let mut reached = vec![0u16; near.samples()];
        let mut measured = Vec::new();
        let mut closings = Closings::new();
        for (bit, set) in sets.iter().enumerate() {
            let mut closing = self.closing(&mut closings, &around, set, near);
            for ((mask, closed), z) in reached.iter_mut().zip(&mut closing.z_mm).zip(&design.z_mm) {
                *mask |= u16::from(*closed - z <= limit_mm) << bit;
                if z.is_nan() {
                    // Past the part's edge there is nothing, only the cutter's flank.
                    *closed = f32::NAN;
                }
            }
            let mut tally = Tally::new(self.params());
            let cavity = compensation::residual(&closing, &design);
            let layers = Layers { design: &design, machined: &closing, cavity: Some(&cavity), passes: None };
            tally.add(window, layers)?;
            let light = known.as_ref().map_or_else(LightTally::default, |known| known.with(&closing));
            measured.push(Measured { tally, light, squares: Vec::new() });
        }
        let mut counts = vec![0u64; 1 << sets.len().min(MOST_CUTTERS)];
        for row in window.row..window.row_end() {
            let start = (row - near.row) as usize * near.columns + halo;
            let line = &reached[start..start + window.columns];
            for (mask, z) in line.iter().zip(&design.z_mm[start..]) {
                if !z.is_nan() {
                    counts[usize::from(*mask)] += 1;
                }
            }
        }
        let designed = known.map_or_else(LightTally::default, Known::into_light);
        Ok((measured, counts, designed))
    }

    /// The lowest of what a set's cutters leave.
    pub(super) fn closing(
        &self,
        closings: &mut Closings,
        around: &Heights,
        set: &[usize],
        out: Window,
    ) -> Heights {
        let mut lowest = Heights::empty(out);
        for &index in set {
            let closing = closings.of(around, &self.candidates[index].tables, out);
            for (z, other) in lowest.z_mm.iter_mut().zip(&closing.z_mm) {
                *z = z.min(*other);
            }
        }
        lowest
    }
}
