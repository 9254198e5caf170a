use super::ball::FARTHEST;
use super::blocks::ROWS;
use super::field::{Field, Sense, Targets};
use super::lanes::Vectors;
use super::pairs::OnSamples;
use crate::grid::{Heights, Window};

/// Bytes of targets that a core's cache may well hold until they are looked at.
const CACHE: usize = 1 << 20;

/// How far a field was fed: rows taken, and targets opened and given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fed {
    taken: i64,
    opened: usize,
    given: usize,
}

/// Takes rows into a field shortly before they are looked at, and gives those targets that nothing
/// raises any more: both stay in a core's cache however tall they are.
pub(super) struct Feed<'a, 'b> {
    h: &'a Heights,
    input: Window,
    sense: Sense,
    reach: i64,
    every: i64,
    /// Row of the field at whose height target 0 stands.
    level: i64,
    /// Targets there are in all.
    all: usize,
    /// Where those from `first` on go.
    to: &'a mut [&'b mut [f32]],
    first: usize,
    /// Whether they are too many for a core's cache.
    is_large: bool,
    pub fed: Fed,
}

impl<'a, 'b> Feed<'a, 'b> {
    /// Makes field and targets ready.
    pub fn new(
        h: &'a Heights,
        input: Window,
        sense: Sense,
        on: &OnSamples,
        to: &'a mut [&'b mut [f32]],
        field: &mut Field,
        targets: &mut Targets,
    ) -> Feed<'a, 'b> {
        let far = FARTHEST.min(on.reach as usize) + 1;
        field.hold(input, ROWS + 2 * far);
        let columns = to.first().map_or(0, |to| to.len());
        targets.hold(columns, on.target_rows, (ROWS + 2 * on.reach as usize) / on.every as usize + 2);
        let fed = Fed { taken: -1, opened: 0, given: 0 };
        Feed::again(h, input, sense, on, to, 0, fed)
    }

    /// Goes on where field and targets were left, at the target `first`. `h` has all rows that were not taken.
    pub fn again(
        h: &'a Heights,
        input: Window,
        sense: Sense,
        on: &OnSamples,
        to: &'a mut [&'b mut [f32]],
        first: usize,
        fed: Fed,
    ) -> Feed<'a, 'b> {
        let level = on.target_row - on.input_row;
        let is_large = to.iter().map(|to| size_of_val(&**to)).sum::<usize>() > CACHE;
        let (reach, every, all) = (on.reach, on.every, on.target_rows);
        Feed { h, input, sense, reach, every, level, all, to, first, is_large, fed }
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

    /// Takes the samples that these rows of the field are looked at with, and opens the targets
    /// that they may raise.
    #[inline(always)]
    pub fn before(&mut self, a: i64, rows: usize, field: &mut Field, targets: &mut Targets) {
        let far = FARTHEST.min(self.reach as usize) as i64 + 1;
        let end = a + rows as i64;
        while self.fed.taken < end + far && self.fed.taken <= self.input.rows as i64 {
            field.take(self.fed.taken, self.h, self.input, self.sense);
            self.fed.taken += 1;
        }
        while self.fed.opened < self.all
            && self.level + self.fed.opened as i64 * self.every < end + self.reach
        {
            targets.open(self.fed.opened);
            self.fed.opened += 1;
        }
    }

    /// Gives the targets that rows from `a` on cannot reach.
    #[inline(always)]
    pub fn after<V: Vectors>(&mut self, a: i64, targets: &mut Targets) {
        while self.fed.given < self.fed.opened
            && !self.is_done()
            && self.level + (self.fed.given as i64) * self.every + self.reach < a
        {
            self.give::<V>(targets);
        }
    }

    /// Gives all that is left.
    #[inline(always)]
    pub fn end<V: Vectors>(&mut self, targets: &mut Targets) {
        while !self.is_done() {
            if self.fed.given == self.fed.opened {
                targets.open(self.fed.opened);
                self.fed.opened += 1;
            }
            self.give::<V>(targets);
        }
    }

    #[inline(always)]
    fn give<V: Vectors>(&mut self, targets: &mut Targets) {
        let (to, from) = (&mut *self.to[self.fed.given - self.first], targets.row(self.fed.given));
        if self.is_large {
            self.sense.stream_row::<V>(to, from);
        } else {
            self.sense.give_row(to, from);
        }
        targets.close();
        self.fed.given += 1;
    }
}
