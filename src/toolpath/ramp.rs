//! The way down into solid metal: to and fro along the cut that follows, so that the cutter never drills.

use super::levels::{self, Profile};

/// A cut too short for this many ways out and back is entered straight down.
const MOST_TRIPS: i32 = 16;

/// Vertices from above the first point of `cut`, at height `above`, down to that point: out along the cut and
/// back, falling by `slope` and never below the cut. The last one is the cut's first point. Places and heights
/// are units, as in the cut.
///
/// Straight down where the slope is infinite, where there is nothing to go down, or where the cut is too short.
pub(super) fn ramp(cut: &[[i32; 2]], above: i32, slope: f64) -> Profile {
    let ([start, bottom], end) = (cut[0], cut[cut.len() - 1][0]);
    let drop = f64::from(above) - f64::from(bottom);
    let reach = f64::from(end) - f64::from(start);
    let way = drop / slope;
    let trips = (0.5 * way / reach.abs()).ceil();
    if !(drop > 0.0 && way >= 2.0 && trips >= 1.0 && trips <= f64::from(MOST_TRIPS)) {
        return vec![cut[0]];
    }
    let length = (0.5 * way / trips).ceil().min(reach.abs()) as i32;
    let out = start + if reach > 0.0 { length } else { -length };
    let legs = 2 * trips as i32;
    let height = |leg: i32| f64::from(above) - drop * f64::from(leg) / f64::from(legs);
    let mut vertices = Vec::new();
    for leg in 0..legs {
        let (from, to) = if leg % 2 == 0 { (start, out) } else { (out, start) };
        let (high, low) = (height(leg), height(leg + 1));
        let at = |u: i32| high + (low - high) * f64::from(u - from) / f64::from(to - from);
        // Between its vertices the cut is straight, so the higher of the two is nowhere above the chords.
        let passed = |u: &i32| (*u > from.min(to)) && (*u < from.max(to));
        let mut places: Vec<i32> = cut.iter().map(|vertex| vertex[0]).filter(passed).collect();
        if leg % 2 == 1 {
            places.reverse();
        }
        places.push(to);
        vertices.extend(places.into_iter().map(|u| [u, at(u).max(levels::at(cut, u)).ceil() as i32]));
    }
    if vertices.last() != Some(&cut[0]) {
        vertices.push(cut[0]);
    }
    vertices
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_long_level_cut_is_entered_in_one_way_out_and_back() {
        let cut = [[0, -300], [15_000, -300]];
        // 3 degrees: 300 units down over 5724 of way.
        let slope = 3f64.to_radians().tan();
        assert_eq!(ramp(&cut, 0, slope), [[2863, -150], [0, -300]]);
        assert_eq!(ramp(&[[15_000, -300], [0, -300]], 0, slope), [[12_137, -150], [15_000, -300]]);
        assert_eq!(ramp(&cut, 0, f64::INFINITY), [[0, -300]]);
        assert_eq!(ramp(&cut, -300, slope), [[0, -300]]);
    }

    #[test]
    fn a_short_cut_is_entered_to_and_fro() {
        let slope = 3f64.to_radians().tan();
        let down = ramp(&[[0, -300], [1000, -300]], 0, slope);
        assert_eq!(down, [[955, -50], [0, -100], [955, -150], [0, -200], [955, -250], [0, -300]]);
        assert_eq!(ramp(&[[0, -300], [100, -300]], 0, slope), [[0, -300]], "too short to ramp into");
    }

    proptest! {
        #[test]
        fn never_below_the_cut_nor_above_the_level_above_nor_too_steep(
            steps in proptest::collection::vec((1i32..4000, -300i32..=0), 2..12),
            degrees in 0.5f64..45.0,
            turned in any::<bool>(),
        ) {
            let mut u = 0;
            let mut cut: Vec<[i32; 2]> = steps.iter().map(|&(run, z)| { u += run; [u, z] }).collect();
            if turned { cut.reverse(); }
            let slope = degrees.to_radians().tan();
            let down = ramp(&cut, 0, slope);
            prop_assert_eq!(down[down.len() - 1], cut[0]);
            let mut from = [cut[0][0], 0];
            for to in down.into_iter().filter(|to| to[0] != cut[0][0] || to[1] != cut[0][1]) {
                for k in 0..=20 {
                    let t = f64::from(k) / 20.0;
                    let u = f64::from(from[0]) + t * f64::from(to[0] - from[0]);
                    let z = f64::from(from[1]) + t * f64::from(to[1] - from[1]);
                    let bound = levels::at(&cut, u.floor() as i32).min(levels::at(&cut, u.ceil() as i32));
                    prop_assert!(z >= bound - 1e-6 && z <= 1e-9, "{z} over {bound}");
                }
                from = to;
            }
        }
    }
}
