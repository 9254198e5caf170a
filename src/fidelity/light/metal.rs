use glam::DVec3;

use crate::optics::{Lobe, Reflectance, Series};

/// Lobes narrower than this are mirrors.
const MIRROR: f64 = 1e-4;

/// What the surface does with the light that falls on it: a metal's reflectance, spread over a lobe if the
/// metal is rough, and a part of it matte.
///
/// Radiance towards o per irradiance from i is (1 - diffuse) F(i.m) D G / (4 (i.n)(o.n)) + diffuse F(1) / pi, which
/// is reciprocal. Of the microfacets' light the part that meets another of them is not followed.
#[derive(Clone, Copy, Debug)]
pub struct Metal {
    pub(super) reflectance: Reflectance,
    /// The same by a polynomial, if it can be shown by one.
    pub(super) series: Option<Series>,
    lobe: Option<Lobe>,
    diffuse: f64,
}

/// One way that light takes, and what became of the rest.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// Unit vector away from the surface.
    pub out: DVec3,
    /// Parts of the light that fell; they sum to 1.
    pub goes_on: f64,
    pub absorbed: f64,
    pub masked: f64,
}

impl Metal {
    /// `roughness` is the lobe's alpha, None a mirror; `diffuse` the matte part of what is reflected.
    pub fn new(reflectance: Reflectance, roughness: Option<f64>, diffuse: f64) -> Metal {
        let lobe = roughness.filter(|alpha| *alpha > MIRROR).map(Lobe::new);
        Metal { reflectance, series: Series::of(&reflectance), lobe, diffuse }
    }

    /// The same metal as a perfect mirror.
    pub fn polished(&self) -> Metal {
        Metal { lobe: None, diffuse: 0.0, ..*self }
    }

    /// Whether light from one direction leaves in one direction.
    pub fn is_mirror(&self) -> bool {
        self.lobe.is_none() && self.diffuse == 0.0
    }

    /// One way for light from `i` at a surface of normal `n` (unit vectors, `i` away from the surface, `cosine` =
    /// i . n > 0), chosen by three numbers of 0..1. The mean over them is what the metal does.
    #[inline]
    pub fn scatter(&self, i: DVec3, n: DVec3, cosine: f64, draw: impl FnOnce() -> [f64; 3]) -> Scattered {
        let mirrored = |m: DVec3, c: f64, escapes: f64| {
            let reflected = self.reflectance.at(c);
            Scattered {
                out: 2.0 * c * m - i,
                goes_on: reflected * escapes,
                absorbed: 1.0 - reflected,
                masked: reflected * (1.0 - escapes),
            }
        };
        if self.is_mirror() {
            return mirrored(n, cosine, 1.0);
        }
        let [u, v, which] = draw();
        let (x, y) = n.any_orthonormal_pair();
        if which < self.diffuse {
            // Even over the disc is cosine-weighted over the hemisphere (Malley).
            let (sin, cos) = (2.0 * std::f64::consts::PI * u).sin_cos();
            let out = v.sqrt() * (cos * x + sin * y) + (1.0 - v).sqrt() * n;
            let reflected = self.reflectance.at(1.0);
            return Scattered { out, goes_on: reflected, absorbed: 1.0 - reflected, masked: 0.0 };
        }
        let Some(lobe) = self.lobe else { return mirrored(n, cosine, 1.0) };
        let local = DVec3::new(i.dot(x), i.dot(y), cosine);
        let facet = lobe.microfacet(local, [u, v]);
        let c = local.dot(facet).max(0.0);
        let escapes = lobe.escapes(local, 2.0 * c * facet - local).min(1.0);
        mirrored(facet.x * x + facet.y * y + facet.z * n, c, escapes)
    }
}

/// Numbers of 0..1 that depend on a sample and a bounce only.
#[inline]
pub(crate) fn draw(column: i64, row: i64, bounce: u64) -> [f64; 3] {
    // SplitMix64 (Steele, Lea and Flood 2014, doi 10.1145/2660193.2660195).
    let mut state = (column as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (row as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F).rotate_left(29)
        ^ bounce.wrapping_mul(0x1656_67B1_9E37_79F9);
    std::array::from_fn(|_| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 53) as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::ComplexIndex;

    const ALUMINIUM: ComplexIndex = ComplexIndex { n: 1.0, k: 6.4 };

    /// Means over drawn ways: how much goes on, is absorbed, is masked, and goes on into a cone about `axis`.
    fn means(metal: &Metal, i: DVec3, axis: DVec3) -> [f64; 4] {
        let mut sums = [0.0; 4];
        let count = 300;
        for row in 0..count {
            for column in 0..count {
                let way = metal.scatter(i, DVec3::Z, i.z, || draw(column, row, 0));
                assert!((way.goes_on + way.absorbed + way.masked - 1.0).abs() < 1e-12);
                let inside = if way.out.dot(axis) > 0.95 { way.goes_on } else { 0.0 };
                for (sum, part) in sums.iter_mut().zip([way.goes_on, way.absorbed, way.masked, inside]) {
                    *sum += part / (count * count) as f64;
                }
            }
        }
        sums
    }

    #[test]
    fn a_flat_mirror_gives_one_direction() {
        let metal = Metal::new(Reflectance::Metal(ALUMINIUM), None, 0.0);
        let i = DVec3::new(0.3, -0.2, 0.9).normalize();
        let way = metal.scatter(i, DVec3::Z, i.z, || draw(3, 4, 0));
        assert!((way.out - DVec3::new(-i.x, -i.y, i.z)).length() < 1e-15);
        assert_eq!(way.masked, 0.0);
    }

    #[test]
    fn matte_metal_has_the_gain_of_its_reflectance() {
        let metal = Metal::new(Reflectance::Metal(ALUMINIUM), None, 1.0);
        let axis = DVec3::new(0.4, 0.1, 0.9).normalize();
        let [.., inside] = means(&metal, DVec3::new(0.1, 0.5, 0.8).normalize(), axis);
        // The projected solid angle of a cone is pi sin^2 times the axis' own cosine.
        let lambert = (1.0 - 0.95 * 0.95) * axis.z;
        assert!((inside / lambert - ALUMINIUM.reflectance(1.0)).abs() < 0.02, "{}", inside / lambert);
    }

    #[test]
    fn rough_metal_sends_as_much_one_way_as_back() {
        let metal = Metal::new(Reflectance::Metal(ALUMINIUM), Some(0.3), 0.1);
        let (a, b) = (DVec3::new(0.55, 0.1, 0.83).normalize(), DVec3::new(-0.3, 0.2, 0.93).normalize());
        // Flux into a small cone over its projected solid angle is the radiance per irradiance.
        let [.., there] = means(&metal, a, b);
        let [.., back] = means(&metal, b, a);
        assert!((there / b.z - back / a.z).abs() < 0.03 * there / b.z, "{there} {back}");
    }
}
