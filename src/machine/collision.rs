//! A tool along its straight motions against clamps and other boxes.
//!
//! A tool is a stack of upright cylinders that widen towards the spindle, so each may be taken to reach up
//! for ever. Over a box it is then free as long as its lower end stays above the box's top, or as long as
//! its axis stays further than its radius from the box seen from above: the box grown by the radius, with
//! round corners, is convex, so a straight motion is over it for one stretch, and lowest at an end of that.

use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Vector;

use super::{Bounds, Cylinder, Obstacle};

/// Motions under one box of the first, coarse test.
const CHUNK: usize = 64;

/// A tool and what it has to keep clear of.
#[derive(Clone, Debug)]
pub struct Guard {
    /// In the setup's frame: the program's X and Y, z above the stock's top.
    obstacles: Vec<Obstacle>,
    /// From the cutter up.
    columns: Vec<Cylinder>,
}

/// Where a tool first meets a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Met {
    /// Which of the motions.
    pub motion: usize,
    /// "cutter", "shank" or "holder".
    pub what: &'static str,
    pub obstacle: String,
    /// The box's top above the stock's.
    pub top_mm: f64,
    /// How far that part of the tool goes below the top.
    pub below_mm: f64,
    /// Tip of the tool there.
    pub at_mm: [f64; 3],
}

impl Guard {
    /// `columns` as [`super::Tool::columns`] gives them.
    pub fn new(obstacles: &[Obstacle], columns: Vec<Cylinder>) -> Guard {
        Guard { obstacles: obstacles.to_vec(), columns }
    }

    /// The highest box above the stock's top; None where there is none.
    pub fn highest_mm(&self) -> Option<f64> {
        self.obstacles.iter().map(|o| o.bounds.high_mm[2]).reduce(f64::max)
    }

    /// Whether the tool, `spare_mm` wider and longer than it is, meets a box on its way from one place of its tip
    /// to another.
    pub fn meets(&self, from: [f64; 3], to: [f64; 3], spare_mm: f64) -> bool {
        self.obstacles.iter().any(|obstacle| {
            self.columns.iter().any(|column| met(from, to, column, &obstacle.bounds, spare_mm).is_some())
        })
    }

    /// The first of `count` motions that meets a box; `place` gives where the tip is after each. A place that is not
    /// known (NaN) is left out, and so is the way to it and from it.
    pub fn first_met(&self, count: usize, place: impl Fn(usize) -> [f64; 3]) -> Option<Met> {
        if self.obstacles.is_empty() {
            return None;
        }
        let radius = self.columns.iter().map(|column| column.radius_mm).fold(0.0, f64::max);
        let known = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
        for first in (0..count).step_by(CHUNK) {
            let end = (first + CHUNK).min(count);
            // With the end of the chunk before, where its first motion begins.
            let chunk = (first.saturating_sub(1)..end).map(&place);
            let Some(around) = bounds(chunk.filter(known), radius) else { continue };
            let near: Vec<&Obstacle> =
                self.obstacles.iter().filter(|o| around.intersects(&aabb(&o.bounds))).collect();
            if near.is_empty() {
                continue;
            }
            for motion in first..end {
                let to = place(motion);
                let before = motion.checked_sub(1).map_or(to, &place);
                let from = if known(&before) { before } else { to };
                if !known(&to) {
                    continue;
                }
                if let Some(met) = self.met_at(&near, motion, from, to) {
                    return Some(met);
                }
            }
        }
        None
    }

    fn met_at(&self, near: &[&Obstacle], motion: usize, from: [f64; 3], to: [f64; 3]) -> Option<Met> {
        for obstacle in near {
            for column in &self.columns {
                if let Some(at_mm) = met(from, to, column, &obstacle.bounds, 0.0) {
                    let top_mm = obstacle.bounds.high_mm[2];
                    return Some(Met {
                        motion,
                        what: column.what,
                        obstacle: obstacle.name.clone(),
                        top_mm,
                        below_mm: top_mm - at_mm[2] - column.from_mm,
                        at_mm,
                    });
                }
            }
        }
        None
    }
}

/// The lowest place of the tip on its way from one place to another while the cylinder is over the box, if its lower
/// end is below the box's top there.
fn met(
    from: [f64; 3],
    to: [f64; 3],
    column: &Cylinder,
    obstacle: &Bounds,
    spare_mm: f64,
) -> Option<[f64; 3]> {
    let free_mm = obstacle.high_mm[2] - column.from_mm + spare_mm;
    if from[2].min(to[2]) >= free_mm {
        return None;
    }
    let [enters, leaves] = over(from, to, column.radius_mm + spare_mm, obstacle)?;
    let t = if to[2] < from[2] { leaves } else { enters };
    let at = std::array::from_fn(|axis| from[axis] + t * (to[axis] - from[axis]));
    (at[2] < free_mm).then_some(at)
}

