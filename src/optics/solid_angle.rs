use glam::DVec3;

/// Integral of (o . `normal`) d(omega) over the directions o inside a polygon of great arcs, in sr where
/// `normal` is a unit vector: Lambert's closed form, 1/2 sum over the edges of Theta n . (v x w)/|v x w|, with
/// Theta the angle between the corners v and w (Arvo, "Analytic Methods for Simulated Light Transport",
/// 1995, section 2.5). Corners need not be of unit length; they run counter-clockwise as seen along -o, and
/// all stand above the plane of the normal.
pub fn projected_solid_angle(corners: &[DVec3], normal: DVec3) -> f64 {
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let sum: f64 = edges
        .map(|(v, w)| {
            let across = v.cross(*w);
            let sine = across.length();
            // The arc vanishes with its edge.
            if sine > 0.0 { sine.atan2(v.dot(*w)) * normal.dot(across) / sine } else { 0.0 }
        })
        .sum();
    0.5 * sum
}

/// Gain (1 = Lambertian of reflectance 1) of a surface that spreads the share `reflectance` of its light evenly
/// over directions whose projected solid angle is `projected_sr`.
pub fn even_gain(reflectance: f64, projected_sr: f64) -> f64 {
    std::f64::consts::PI * reflectance / projected_sr
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn square(half: f64, z: f64) -> Vec<DVec3> {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| DVec3::new(half * x, half * y, z))
            .to_vec()
    }

    #[test]
    fn a_centred_square_has_its_closed_form() {
        // Four times the view factor of a rectangle with a corner over the point, times pi.
        for (half, z) in [(1.0, 2.0), (0.3, 1.0), (50.0, 1.0)] {
            let x = half / z;
            let exact = 4.0 * x / (1.0_f64 + x * x).sqrt() * (x / (1.0 + x * x).sqrt()).atan();
            assert!((projected_solid_angle(&square(half, z), DVec3::Z) - exact).abs() < 1e-14);
        }
    }

    #[test]
    fn the_hemisphere_counts_pi_and_its_octant_a_quarter() {
        let ring: Vec<DVec3> = (0..4)
            .map(|k| {
                let turn = 0.5 * PI * f64::from(k);
                DVec3::new(turn.cos(), turn.sin(), 1e-9)
            })
            .collect();
        assert!((projected_solid_angle(&ring, DVec3::Z) - PI).abs() < 1e-8);
        let octant = [DVec3::X, DVec3::Y, DVec3::Z];
        assert!((projected_solid_angle(&octant, DVec3::Z) - 0.25 * PI).abs() < 1e-15);
        assert!((even_gain(1.0, PI) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_small_square_counts_its_area_times_the_cosine() {
        let small = square(1e-7, 1.0);
        assert!((projected_solid_angle(&small, DVec3::Z) / 4e-14 - 1.0).abs() < 1e-6);
        let tilted = DVec3::new(0.6, 0.0, 0.8);
        assert!((projected_solid_angle(&small, tilted) / 3.2e-14 - 1.0).abs() < 1e-6);
    }
}
