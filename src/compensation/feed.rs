use super::ball::FARTHEST;
use super::blocks::ROWS;
use super::field::{Field, Sense, Targets};
use super::pairs::OnSamples;
use crate::grid::{Heights, Window};

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
    /// Where the targets go.
    to: &'a mut [&'b mut [f32]],
    taken: i64,
    opened: usize,
    given: usize,
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
        targets.hold(columns, to.len(), (ROWS + 2 * on.reach as usize) / on.every as usize + 2);
        let level = on.target_row - on.input_row;
        Feed { h, input, sense, reach: on.reach, every: on.every, level, to, taken: -1, opened: 0, given: 0 }
    }

    /// Takes the samples that these rows of the field are looked at with, and opens the targets
    /// that they may raise.
    #[inline(always)]
    pub fn before(&mut self, a: i64, rows: usize, field: &mut Field, targets: &mut Targets) {
        let far = FARTHEST.min(self.reach as usize) as i64 + 1;
        let end = a + rows as i64;
        while self.taken < end + far && self.taken <= self.input.rows as i64 {
            field.take(self.taken, self.h, self.input, self.sense);
            self.taken += 1;
        }
        while self.opened < self.to.len() && self.level + self.opened as i64 * self.every < end + self.reach {
            targets.open(self.opened);
            self.opened += 1;
        }
    }

    /// Gives the targets that rows from `a` on cannot reach.
    #[inline(always)]
    pub fn after(&mut self, a: i64, targets: &mut Targets) {
        while self.given < self.opened && self.level + (self.given as i64) * self.every + self.reach < a {
            self.give(targets);
        }
    }

    /// Gives all that is left.
    #[inline(always)]
    pub fn end(&mut self, targets: &mut Targets) {
        while self.given < self.to.len() {
            if self.given == self.opened {
                targets.open(self.opened);
                self.opened += 1;
            }
            self.give(targets);
        }
    }

    #[inline(always)]
    fn give(&mut self, targets: &mut Targets) {
        self.sense.give_row(self.to[self.given], targets.row(self.given));
        targets.close();
        self.given += 1;
    }
}
