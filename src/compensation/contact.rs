//! Contacts only: of all samples under a cutter, those that can touch it.
//!
//! If sample y is the contact of the cutter at x, d = y - x, then for every neighbour u with
//! d + u under the cutter h(y) + s(d) >= h(y + u) + s(d + u), so s(d) - s(d + u) >= h(y + u) - h(y):
//! the known rise to a neighbour bounds d, because s is concave. A pair (y, d) that breaks the
//! inequality on the table's own values loses to its neighbour strictly, and the chain of such
//! losses ends at a pair that is kept, so the maximum over the kept pairs is the maximum over
//! all, to the bit. (The raster form of the contact-point search of Lou, Jiang and Scott,
//! Proc. R. Soc. A 469 (2013) 20130150.)
//!
//! A block on one facet has one box of offsets, of an entry or two. Where a block has an edge in
//! it, its samples have their own; most fall into the two boxes of the facets beside, and those on
//! the edge are left, with boxes as long as the arc over which the ball rolls around it.

use super::Profile;
use super::ball::{Ball, Reachable};
use super::blocks::{Block, Lanes, ROWS};
use super::cones::Cones;
use super::feed::Feed;
use super::field::{Field, Targets};
use super::lanes::{Vectors, widest};
use super::listed::Listed;
use super::pairs::Pairs;
use super::patches::Patch;
use super::rolling::Rolling;
use super::search::{Progress, search};
use super::slopes::Rises;
use super::unboxed;

/// What raising targets by blocks of one facet costs besides, in groups of lanes.
pub(super) const BLOCK_WORK: usize = 60;

/// What bounding a row of samples one by one costs.
pub(super) const ROW_WORK: usize = 90;

/// Samples of a block that share offsets, at least, for these to be looked for.
pub(super) const MANY: u32 = 12;

/// How it is told where samples can touch one kind of cutter.
pub(super) trait Touch<V: Vectors, P: Pairs> {
    /// Offsets at which all samples with the same rises can touch.
    type At: Copy;

    /// How far the rises of a block that is taken at once may differ, in those that are alike, and where it has no edge.
    const SPREAD: f32;
    const EVEN_SPREAD: f32;

    fn nowhere(&self) -> Self::At;

    /// Those of samples with these rises, if they are few, and whether they are so few that samples share a facet. More
    /// are few where the surface bends evenly, for then all samples touch.
    fn few(&self, rises: &Rises, is_even: bool) -> Option<(Self::At, bool)>;

    /// Offsets along y, at least, at which samples with these rises can touch.
    fn rows(&self, rises: &Rises) -> [f64; 2];

    /// Raises the targets by samples that share offsets; gives what work it was.
    fn raise(&mut self, on: On<'_, P>, patch: Patch, at: &Self::At, out: &mut Targets) -> usize;

    /// Raises the targets by a block that lies beside all of them; gives what work it was, and the samples that are
    /// left. None, and nothing done, if it does not lie there.
    fn beside(
        &mut self,
        _: &On<'_, P>,
        _: Block,
        _: &Rises,
        _: &mut Lanes,
        _: &mut Targets,
    ) -> Option<(usize, [u16; ROWS])> {
        None
    }

    /// Raises the targets by samples of a block that share nothing.
    fn rest(
        &mut self,
        on: On<'_, P>,
        block: Block,
        lanes: &Lanes,
        left: &[u16; ROWS],
        out: &mut Targets,
    ) -> usize;
}

/// Samples and what they are paired with.
pub(super) struct On<'a, P: Pairs> {
    pub field: &'a Field,
    pub pairs: &'a P,
}

impl<P: Pairs> Clone for On<'_, P> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<P: Pairs> Copy for On<'_, P> {}

widest! {
    /// Raises the targets by every sample of the field that can touch a ball there, or sets
    /// `given_up` because it is more work than `most`, in groups of lanes.
    fn contacts<P: Pairs>(field: &mut Field, pairs: &P, profile: &Profile, out: &mut Targets, fed: Option<(&mut Feed<'_, '_>, &mut Progress<Reachable>)>, most: f64, given_up: &mut bool) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(
    field: &mut Field,
    pairs: &P,
    profile: &Profile,
    out: &mut Targets,
    fed: Option<(&mut Feed<'_, '_>, &mut Progress<Reachable>)>,
    most: f64,
    given_up: &mut bool,
) {
    let ball = Ball { radius: profile.radius(), step_mm: profile.step_mm(), slack_mm: pairs.slack_mm() };
    if !pairs.is_lattice() {
        *given_up = !unboxed::contacts::<V, P>(field, pairs, &ball, most, out);
        return;
    }
    let rolling = Rolling::<V>::new(ball, pairs.is_whole());
    // One call, for all of the search is compiled into it.
    let mut anew = Progress::new();
    let (feed, progress) = match fed {
        Some((feed, progress)) => (Some(feed), progress),
        None => (None, &mut anew),
    };
    *given_up = !search(rolling, profile, field, pairs, out, feed, progress, most);
    V::streamed();
}

widest! {
    /// As [`contacts`], of any cutter on samples, by a table; the samples under its flat bottom are left out.
    fn contacts_by_table<P: Pairs>(field: &mut Field, pairs: &P, cones: &Cones, out: &mut Targets, most: f64, given_up: &mut bool) = body_by_table
}

#[inline(always)]
pub(super) fn body_by_table<V: Vectors, P: Pairs>(
    field: &mut Field,
    pairs: &P,
    cones: &Cones,
    out: &mut Targets,
    most: f64,
    given_up: &mut bool,
) {
    let (listed, progress) = (Listed::<V>::new(cones), &mut Progress::new());
    *given_up = !search(listed, &cones.profile, field, pairs, out, None, progress, most);
}
