//! The ways in which positions are found, and which of them suits a cutter and a surface.

use super::cones::Cones;
use super::field::{Field, Targets};
use super::pairs::Pairs;
use super::{Profile, bounded, brute, chord, contact, folded};

/// Radius of a flat bottom, in samples, from which chords are less work than single samples.
const LEAST_CHORD: f64 = 2.0;

/// Radius of a ball, in samples, from which looking for contacts is less work than every sample with a sum of its own.
const LEAST_SEARCH: f64 = 4.0;

/// Sums by which a position is found by every sample, up to which that is less work than looking for contacts: so many,
/// and so many more for each row of samples from one row of positions to the next, for a search looks at all of these.
const FEW_SUMS: f64 = 12.0;
const FEW_SUMS_A_ROW: f64 = 24.0;

/// Work for a sample, in groups of lanes, from which leaving out by maxima is faster than looking for contacts by a
/// table, as on surfaces that touch a flat bottom's rim nearly everywhere; and as part of taking every sample, where
/// that is more.
const LISTED: f64 = 100.0;
const LISTED_PART: f64 = 0.03;

/// How contacts are found; only balls have more than two ways.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// By whichever of the others is less work on the surface at hand.
    Known,
    EveryTap,
    Contacts,
}

/// Whether contacts are looked for.
fn is_searched(profile: &Profile) -> bool {
    profile.is_ball() && profile.radius() >= LEAST_SEARCH
}

/// The same for positions on samples, in every `every`-th row.
pub(super) fn is_searched_on_samples(profile: &Profile, every: usize, way: Way) -> bool {
    let few = FEW_SUMS + FEW_SUMS_A_ROW * every as f64;
    is_searched(profile)
        && match way {
            Way::Known => folded::sums(profile) > few,
            Way::EveryTap => false,
            Way::Contacts => true,
        }
}

/// Whether positions on samples, where no contacts are looked for, are found by sums that samples share.
pub(super) fn is_folded(profile: &Profile, way: Way) -> bool {
    profile.plateau_mm() < profile.radius_mm() && leaves_nothing_out(profile, way)
}

/// Whether every sample is taken where no contacts are looked for. Where looking for a ball's is too much work, maxima
/// leave nothing out either.
fn leaves_nothing_out(profile: &Profile, way: Way) -> bool {
    profile.is_ball() || profile.radius() < bounded::LEAST_RADIUS || way == Way::EveryTap
}

/// Whether a flat bottom is taken chord by chord.
pub(super) fn has_chords(profile: &Profile) -> bool {
    profile.plateau_mm() / profile.step_mm() >= LEAST_CHORD
}

/// Whether a table tells where samples can touch.
pub(super) fn has_table(profile: &Profile, way: Way) -> bool {
    !profile.is_ball()
        && profile.plateau_mm() < profile.radius_mm()
        && profile.radius() >= bounded::LEAST_RADIUS
        && way != Way::EveryTap
}

/// Raises the targets by the field, by whichever way suits the profile.
pub(super) fn dilate<P: Pairs>(field: &mut Field, pairs: &P, profile: &Profile, targets: &mut Targets) {
    if is_searched(profile) {
        let most = brute::work(profile, targets.columns, targets.rows);
        let mut given_up = false;
        contact::contacts(field, pairs, profile, targets, None, most, &mut given_up);
        if !given_up {
            return;
        }
    }
    without_search(field, pairs, profile, None, targets, Way::Known);
}

/// Raises the targets without a search by a ball's boxes.
pub(super) fn without_search<P: Pairs>(
    field: &mut Field,
    pairs: &P,
    profile: &Profile,
    cones: Option<&Cones>,
    targets: &mut Targets,
    way: Way,
) {
    let chords = has_chords(profile);
    if chords {
        chord::flat_bottom(field, pairs, targets, profile.plateau_mm() / profile.step_mm() + 1.0, None);
        if profile.plateau_mm() >= profile.radius_mm() {
            return;
        }
    }
    if let (Some(cones), Some(pairs)) = (cones, pairs.on_samples()) {
        let most = match way {
            Way::Contacts => f64::INFINITY,
            _ => {
                let every_tap = brute::work(profile, targets.columns, targets.rows);
                every_tap.min((LISTED * (targets.columns * targets.rows) as f64).max(LISTED_PART * every_tap))
            }
        };
        let mut given_up = false;
        contact::contacts_by_table(field, pairs, cones, targets, most, &mut given_up);
        if !given_up {
            return;
        }
    }
    if leaves_nothing_out(profile, way) {
        brute::every_tap(field, pairs, chords, targets);
    } else {
        bounded::bounded(field, pairs, chords, targets);
    }
}
