//! Cavities as regions: where the job's cutters cannot reach, joined across blocks in one pass.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::Error;
use super::outline::{Outline, Shape};
use super::tally::{SUM_UNITS_PER_MM, covers, part_of_row, to_sum};
use crate::grid::{Heights, Window};

/// What changes the answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub step_mm: f64,
    /// A sample belongs to a cavity when its depth is greater than this.
    pub threshold_mm: f64,
    /// Regions that are kept whole, the largest by volume; the rest are only counted.
    pub keep: usize,
    /// Regions of up to this many samples get their true outline, larger ones their convex hull.
    pub outline_samples: u64,
}

impl Params {
    /// 1 um, the 10,000 largest, outlines up to 4096 samples.
    pub fn at_step(step_mm: f64) -> Params {
        let threshold_mm = super::CAVITY_THRESHOLD_MM;
        Params { step_mm, threshold_mm, keep: 10_000, outline_samples: 4096 }
    }
}

/// One connected region (8 neighbours) of samples deeper than the threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct Cavity {
    /// Mean position of its samples, in the part frame.
    pub centre_mm: [f64; 2],
    /// Where it is deepest.
    pub deepest_mm: [f64; 2],
    pub area_mm2: f64,
    pub depth_mm: f64,
    pub volume_mm3: f64,
    pub outline: Outline,
    /// For each candidate cutter, the most it would leave anywhere in the region.
    pub residuals_mm: Vec<f64>,
}

impl Cavity {
    /// The first of the candidate cutters, given largest first, that leaves no more than `threshold_mm`.
    pub fn reached_by(&self, threshold_mm: f64) -> Option<usize> {
        self.residuals_mm.iter().position(|&residual_mm| residual_mm <= threshold_mm)
    }
}

/// The cavities of a tile: the largest by volume first, and what else there is.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    pub cavities: Vec<Cavity>,
    /// All regions, listed or not.
    pub count: u64,
    pub area_mm2: f64,
    pub volume_mm3: f64,
}

impl Found {
    /// Regions that are counted but not listed.
    pub fn unlisted(&self) -> u64 {
        self.count - self.cavities.len() as u64
    }
}

/// Columns `start..end` of one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Run {
    pub row: i32,
    pub start: i32,
    pub end: i32,
}

#[derive(Clone, Debug)]
struct Region {
    /// Lowest row, then lowest column: tells regions apart however blocks are cut.
    first: (i32, i32),
    samples: u64,
    volume: i128,
    columns: i64,
    rows: i64,
    depth_mm: f32,
    deepest: (i32, i32),
    residuals_mm: Vec<f32>,
    shape: Shape,
}

impl Region {
    fn absorb(&mut self, other: Region) {
        self.first = self.first.min(other.first);
        self.samples += other.samples;
        self.volume += other.volume;
        self.columns += other.columns;
        self.rows += other.rows;
        if (other.depth_mm, Reverse(other.deepest)) > (self.depth_mm, Reverse(self.deepest)) {
            (self.depth_mm, self.deepest) = (other.depth_mm, other.deepest);
        }
        for (mine, theirs) in self.residuals_mm.iter_mut().zip(other.residuals_mm) {
            *mine = mine.max(theirs);
        }
        self.shape.absorb(other.shape);
    }

    fn bound_shape(&mut self, params: &Params) {
        if self.samples > params.outline_samples {
            self.shape.give_up_runs();
        }
    }

    fn finish(self, params: &Params) -> Cavity {
        let step_mm = params.step_mm;
        let at = |column: f64, row: f64| [(column + 0.5) * step_mm, (row + 0.5) * step_mm];
        let samples = self.samples as f64;
        Cavity {
            centre_mm: at(self.columns as f64 / samples, self.rows as f64 / samples),
            deepest_mm: at(f64::from(self.deepest.1), f64::from(self.deepest.0)),
            area_mm2: samples * step_mm * step_mm,
            depth_mm: f64::from(self.depth_mm),
            volume_mm3: volume_mm3(self.volume, step_mm),
            outline: self.shape.outline(step_mm),
            residuals_mm: self.residuals_mm.into_iter().map(f64::from).collect(),
        }
    }
}