/// The stretch of a motion, in parts of it, that passes within `radius` of a box seen from above.
///
/// The distance to a convex shape is convex along a line, so the stretch is one. The grown box is the union of the
/// box grown in X, the box grown in Y and a disc at each corner; all overlap or touch.
fn over(from: [f64; 3], to: [f64; 3], radius: f64, obstacle: &Bounds) -> Option<[f64; 2]> {
    let (low, high) = (obstacle.low_mm, obstacle.high_mm);
    let along = [to[0] - from[0], to[1] - from[1]];
    let slab = |grow: [f64; 2]| {
        let mut stretch = [0.0f64, 1.0f64];
        for axis in 0..2 {
            let (below, above) = (low[axis] - grow[axis] - from[axis], high[axis] + grow[axis] - from[axis]);
            if along[axis] == 0.0 {
                if below > 0.0 || above < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (below / along[axis], above / along[axis]);
            stretch = [stretch[0].max(a.min(b)), stretch[1].min(a.max(b))];
        }
        (stretch[0] <= stretch[1]).then_some(stretch)
    };
    let disc = |corner: [f64; 2]| {
        let (dx, dy) = (from[0] - corner[0], from[1] - corner[1]);
        let c = dx * dx + dy * dy - radius * radius;
        let a = along[0] * along[0] + along[1] * along[1];
        if a == 0.0 {
            return (c <= 0.0).then_some([0.0, 1.0]);
        }
        let b = along[0] * dx + along[1] * dy;
        let root = b * b - a * c;
        if root < 0.0 {
            return None;
        }
        let root = root.sqrt();
        let stretch = [((-b - root) / a).max(0.0), ((-b + root) / a).min(1.0)];
        (stretch[0] <= stretch[1]).then_some(stretch)
    };
    [
        slab([radius, 0.0]),
        slab([0.0, radius]),
        disc([low[0], low[1]]),
        disc([high[0], low[1]]),
        disc([low[0], high[1]]),
        disc([high[0], high[1]]),
    ]
    .into_iter()
    .flatten()
    .reduce(|all, one| [all[0].min(one[0]), all[1].max(one[1])])
}

/// In single precision, and a hair larger for it.
fn aabb(bounds: &Bounds) -> Aabb {
    let corner = |c: [f64; 3]| Vector::new(c[0] as f32, c[1] as f32, c[2] as f32);
    Aabb::new(corner(bounds.low_mm), corner(bounds.high_mm)).loosened(1e-3)
}

/// The box of a tool of this radius with its tip at all of the places, without end upwards.
fn bounds(places: impl Iterator<Item = [f64; 3]>, radius: f64) -> Option<Aabb> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for place in places {
        for axis in 0..3 {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    if low[0] > high[0] {
        return None;
    }
    let low_mm = [low[0] - radius, low[1] - radius, low[2]];
    let high_mm = [high[0] + radius, high[1] + radius, high[2].max(0.0) + 1e5];
    Some(aabb(&Bounds { low_mm, high_mm }))
}

#[cfg(test)]
mod tests {
    use parry3d::math::Pose;
    use parry3d::query;
    use parry3d::shape::{Cuboid, Cylinder as Round};
    use proptest::prelude::*;

    use super::*;

    fn block() -> Obstacle {
        let bounds = Bounds { low_mm: [-4.0, -3.0, -20.0], high_mm: [4.0, 3.0, 8.0] };
        Obstacle { name: "block".into(), bounds }
    }

    /// parry's own distance between the cylinder and the box with the tip at a place; its cylinders stand along Y.
    fn distance(at: [f64; 3], column: &Cylinder, block: &Bounds) -> f32 {
        let half = 100.0;
        let round = Round::new(half, column.radius_mm as f32);
        let z = (at[2] + column.from_mm) as f32 + half;
        let half_size: [f32; 3] =
            std::array::from_fn(|axis| (0.5 * (block.high_mm[axis] - block.low_mm[axis])) as f32);
        let middle: [f32; 3] =
            std::array::from_fn(|axis| (0.5 * (block.high_mm[axis] + block.low_mm[axis])) as f32);
        let solid = Cuboid::new(Vector::new(half_size[0], half_size[2], half_size[1]));
        let stands = Pose::translation(at[0] as f32, z, at[1] as f32);
        let lies = Pose::translation(middle[0], middle[2], middle[1]);
        query::distance(&stands, &round, &lies, &solid).expect("both are convex").distance
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn a_motion_meets_a_box_where_parry_says_that_they_touch(
            from in prop::array::uniform3(-12.0..12.0f64), to in prop::array::uniform3(-12.0..12.0f64),
            radius_mm in 0.2..5.0f64, from_mm in 0.0..10.0f64
        ) {
            let column = Cylinder { what: "shank", radius_mm, from_mm };
            let guard = Guard::new(&[block()], vec![column]);
            let found = guard.first_met(2, |k| [from, to][k]);
            let least = (0..=200)
                .map(|k| f64::from(k) / 200.0)
                .map(|t| std::array::from_fn(|axis| from[axis] + t * (to[axis] - from[axis])))
                .map(|at| distance(at, &column, &block().bounds))
                .fold(f32::INFINITY, f32::min);
            match found {
                // A sampled way misses at most half of its 0.21 mm steps.
                Some(_) => prop_assert!(least < 0.12, "{least}"),
                None => prop_assert!(least > 0.0, "{least}"),
            }
        }
    }

    #[test]
    fn a_round_corner_is_passed_closer_than_a_square_one() {
        let column = Cylinder { what: "cutter", radius_mm: 2.0, from_mm: 0.0 };
        let guard = Guard::new(&[block()], vec![column]);
        // 1.5 mm past the corner in X and Y: 2.12 mm away.
        assert_eq!(guard.first_met(1, |_| [5.5, 4.5, 0.0]), None);
        let met = guard.first_met(2, |k| [[5.5, 4.5, 0.0], [5.3, 4.3, 0.0]][k]).expect("1.84 mm away");
        assert_eq!((met.motion, met.what, met.obstacle.as_str(), met.below_mm), (1, "cutter", "block", 8.0));
        // Over the top it is free, and with something to spare it is not.
        let (a, b) = ([-20.0, 0.0, 8.5], [20.0, 0.0, 8.5]);
        assert!(!guard.meets(a, b, 0.0) && guard.meets(a, b, 1.0));
        // A slope that comes below the top only past the box is free.
        assert!(!guard.meets([-20.0, 0.0, 9.0], [20.0, 0.0, 7.8], 0.0));
    }
}
