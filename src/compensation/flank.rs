//! Samples beside all positions that they could be under: past the edges of a part, where the locations of a ball that
//! rolls over them fall off, and between the strips that a part is taken in.

use super::ball::Reachable;
use super::blocks::{Block, Lanes, ROWS};
use super::bundle::raise_bundle;
use super::contact::{BLOCK_WORK, ROW_WORK};
use super::field::{Field, Targets};
use super::lanes::{Vectors, Work};
use super::pairs::OnSamples;
use super::rolling::Rolling;
use super::runs::Offsets;
use super::slopes::Rises;

/// Offsets of a block, at most, for all its samples to be taken by the rises of the block, and by their own.
const AT_ONCE: usize = 200;
const BUNDLED: usize = 1200;

/// A block beside the targets, of which samples within these offsets reach any.
pub(super) struct Flank<'a, 'b, V: Vectors> {
    pub rolling: &'a mut Rolling<V>,
    pub field: &'a Field,
    pub on: &'a OnSamples<'b>,
    pub block: Block,
    pub rises: &'a Rises,
    pub within: Reachable,
    pub lanes: &'a mut Lanes,
    pub out: &'a mut Targets,
}

impl<V: Vectors> Work<V> for Flank<'_, '_, V> {
    /// What work it was, and the samples that are left.
    type Done = (usize, [u16; ROWS]);

    #[inline(always)]
    fn run(self) -> (usize, [u16; ROWS]) {
        let Flank { rolling, field, on, block, rises, within, lanes, out } = self;
        let none = [0; ROWS];
        let within = rolling.ball.under(&within);
        let Some(at) = rolling.ball.reachable_within(rises, &within) else { return (0, none) };
        let offsets = Offsets::of(&at);
        if offsets.taps() <= AT_ONCE && raise_bundle::<V>(field, on, block, &[u16::MAX; ROWS], &offsets, out)
        {
            return (BLOCK_WORK.max(offsets.taps() * ROWS), none);
        }
        lanes.fill::<V>(field, block);
        let boxes = &mut rolling.boxes;
        boxes.bounded = 0;
        boxes.fill(lanes, &lanes.data, &rolling.ball, &rolling.moderate, rolling.whole);
        let work = boxes.bounded * ROW_WORK;
        let these = boxes.overlapping(&within);
        if these == none {
            return (work, none);
        }
        let offsets = Offsets::of(&boxes.hull(&these).and(&within));
        if offsets.taps() <= BUNDLED && raise_bundle::<V>(field, on, block, &these, &offsets, out) {
            (work + BLOCK_WORK.max(offsets.taps() * ROWS), none)
        } else {
            (work, these)
        }
    }
}