fn volume_mm3(sum: i128, step_mm: f64) -> f64 {
    sum as f64 / SUM_UNITS_PER_MM * step_mm * step_mm
}

/// No region.
const NONE: u32 = u32::MAX;

/// The regions of one block by itself, and which of them lie along its four sides. Blocks can be labelled in
/// parallel; [`Cavities::add`] then joins them in order.
#[derive(Clone, Debug)]
pub struct Labelled {
    block: Window,
    regions: Vec<Region>,
    bottom: Vec<u32>,
    top: Vec<u32>,
    left: Vec<u32>,
    right: Vec<u32>,
}

/// Finds the regions of one block. `cavity` and each candidate cutter's residual (its closing less the design;
/// largest cutter first, none if not wanted) are in mm and cover the block. NaN is no cavity.
pub fn label(
    block: Window,
    cavity: &Heights,
    candidates: &[&Heights],
    params: &Params,
) -> Result<Labelled, Error> {
    covers("cavity", cavity, block)?;
    candidates.iter().try_for_each(|candidate| covers("candidate", candidate, block))?;
    let mut runs: Vec<Run> = Vec::new();
    let mut joined = Joined::default();
    let mut below = 0..0;
    for row in block.row..block.row_end() {
        let start = runs.len();
        runs_of(part_of_row(cavity, block, row), block.column, row, params.threshold_mm, &mut runs);
        joined.parents.extend(start as u32..runs.len() as u32);
        let mut low = below.start;
        for here in start..runs.len() {
            // Runs below that end left of this one can touch no later run either.
            while low < below.end && runs[low].end < runs[here].start {
                low += 1;
            }
            let touching = (low..below.end).take_while(|&under| runs[under].start <= runs[here].end);
            for under in touching {
                joined.join(under as u32, here as u32);
            }
        }
        below = start..runs.len();
    }

    let mut labelled = Labelled {
        block,
        regions: Vec::new(),
        bottom: vec![NONE; block.columns],
        top: vec![NONE; block.columns],
        left: vec![NONE; block.rows],
        right: vec![NONE; block.rows],
    };
    let mut region_of_root = vec![NONE; runs.len()];
    for (index, &run) in runs.iter().enumerate() {
        let root = joined.root(index as u32) as usize;
        let region = measure(run, block, cavity, candidates);
        if region_of_root[root] == NONE {
            region_of_root[root] = labelled.regions.len() as u32;
            labelled.regions.push(region);
        } else {
            labelled.regions[region_of_root[root] as usize].absorb(region);
        }
        labelled.mark_sides(run, region_of_root[root]);
    }
    labelled.regions.iter_mut().for_each(|region| region.bound_shape(params));
    Ok(labelled)
}

fn runs_of(depths_mm: &[f32], column: i64, row: i64, threshold_mm: f64, runs: &mut Vec<Run>) {
    let mut i = 0;
    let deep = |i: usize| f64::from(depths_mm[i]) > threshold_mm;
    while i < depths_mm.len() {
        if !deep(i) {
            i += 1;
            continue;
        }
        let start = i;
        while i < depths_mm.len() && deep(i) {
            i += 1;
        }
        let at = |i: usize| (column + i as i64) as i32;
        runs.push(Run { row: row as i32, start: at(start), end: at(i) });
    }
}

