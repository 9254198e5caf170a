use std::f64::consts::PI;
use std::sync::OnceLock;

use glam::DVec3;

use super::audience::View;

/// The density that the search starts from, in lattice points over the hemisphere.
const FIRST_DENSITY: f64 = 64.0;
/// The densest lattice that is tried: 16 million directions.
pub const MOST_SAMPLES: f64 = 16_777_216.0;
/// Directions closer to the screen plane than this are not used.
const LOWEST_Z: f64 = 1e-3;
const BISECTIONS: usize = 60;

/// The directions in which one point sees its audience.
#[derive(Clone, Debug, PartialEq)]
pub struct Directions {
    /// Density of the lattice, in points over the hemisphere.
    pub density: f64,
    /// Unit vectors from the screen to the audience, by growing angle to the screen's normal.
    /// Exactly as many as asked, except where the count jumps past it at one density: then the
    /// smallest larger count.
    pub list: Vec<DVec3>,
}

/// Lattice direction k at density `nu`: z = 1 - (k + 1/2) / nu, phi = 2 pi frac(k / golden).
fn lattice(k: usize, nu: f64, turns: &[[f64; 2]]) -> DVec3 {
    let z = 1.0 - (k as f64 + 0.5) / nu;
    let r = (1.0 - z * z).sqrt();
    let [cos, sin] = turns.get(k).copied().unwrap_or_else(|| turn(k));
    DVec3::new(r * cos, r * sin, z)
}

fn turn(k: usize) -> [f64; 2] {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let phi = 2.0 * PI * (k as f64 / golden).fract();
    [phi.cos(), phi.sin()]
}

/// Cosine and sine of the lattice's azimuths, which do not depend on the density.
fn turns() -> &'static [[f64; 2]] {
    static TURNS: OnceLock<Vec<[f64; 2]>> = OnceLock::new();
    TURNS.get_or_init(|| (0..1 << 15).map(turn).collect())
}

/// Calls `found` for the lattice directions that meet the audience until it says stop.
fn scan(view: &View, nu: f64, mut found: impl FnMut(DVec3) -> bool) {
    let turns = turns();
    let floor = view.lowest_z().max(LOWEST_Z);
    for k in 0..(nu - 0.5).ceil().max(0.0) as usize {
        let direction = lattice(k, nu, turns);
        if direction.z <= floor {
            break;
        }
        if view.hit(direction) && !found(direction) {
            break;
        }
    }
}

/// Number of directions at this density, counted no further than `wanted` + 1.
fn count(view: &View, nu: f64, wanted: usize) -> usize {
    let mut hits = 0;
    scan(view, nu, |_| {
        hits += 1;
        hits <= wanted
    });
    hits
}

/// Samples exactly `wanted` directions to the audience evenly by solid angle (paper, section 3.1).
/// The lattice's density is found by doubling from 64 until there are enough and bisecting from
/// there, so that a point gets the same directions whatever was sampled before. None if even
/// [`MOST_SAMPLES`] directions do not hold as many.
pub fn directions(view: &View, wanted: usize) -> Option<Directions> {
    let (mut low, mut high) = (0.0, FIRST_DENSITY);
    let mut hits = count(view, high, wanted);
    while hits < wanted {
        if 2.0 * high > MOST_SAMPLES {
            return None;
        }
        (low, high) = (high, 2.0 * high);
        hits = count(view, high, wanted);
    }
    for _ in 0..BISECTIONS {
        if hits == wanted {
            break;
        }
        let middle = 0.5 * (low + high);
        let here = count(view, middle, wanted);
        if here < wanted {
            low = middle;
        } else {
            (high, hits) = (middle, here);
        }
    }
    let mut list = Vec::with_capacity(wanted);
    scan(view, high, |direction| {
        list.push(direction);
        true
    });
    Some(Directions { density: high, list })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::screen::audience::Polyhedron;

    fn audience(shift: f64) -> Vec<Polyhedron> {
        let mut corners = Vec::new();
        for x in [-1.0, 1.0] {
            for y in [-0.5, 0.3] {
                for z in [2.0, 3.1] {
                    corners.push(DVec3::new(x + shift, y, z));
                }
            }
        }
        vec![Polyhedron::hull("box", &corners).expect("a solid")]
    }

    #[test]
    fn the_count_is_exact_from_one_to_many() {
        for shift in [0.0, 0.31, 4.0] {
            let audience = audience(shift);
            let view = View::new(&audience, DVec3::new(0.013, -0.4, 0.02));
            for wanted in [1, 2, 3, 7, 50, 200, 1000] {
                let found = directions(&view, wanted).expect("a wide audience");
                assert_eq!(found.list.len(), wanted);
                assert!(found.list.iter().all(|o| (o.length() - 1.0).abs() < 1e-15));
            }
        }
    }

    #[test]
    fn the_density_is_the_number_over_the_solid_angle() {
        let audience = audience(0.0);
        let view = View::new(&audience, DVec3::ZERO);
        let fine = directions(&view, 4000).expect("a wide audience").density / 4000.0;
        let coarse = directions(&view, 1000).expect("a wide audience").density / 1000.0;
        assert!((fine / coarse - 1.0).abs() < 0.02, "{fine} {coarse}");
    }

    #[test]
    fn an_audience_under_the_horizon_gives_nothing() {
        let audience = audience(0.0);
        assert!(directions(&View::new(&audience, DVec3::new(0.0, 0.0, 5.0)), 3).is_none());
    }
}
