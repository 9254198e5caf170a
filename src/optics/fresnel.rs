/// A metal's refractive index n + i k, relative to air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComplexIndex {
    pub n: f64,
    pub k: f64,
}

impl ComplexIndex {
    /// The metals that can be named in a scene. Aluminium stands as the published screen's Fresnel
    /// term uses it.
    const NAMED: [(&'static str, ComplexIndex); 1] = [("aluminium", ComplexIndex { n: 1.0, k: 6.4 })];

    /// The index of a metal by its name.
    pub fn named(name: &str) -> Option<ComplexIndex> {
        Self::NAMED.iter().find(|(known, _)| *known == name).map(|(_, index)| *index)
    }

    /// The names that [`ComplexIndex::named`] knows.
    pub fn names() -> Vec<&'static str> {
        Self::NAMED.iter().map(|(name, _)| *name).collect()
    }

    /// Reflectance (0 to 1) of a smooth surface for unpolarised light whose direction makes an
    /// angle with the normal of this cosine. Exact for a conductor in air (Born and Wolf,
    /// Principles of Optics, 14.2): the mean of the two polarisations.
    pub fn reflectance(&self, cosine: f64) -> f64 {
        let (cos2, sin2) = (cosine * cosine, 1.0 - cosine * cosine);
        let t = self.n * self.n - self.k * self.k - sin2;
        let a2b2 = (t * t + 4.0 * self.n * self.n * self.k * self.k).sqrt();
        let a = (0.5 * (a2b2 + t)).max(0.0).sqrt();
        let ac = 2.0 * a * cosine;
        let s = (a2b2 + cos2 - ac) / (a2b2 + cos2 + ac);
        let p = s * (cos2 * a2b2 + sin2 * sin2 - ac * sin2) / (cos2 * a2b2 + sin2 * sin2 + ac * sin2);
        0.5 * (s + p)
    }
}

/// How much of the light a mirror reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflectance {
    /// That of a smooth metal, by its refractive index.
    Metal(ComplexIndex),
    /// The same at every angle.
    Constant(f64),
}

impl Reflectance {
    /// At an angle to the normal of this cosine.
    pub fn at(&self, cosine: f64) -> f64 {
        match self {
            Reflectance::Metal(index) => index.reflectance(cosine),
            Reflectance::Constant(value) => *value,
        }
    }
}

/// A reflectance as a polynomial of the cosine, for angles that are not flat: roots and quotients take several times as
/// long.
#[derive(Clone, Copy, Debug)]
pub struct Series {
    /// Of powers of x, with x = -1 at [`Series::LEAST_COSINE`] and 1 at a cosine of 1.
    powers: [f64; Series::TERMS],
}

impl Series {
    /// Holds from here to a cosine of 1.
    pub const LEAST_COSINE: f64 = 0.5;
    const TERMS: usize = 18;
    /// The last terms are less than this.
    const NEGLIGIBLE: f64 = 1e-13;

    /// Interpolates at Chebyshev's points; None where so many terms do not show the reflectance.
    pub fn of(reflectance: &Reflectance) -> Option<Series> {
        let (count, middle) = (Self::TERMS as f64, 0.5 * (1.0 + Self::LEAST_COSINE));
        let half = 1.0 - middle;
        let angle = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / count;
        let values: [f64; Self::TERMS] =
            std::array::from_fn(|k| reflectance.at(middle + half * angle(k).cos()));
        let terms: [f64; Self::TERMS] = std::array::from_fn(|j| {
            let sum: f64 =
                values.iter().enumerate().map(|(k, value)| value * (j as f64 * angle(k)).cos()).sum();
            sum * if j == 0 { 1.0 } else { 2.0 } / count
        });
        // NaN is not less.
        if !terms[Self::TERMS - 2..].iter().all(|term| term.abs() < Self::NEGLIGIBLE) {
            return None;
        }
        // T(j + 1) = 2 x T(j) - T(j - 1)
        let (mut last, mut polynomial) = ([0.0; Self::TERMS], [0.0; Self::TERMS]);
        polynomial[0] = 1.0;
        let mut powers = [0.0; Self::TERMS];
        for (j, term) in terms.iter().enumerate() {
            for (power, p) in powers.iter_mut().zip(&polynomial) {
                *power += term * p;
            }
            let mut next = [0.0; Self::TERMS];
            for k in 1..Self::TERMS {
                next[k] = polynomial[k - 1] * if j == 0 { 1.0 } else { 2.0 };
            }
            next.iter_mut().zip(&last).for_each(|(next, last)| *next -= last);
            (last, polynomial) = (polynomial, next);
        }
        Some(Series { powers })
    }

    /// The reflectance at a cosine.
    #[inline(always)]
    pub fn at(&self, cosine: f64) -> f64 {
        let half = 0.5 * (1.0 - Self::LEAST_COSINE);
        let x = (cosine - (1.0 - half)) * (1.0 / half);
        self.powers.iter().rev().fold(0.0, |sum, power| sum * x + power)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALUMINIUM: ComplexIndex = ComplexIndex { n: 1.0, k: 6.4 };

    #[test]
    fn normal_incidence_has_its_closed_form() {
        for index in [ALUMINIUM, ComplexIndex { n: 0.2, k: 3.4 }, ComplexIndex { n: 1.5, k: 0.0 }] {
            let ComplexIndex { n, k } = index;
            let expected = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
            assert!((index.reflectance(1.0) - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn grazing_light_is_reflected_whole() {
        assert!((ALUMINIUM.reflectance(0.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_lossless_glass_hides_its_p_light_at_brewsters_angle() {
        let glass = ComplexIndex { n: 1.5, k: 0.0 };
        let cosine = 1.5_f64.atan().cos();
        let refracted = (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
        let s = ((cosine - 1.5 * refracted) / (cosine + 1.5 * refracted)).powi(2);
        assert!((glass.reflectance(cosine) - 0.5 * s).abs() < 1e-14);
    }

    #[test]
    fn aluminium_is_flat_up_to_45_degrees() {
        let normal = ALUMINIUM.reflectance(1.0);
        assert!((normal - 0.9110).abs() < 1e-4);
        assert!((ALUMINIUM.reflectance(45f64.to_radians().cos()) / normal - 1.0).abs() < 0.005);
        assert!((ALUMINIUM.reflectance(60f64.to_radians().cos()) / normal - 1.0).abs() < 0.017);
    }
    #[test]
    fn a_series_is_the_reflectance() {
        for reflectance in [Reflectance::Metal(ALUMINIUM), Reflectance::Constant(0.7)] {
            let series = Series::of(&reflectance).expect("it converges");
            for k in 0..=1000 {
                let cosine = Series::LEAST_COSINE + (1.0 - Series::LEAST_COSINE) * f64::from(k) / 1000.0;
                let apart = series.at(cosine) - reflectance.at(cosine);
                assert!(apart.abs() < 1e-12, "{cosine} {apart:e}");
            }
        }
        // Total reflection inside a thin medium has a corner.
        assert!(Series::of(&Reflectance::Metal(ComplexIndex { n: 0.6, k: 0.0 })).is_none());
    }
}