fn measure(run: Run, block: Window, cavity: &Heights, candidates: &[&Heights]) -> Region {
    let range = (i64::from(run.start) - block.column) as usize..(i64::from(run.end) - block.column) as usize;
    let row = i64::from(run.row);
    let depths_mm = &part_of_row(cavity, block, row)[range.clone()];
    let (mut depth_mm, mut deepest) = (0.0, run.start);
    for (column, &depth) in (run.start..).zip(depths_mm) {
        if depth > depth_mm {
            (depth_mm, deepest) = (depth, column);
        }
    }
    let samples = depths_mm.len() as i64;
    let most = |heights: &&Heights| {
        part_of_row(heights, block, row)[range.clone()].iter().fold(0.0, |a: f32, &b| a.max(b))
    };
    Region {
        first: (run.row, run.start),
        samples: samples as u64,
        volume: depths_mm.iter().map(|&depth| i128::from(to_sum(f64::from(depth)))).sum(),
        columns: samples * (i64::from(run.start) + i64::from(run.end) - 1) / 2,
        rows: samples * row,
        depth_mm,
        deepest: (run.row, deepest),
        residuals_mm: candidates.iter().map(most).collect(),
        shape: Shape::Runs(vec![run]),
    }
}

impl Labelled {
    fn mark_sides(&mut self, run: Run, region: u32) {
        let row = (i64::from(run.row) - self.block.row) as usize;
        let start = (i64::from(run.start) - self.block.column) as usize;
        let end = (i64::from(run.end) - self.block.column) as usize;
        if row == 0 {
            self.bottom[start..end].fill(region);
        }
        if row + 1 == self.block.rows {
            self.top[start..end].fill(region);
        }
        if start == 0 {
            self.left[row] = region;
        }
        if end == self.block.columns {
            self.right[row] = region;
        }
    }
}

/// Disjoint sets; the lower number is the root.
#[derive(Clone, Debug, Default)]
struct Joined {
    parents: Vec<u32>,
}

impl Joined {
    fn root(&mut self, mut of: u32) -> u32 {
        while self.parents[of as usize] != of {
            self.parents[of as usize] = self.parents[self.parents[of as usize] as usize];
            of = self.parents[of as usize];
        }
        of
    }

    fn join(&mut self, a: u32, b: u32) -> (u32, u32) {
        let (a, b) = (self.root(a), self.root(b));
        let (root, leaf) = (a.min(b), a.max(b));
        self.parents[leaf as usize] = root;
        (root, leaf)
    }
}

/// A region ordered by volume; equal ones by where they begin.
#[derive(Debug)]
struct Ranked(Region);

impl Ranked {
    fn key(&self) -> (i128, Reverse<(i32, i32)>) {
        (self.0.volume, Reverse(self.0.first))
    }
}

impl PartialEq for Ranked {
    fn eq(&self, other: &Ranked) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Ranked {}

impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Ranked) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Ranked {
    fn cmp(&self, other: &Ranked) -> std::cmp::Ordering {
        self.key().cmp(&other.key())
    }
}

/// Joins labelled blocks of one tile into cavities. Memory grows with the tile's width and what is kept, not with
/// the number of regions: a region is closed as soon as the row of blocks above cannot touch it.
#[derive(Debug)]
pub struct Cavities {
    params: Params,
    tile: Window,
    next: (i64, i64),
    row_height: usize,
    joined: Joined,
    open: Vec<Option<Region>>,
    below: Vec<u32>,
    above: Vec<u32>,
    left: Vec<u32>,
    kept: BinaryHeap<Reverse<Ranked>>,
    count: u64,
    samples: u64,
    volume: i128,
}

impl Cavities {
    /// None yet, of a tile whose blocks will come row by row, lowest y first.
    pub fn new(params: Params, tile: Window) -> Cavities {
        Cavities {
            params,
            tile,
            next: (tile.column, tile.row),
            row_height: 0,
            joined: Joined::default(),
            open: Vec::new(),
            below: vec![NONE; tile.columns],
            above: vec![NONE; tile.columns],
            left: Vec::new(),
            kept: BinaryHeap::new(),
            count: 0,
            samples: 0,
            volume: 0,
        }
    }

