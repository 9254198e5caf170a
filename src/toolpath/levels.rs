//! One row of roughing, cut at a level.

/// A polyline along a row: place and height of each vertex in units, places rising.
pub(super) type Profile = Vec<[i32; 2]>;

/// The cuts of a row between the level above and this one: the row's own profile where it stands above
/// `level`, else `level`, and only where the profile is below `above`.
///
/// A crossing that is not on the grid is moved to the side where the profile is lower, so the cut
/// never runs below the profile.
pub(super) fn cuts(profile: &[[i32; 2]], above: i32, level: i32) -> Vec<Profile> {
    let mut out = Vec::new();
    let mut run: Profile = Vec::new();
    let lifted = |u: i32, z: i32| [u, z.max(level)];
    for pair in profile.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if run.is_empty() {
            if a[1] < above {
                run.push(lifted(a[0], a[1]));
            } else if b[1] < above {
                let u = crossing(a, b, above);
                run.push(lifted(u, whole_height(a, b, u)));
            } else {
                continue;
            }
        }
        // Where the profile passes the level itself.
        if (a[1] < level) != (b[1] < level) {
            let u = crossing(a, b, level);
            push(&mut run, [u, level]);
        }
        if b[1] < above {
            push(&mut run, lifted(b[0], b[1]));
        } else {
            let u = crossing(a, b, above);
            push(&mut run, lifted(u, whole_height(a, b, u)));
            close(&mut out, &mut run);
        }
    }
    close(&mut out, &mut run);
    out
}

fn close(out: &mut Vec<Profile>, run: &mut Profile) {
    if run.len() >= 2 {
        out.push(std::mem::take(run));
    } else {
        run.clear();
    }
}

fn push(run: &mut Profile, vertex: [i32; 2]) {
    let Some(last) = run.last() else { return run.push(vertex) };
    if last[0] >= vertex[0] {
        return;
    }
    if let [.., a, b] = run[..] {
        let rise = |p: [i32; 2], q: [i32; 2]| i64::from(q[1]) - i64::from(p[1]);
        let step = |p: [i32; 2], q: [i32; 2]| i64::from(q[0]) - i64::from(p[0]);
        if rise(a, b) * step(b, vertex) == rise(b, vertex) * step(a, b) {
            run.pop();
        }
    }
    run.push(vertex);
}

/// Height of a polyline whose places rise or fall, at a place between its ends; past them its highest.
pub(super) fn at(profile: &[[i32; 2]], u: i32) -> f64 {
    let within = |a: i32, b: i32| (a.min(b)..=a.max(b)).contains(&u);
    match profile.windows(2).find(|pair| within(pair[0][0], pair[1][0])) {
        Some(pair) => height(pair[0], pair[1], u),
        None => profile.iter().fold(f64::NEG_INFINITY, |most, vertex| most.max(f64::from(vertex[1]))),
    }
}

/// The highest point of a polyline between two places, in whole units.
pub(super) fn highest(profile: &[[i32; 2]], from: i32, to: i32) -> i32 {
    let inside = profile.iter().filter(|vertex| (from.min(to)..=from.max(to)).contains(&vertex[0]));
    let ends = [from, to].map(|u| at(profile, u).ceil() as i32);
    inside.map(|vertex| vertex[1]).chain(ends).fold(i32::MIN, i32::max)
}

/// Height of the segment a b at u.
fn height(a: [i32; 2], b: [i32; 2], u: i32) -> f64 {
    let t = f64::from(u - a[0]) / f64::from(b[0] - a[0]);
    f64::from(a[1]) + t * (f64::from(b[1]) - f64::from(a[1]))
}

/// The same in whole units, up: a height that is whole stays what it is.
fn whole_height(a: [i32; 2], b: [i32; 2], u: i32) -> i32 {
    let [run, rise] = [0, 1].map(|k| i64::from(b[k]) - i64::from(a[k]));
    (i64::from(a[1]) - (-rise * (i64::from(u) - i64::from(a[0]))).div_euclid(run)) as i32
}

/// Grid place where the segment a b passes a height, on the side where it is lower.
fn crossing(a: [i32; 2], b: [i32; 2], z: i32) -> i32 {
    let rise = i64::from(b[1]) - i64::from(a[1]);
    if rise == 0 {
        return a[0];
    }
    let run = i64::from(b[0]) - i64::from(a[0]);
    let scaled = (i64::from(z) - i64::from(a[1])) * run;
    let offset = if rise > 0 { scaled.div_euclid(rise) } else { -scaled.div_euclid(-rise) };
    (i64::from(a[0]) + offset.clamp(0, run)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_valley_is_cut_level_by_level() {
        let profile = vec![[0, 10], [100, -90], [200, 10]];
        assert_eq!(cuts(&profile, 10, -40), vec![vec![[0, 10], [50, -40], [150, -40], [200, 10]]]);
        assert_eq!(cuts(&profile, -40, -100), vec![vec![[50, -40], [100, -90], [150, -40]]]);
        assert!(cuts(&profile, -90, -150).is_empty());
    }

    #[test]
    fn a_cut_that_starts_at_the_level_above_is_no_higher() {
        let cut = vec![[14, -13], [15, -14], [24, -14]];
        assert_eq!(cuts(&[[1, 104], [24, -103]], -13, -14), vec![cut]);
    }

    proptest! {
        #[test]
        fn never_below_the_profile_nor_above_the_level_above(
            steps in proptest::collection::vec((1i32..40, -300i32..300), 2..30),
            above in -200i32..300,
            stepdown in 1i32..200,
        ) {
            let mut u = 0;
            let profile: Vec<[i32; 2]> = steps.iter().map(|&(run, z)| { u += run; [u, z] }).collect();
            let level = above - stepdown;
            for cut in cuts(&profile, above, level) {
                for u in cut[0][0]..=cut[cut.len() - 1][0] {
                    let z = at(&cut, u);
                    prop_assert!(z >= at(&profile, u) - 1e-9 && z >= f64::from(level) - 1e-9);
                    prop_assert!(z <= f64::from(above) + 1e-9);
                    prop_assert!(at(&profile, u) <= f64::from(above) + 1e-9);
                }
            }
        }

        #[test]
        fn what_lies_a_unit_inside_is_cut(
            steps in proptest::collection::vec((1i32..40, -300i32..300), 2..30),
            above in -200i32..300,
        ) {
            let mut u = 0;
            let profile: Vec<[i32; 2]> = steps.iter().map(|&(run, z)| { u += run; [u, z] }).collect();
            let cuts = cuts(&profile, above, above - 50);
            for u in profile[0][0] + 1..profile[profile.len() - 1][0] {
                if (u - 1..=u + 1).all(|u| at(&profile, u) < f64::from(above)) {
                    prop_assert!(cuts.iter().any(|c| c[0][0] <= u && u <= c[c.len() - 1][0]), "{}", u);
                }
            }
        }
    }
}
