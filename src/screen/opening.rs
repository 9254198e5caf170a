use super::power::Vertex;

/// The paper's section 4 in one plane through a screen point and its normal: how the audience and the projector
/// stand over the two horizons of a direction e along the screen. Angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Opening {
    /// The audience's edge towards -e, above the horizon of -e.
    pub alpha_deg: f64,
    /// The audience's edge towards +e, above the horizon of +e.
    pub beta_deg: f64,
    /// The projector above the horizon of -e.
    pub gamma_deg: f64,
}

/// The view of the audience and the projector from a point, on the plane z = 1 before it.
#[derive(Clone, Debug, Default)]
pub(super) struct Sight {
    pub corners: Vec<[f64; 2]>,
    pub projector: [f64; 2],
}

/// The smallest margins of a point over its planes: those of Eqs. 10 and 11 need not be in the same.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tightest {
    pub eq10_deg: f64,
    /// Place of the plane of Eq. 10 among the azimuths tried.
    pub azimuth: usize,
    pub eq11_deg: f64,
}

impl Sight {
    pub fn add(&mut self, outline: &[Vertex]) {
        self.corners.extend(outline.iter().map(|vertex| vertex.0));
    }

    /// The opening in the plane of the screen's normal and e = (cos, sin) of an azimuth.
    pub fn opening(&self, e: [f64; 2]) -> Opening {
        let along = |p: &[f64; 2]| e[0] * p[0] + e[1] * p[1];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in &self.corners {
            let s = along(corner);
            (low, high) = (low.min(s), high.max(s));
        }
        // The direction (s, 1) stands at this angle above the horizon of -e.
        let above = |s: f64| 1.0_f64.atan2(-s).to_degrees();
        Opening { alpha_deg: above(low), beta_deg: above(-high), gamma_deg: above(along(&self.projector)) }
    }

    /// The smallest margins of Eqs. 10 and 11 over all azimuths, and the place of the azimuth of the first. Turning e
    /// round swaps alpha with beta, and so half a turn is enough.
    pub fn worst(&self, azimuths: &[[f64; 2]]) -> Tightest {
        let mut worst = Tightest { eq10_deg: f64::INFINITY, azimuth: 0, eq11_deg: f64::INFINITY };
        for (azimuth, &e) in azimuths.iter().enumerate() {
            let opening = self.opening(e);
            worst.eq11_deg = worst.eq11_deg.min(opening.eq11_deg());
            if opening.eq10_deg() < worst.eq10_deg {
                (worst.eq10_deg, worst.azimuth) = (opening.eq10_deg(), azimuth);
            }
        }
        worst
    }
}

impl Opening {
    /// Margin of Eq. 10, 180 - alpha - 2 beta <= gamma <= 2 alpha + beta: negative where a ray to the
    /// audience's edge meets the steepest facet of a neighbour.
    pub fn eq10_deg(&self) -> f64 {
        self.with_gamma(self.gamma_deg)
    }

    /// The same with another direction of the light.
    pub fn with_gamma(&self, gamma_deg: f64) -> f64 {
        let towards_beta = gamma_deg - 180.0 + self.alpha_deg + 2.0 * self.beta_deg;
        let towards_alpha = 2.0 * self.alpha_deg + self.beta_deg - gamma_deg;
        towards_beta.min(towards_alpha)
    }

    /// Whether the tighter side of Eq. 10 is that of alpha.
    pub fn breaks_at_alpha(&self) -> bool {
        let towards_beta = self.gamma_deg - 180.0 + self.alpha_deg + 2.0 * self.beta_deg;
        2.0 * self.alpha_deg + self.beta_deg - self.gamma_deg < towards_beta
    }

    /// Margin of Eq. 11, alpha + beta >= 60.
    pub fn eq11_deg(&self) -> f64 {
        self.alpha_deg + self.beta_deg - 60.0
    }
}