    /// Joins the next block to those before it.
    pub fn add(&mut self, labelled: Labelled) -> Result<(), Error> {
        let block = labelled.block;
        let begins_row = self.next.0 == self.tile.column;
        let fits = (block.column, block.row) == self.next
            && block.column_end() <= self.tile.column_end()
            && (begins_row || block.rows == self.row_height);
        if !fits {
            let (wanted_column, wanted_row) = self.next;
            return Err(Error::Order { column: block.column, row: block.row, wanted_column, wanted_row });
        }
        if begins_row {
            self.row_height = block.rows;
            self.left = vec![NONE; block.rows];
        }

        let mut on_side = vec![false; labelled.regions.len()];
        for side in [&labelled.bottom, &labelled.top, &labelled.left, &labelled.right] {
            side.iter().filter(|&&label| label != NONE).for_each(|&label| on_side[label as usize] = true);
        }
        let mut numbers = Vec::with_capacity(labelled.regions.len());
        for (region, &on_side) in labelled.regions.into_iter().zip(&on_side) {
            if on_side {
                numbers.push(self.open.len() as u32);
                self.joined.parents.push(self.open.len() as u32);
                self.open.push(Some(region));
            } else {
                numbers.push(NONE);
                self.close(region);
            }
        }
        let number = |label: u32| if label == NONE { NONE } else { numbers[label as usize] };

        let offset = (block.column - self.tile.column) as usize;
        for (i, &label) in labelled.bottom.iter().enumerate() {
            self.touch(number(label), offset + i, |cavities| &cavities.below);
        }
        for (i, &label) in labelled.left.iter().enumerate() {
            self.touch(number(label), i, |cavities| &cavities.left);
        }
        for (above, &label) in self.above[offset..].iter_mut().zip(&labelled.top) {
            *above = number(label);
        }
        self.left = labelled.right.iter().map(|&label| number(label)).collect();
        self.next = (block.column_end(), block.row);
        if block.column_end() == self.tile.column_end() {
            self.next = (self.tile.column, block.row_end());
            self.end_row();
        }
        Ok(())
    }

    /// Joins region `number` with those of a line of samples at `at` and its two neighbours.
    fn touch(&mut self, number: u32, at: usize, line: impl Fn(&Cavities) -> &Vec<u32>) {
        if number == NONE {
            return;
        }
        for beside in at.saturating_sub(1)..=at + 1 {
            let Some(&other) = line(self).get(beside).filter(|&&other| other != NONE) else { continue };
            let (root, leaf) = self.joined.join(number, other);
            if root != leaf {
                let leaf = self.open[leaf as usize].take();
                if let (Some(root), Some(leaf)) = (self.open[root as usize].as_mut(), leaf) {
                    root.absorb(leaf);
                    root.bound_shape(&self.params);
                }
            }
        }
    }

    /// Closes what does not lie along the upper side of the row of blocks just ended, renumbers the rest.
    fn end_row(&mut self) {
        let mut renumbered = vec![NONE; self.open.len()];
        let mut open = Vec::new();
        for label in self.above.iter_mut().filter(|label| **label != NONE) {
            let root = self.joined.root(*label) as usize;
            if renumbered[root] == NONE {
                renumbered[root] = open.len() as u32;
                open.push(self.open[root].take());
            }
            *label = renumbered[root];
        }
        for region in std::mem::replace(&mut self.open, open).into_iter().flatten() {
            self.close(region);
        }
        self.joined.parents = (0..self.open.len() as u32).collect();
        std::mem::swap(&mut self.below, &mut self.above);
        self.above.fill(NONE);
    }

    fn close(&mut self, region: Region) {
        self.count += 1;
        self.samples += region.samples;
        self.volume += region.volume;
        self.kept.push(Reverse(Ranked(region)));
        if self.kept.len() > self.params.keep {
            self.kept.pop();
        }
    }

    /// The cavities of all blocks so far.
    pub fn finish(mut self) -> Found {
        for region in std::mem::take(&mut self.open).into_iter().flatten() {
            self.close(region);
        }
        let step_mm = self.params.step_mm;
        let kept = self.kept.into_sorted_vec();
        Found {
            cavities: kept
                .into_par_iter()
                .map(|Reverse(Ranked(region))| region.finish(&self.params))
                .collect(),
            count: self.count,
            area_mm2: self.samples as f64 * step_mm * step_mm,
            volume_mm3: volume_mm3(self.volume, step_mm),
        }
    }
}
