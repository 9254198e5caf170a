use std::f64::consts::PI;

use glam::DVec3;

/// The lobe of a polished metal: microfacets of GGX distribution (Trowbridge and Reitz 1975; Walter et al.
/// 2007, doi 10.2312/EGWR/EGSR07/195-206) with Smith's height-correlated shadowing (Heitz 2014, JCGT 3(2)).
/// Directions are unit vectors of a frame whose +Z is the surface's normal, pointing away from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    alpha: f64,
}

impl Lobe {
    /// `alpha` is about the root of twice the mean square slope of the microfacets.
    pub fn new(alpha: f64) -> Lobe {
        Lobe { alpha }
    }

    /// Density of microfacet normals over solid angle, times the area they stand on.
    pub fn density(&self, m: DVec3) -> f64 {
        let a2 = self.alpha * self.alpha;
        let t = m.z * m.z * (a2 - 1.0) + 1.0;
        if m.z > 0.0 { a2 / (PI * t * t) } else { 0.0 }
    }

    fn lambda(&self, w: DVec3) -> f64 {
        let tan2 = (1.0 - w.z * w.z).max(0.0) / (w.z * w.z);
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
    }

    /// Part of the microfacets that is not hidden from `w`.
    pub fn unmasked(&self, w: DVec3) -> f64 {
        if w.z > 0.0 { 1.0 / (1.0 + self.lambda(w)) } else { 0.0 }
    }

    /// Part of the light from `i`, reflected towards `o`, that no other microfacet stops on either way.
    fn unmasked_both(&self, i: DVec3, o: DVec3) -> f64 {
        if i.z > 0.0 && o.z > 0.0 { 1.0 / (1.0 + self.lambda(i) + self.lambda(o)) } else { 0.0 }
    }

    /// Radiance towards `o` per irradiance from `i`, without the metal's reflectance, in 1/sr.
    pub fn value(&self, i: DVec3, o: DVec3) -> f64 {
        if i.z <= 0.0 || o.z <= 0.0 {
            return 0.0;
        }
        let m = (i + o).normalize();
        self.density(m) * self.unmasked_both(i, o) / (4.0 * i.z * o.z)
    }

    /// A microfacet that `i` sees, drawn by two numbers of 0..1 as often as its visible area asks (Dupuy and
    /// Benyoub 2023, doi 10.1111/cgf.14867).
    pub fn microfacet(&self, i: DVec3, u: [f64; 2]) -> DVec3 {
        let stretched = DVec3::new(self.alpha * i.x, self.alpha * i.y, i.z).normalize();
        let z = (1.0 - u[1]) * (1.0 + stretched.z) - stretched.z;
        let (sin, cos) = (2.0 * PI * u[0]).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        let h = DVec3::new(r * cos, r * sin, z) + stretched;
        DVec3::new(self.alpha * h.x, self.alpha * h.y, h.z.max(0.0)).normalize()
    }

    /// Of the light that a drawn microfacet reflects into `o`, the part that gets away.
    pub fn escapes(&self, i: DVec3, o: DVec3) -> f64 {
        if o.z <= 0.0 { 0.0 } else { self.unmasked_both(i, o) * (1.0 + self.lambda(i)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(theta: f64, phi: f64) -> DVec3 {
        DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }

    /// Midpoint sums over the hemisphere.
    fn over_the_hemisphere(value: impl Fn(DVec3) -> f64) -> f64 {
        let (across, around) = (1500, 720);
        let mut sum = 0.0;
        for t in 0..across {
            let theta = (t as f64 + 0.5) / across as f64 * 0.5 * PI;
            for p in 0..around {
                let phi = (p as f64 + 0.5) / around as f64 * 2.0 * PI;
                sum += value(direction(theta, phi)) * theta.sin();
            }
        }
        sum * 0.5 * PI / across as f64 * 2.0 * PI / around as f64
    }

    #[test]
    fn microfacets_cover_the_surface_once() {
        for alpha in [0.1, 0.3, 0.8] {
            let lobe = Lobe::new(alpha);
            let area = over_the_hemisphere(|m| lobe.density(m) * m.z);
            assert!((area - 1.0).abs() < 1e-3, "{alpha}: {area}");
        }
    }

    #[test]
    fn the_lobe_is_reciprocal() {
        let lobe = Lobe::new(0.35);
        for k in 0..50 {
            let i = direction(0.03 * f64::from(k), 0.7 * f64::from(k));
            let o = direction(1.5 - 0.025 * f64::from(k), 0.3 * f64::from(k));
            assert!((lobe.value(i, o) - lobe.value(o, i)).abs() <= 1e-12 * lobe.value(i, o).max(1.0));
        }
    }

    /// In a white furnace, with every microfacet's reflection counted once and masked on the way in only, all light
    /// comes out (Heitz 2014, Eq. 99).
    #[test]
    fn a_white_furnace_is_white() {
        for (alpha, theta) in [(0.2, 0.3), (0.4, 0.9), (0.7, 1.2)] {
            let (lobe, i) = (Lobe::new(alpha), direction(theta, 0.4));
            let whole = over_the_hemisphere(|m| lobe.density(m) * lobe.unmasked(i) * i.dot(m).max(0.0) / i.z);
            assert!((whole - 1.0).abs() < 2e-3, "{alpha} {theta}: {whole}");
        }
    }

    #[test]
    fn drawn_microfacets_send_what_the_lobe_says() {
        let (lobe, i) = (Lobe::new(0.4), direction(0.7, 0.2));
        let inside = |o: DVec3| o.x < -0.3 && o.z > 0.5;
        let wanted = over_the_hemisphere(|o| if inside(o) { lobe.value(i, o) * o.z } else { 0.0 });
        let all = over_the_hemisphere(|o| lobe.value(i, o) * o.z);
        let (mut sum, mut total, count) = (0.0, 0.0, 400);
        for a in 0..count {
            for b in 0..count {
                let u = [(f64::from(a) + 0.5) / f64::from(count), (f64::from(b) + 0.5) / f64::from(count)];
                let m = lobe.microfacet(i, u);
                let o = 2.0 * i.dot(m) * m - i;
                let part = lobe.escapes(i, o) / f64::from(count * count);
                total += part;
                sum += if inside(o) { part } else { 0.0 };
            }
        }
        assert!((sum - wanted).abs() < 2e-3, "{sum} {wanted}");
        assert!((total - all).abs() < 2e-3, "{total} {all}");
    }
}
