use super::ball::FARTHEST;
use super::blocks::ROWS;
use super::field::{Field, Sense, Targets};
use super::held::Rows;
use super::lanes::Vectors;
use super::outlet::{Outlet, with_data};
use super::pairs::OnSamples;
use crate::grid::Window;

/// How far a field was fed: rows taken, and targets given.
#[derive(Debug)]
pub(super) struct Fed {
    taken: i64,
    given: usize,
    /// Samples with data at the targets in rows that were taken and not given yet, where they are counted; they go round.
    samples: Vec<u32>,
}

/// Samples that will be taken soon: reading them from memory goes on beside the search.
#[derive(Clone, Copy)]
pub(super) struct Ahead<'a> {
    rows: [&'a [f32]; ROWS],
    /// Where column 0 of the field stands in them.
    shift: i64,
}

impl Ahead<'_> {
    /// Asks for those above a block, which begins at this column.
    #[inline(always)]
    pub fn fetch<V: Vectors>(&self, first: usize) {
        let i = (first as i64 + self.shift) as usize;
        for row in self.rows {
            if let Some(z) = row.get(i) {
                V::fetch(z);
            }
        }
    }
}

/// Takes rows into a field shortly before they are looked at, and gives those targets that nothing
/// raises any more: both stay in a core's cache however tall they are.
pub(super) struct Feed<'a, 'b> {
    h: Rows<'a>,
    input: Window,
    sense: Sense,
    reach: i64,
    every: i64,
    /// Row and column of the field at which target 0 stands.
    level: i64,
    column: i64,
    /// Where those from `first` on go.
    to: &'a mut [Outlet<'b>],
    first: usize,
    /// Whether they are too many for a core's cache.
    is_large: bool,
    /// Whether samples are counted as they are taken, while they are in the nearest cache.
    is_counted: bool,
    pub fed: Fed,
}

impl<'a, 'b> Feed<'a, 'b> {
    /// Makes field and targets ready.
    pub fn new(
        h: Rows<'a>,
        input: Window,
        sense: Sense,
        on: &OnSamples,
        to: &'a mut [Outlet<'b>],
        field: &mut Field,
        targets: &mut Targets,
    ) -> Feed<'a, 'b> {
        let far = FARTHEST.min(on.reach as usize) + 1;
        field.hold(input, ROWS + 2 * far);
        let columns = to.first().map_or(0, Outlet::columns);
        targets.hold(columns, on.target_rows, (ROWS + 2 * on.reach as usize) / on.every as usize + 2);
        let held = (2 * (on.reach as usize + ROWS + far)).next_power_of_two();
        let fed = Fed { taken: -1, given: 0, samples: vec![0; held] };
        Feed::again(h, input, sense, on, to, 0, fed)
    }

    /// Goes on where field and targets were left, at the target `first`. `h` has all rows that were not taken.
    pub fn again(
        h: Rows<'a>,
        input: Window,
        sense: Sense,
        on: &OnSamples,
        to: &'a mut [Outlet<'b>],
        first: usize,
        fed: Fed,
    ) -> Feed<'a, 'b> {
        let level = on.target_row - on.input_row;
        let is_large = Outlet::are_many(to);
        let (reach, every, column) = (on.reach, on.every, on.shift);
        let is_counted = to.first().is_some_and(Outlet::counts_samples);
        Feed { h, input, sense, reach, every, level, column, to, first, is_large, is_counted, fed }
    }

    /// Whether all targets that are wanted are given.
    #[inline(always)]
    pub fn is_done(&self) -> bool {
        self.fed.given == self.first + self.to.len()
    }

    /// The row of the field after the last one that raises a target that is wanted.
    pub fn end_row(&self) -> i64 {
        self.level + (self.first + self.to.len()) as i64 * self.every - self.every + self.reach + 1
    }

    /// Takes the samples that these rows of the field are looked at with.
    #[inline(always)]
    pub fn before<V: Vectors>(&mut self, a: i64, rows: usize, field: &mut Field) {
        let far = FARTHEST.min(self.reach as usize) as i64 + 1;
        let end = a + rows as i64;
        while self.fed.taken < end + far && self.fed.taken <= self.input.rows as i64 {
            field.take(self.fed.taken, self.h, self.input, self.sense);
            if self.is_counted {
                let place = self.fed.taken as usize & (self.fed.samples.len() - 1);
                self.fed.samples[place] = self.count::<V>(self.fed.taken);
            }
            self.fed.taken += 1;
        }
    }

    /// Samples with data at the targets in a row of the field.
    #[inline(always)]
    fn count<V: Vectors>(&self, row: i64) -> u32 {
        let columns = self.to.first().map_or(0, Outlet::columns);
        let at =
            Window { column: self.input.column + self.column, row: self.input.row + row, columns, rows: 1 };
        self.h.window.intersection(&at).map_or(0, |at| {
            let first = (at.column - self.h.window.column) as usize;
            with_data::<V>(&self.h.row(at.row)[first..][..at.columns])
        })
    }

    /// The rows that [`Feed::before`] takes next.
    #[inline(always)]
    pub fn ahead(&self) -> Ahead<'a> {
        let (h, next) = (self.h, self.input.row + self.fed.taken);
        let rows = std::array::from_fn(|k| {
            let row = next + k as i64;
            if row >= h.window.row && row < h.window.row_end() { h.row(row) } else { &[] }
        });
        Ahead { rows, shift: self.input.column - h.window.column }
    }

    /// Gives the targets that rows from `a` on cannot reach.
    #[inline(always)]
    pub fn after<V: Vectors>(&mut self, a: i64, targets: &mut Targets) {
        while !self.is_done() && self.level + (self.fed.given as i64) * self.every + self.reach < a {
            self.give::<V>(targets);
        }
    }

    /// Gives all that is left.
    #[inline(always)]
    pub fn end<V: Vectors>(&mut self, targets: &mut Targets) {
        while !self.is_done() {
            self.give::<V>(targets);
        }
    }

    #[inline(always)]
    fn give<V: Vectors>(&mut self, targets: &mut Targets) {
        targets.open(self.fed.given + 1);
        let row = &mut self.to[self.fed.given - self.first];
        if self.is_counted {
            let at = self.level + self.fed.given as i64 * self.every;
            row.counted(self.fed.samples[at as usize & (self.fed.samples.len() - 1)]);
        }
        row.give::<V>(self.sense, targets.row(self.fed.given), self.is_large);
        targets.close();
        self.fed.given += 1;
    }
}
