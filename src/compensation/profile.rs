use super::Error;
use crate::cutter::Shape;

/// Samples a cutter may span from its axis; its table then takes 270 MB.
const LARGEST_RADIUS_SAMPLES: f64 = 4096.0;

/// A sample this close past the radius counts as at distance exactly R: positions are sums of
/// decimal fractions, and one sample more under the cutter is never a gouge.
pub(super) const REACH_MM: f64 = 1e-9;

/// A cutter made ready for samples of one pitch, optionally dilated by a disc: with a lateral
/// allowance a the cutter may stand anywhere within a of its planned position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    shape: Shape,
    step_mm: f64,
    allowance_mm: f64,
}

impl Profile {
    /// `step_mm` is the pitch of the samples, `allowance_mm` >= 0 the radius of the disc.
    ///
    /// # Errors
    /// The pitch or allowance is no length, or the cutter spans less than one sample or more than
    /// can be tabulated.
    pub fn new(shape: Shape, step_mm: f64, allowance_mm: f64) -> Result<Profile, Error> {
        if !(step_mm.is_finite() && step_mm > 0.0) {
            return Err(Error::Step { step_mm });
        }
        if !(allowance_mm.is_finite() && allowance_mm >= 0.0) {
            return Err(Error::Allowance { allowance_mm });
        }
        let radius_mm = shape.radius_mm();
        if radius_mm.is_nan() || radius_mm < step_mm - REACH_MM {
            return Err(Error::SmallerThanSample { cutter: shape.to_string(), radius_mm, step_mm });
        }
        let samples = (radius_mm + allowance_mm) / step_mm;
        if samples > LARGEST_RADIUS_SAMPLES {
            return Err(Error::TooManySamples {
                cutter: shape.to_string(),
                samples,
                most: LARGEST_RADIUS_SAMPLES,
                step_mm,
                hint_mm: (radius_mm + allowance_mm) / LARGEST_RADIUS_SAMPLES,
            });
        }
        Ok(Profile { shape, step_mm, allowance_mm })
    }

    /// The cutter without its allowance.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Pitch of the samples in mm.
    pub fn step_mm(&self) -> f64 {
        self.step_mm
    }

    /// Radius in mm, allowance included.
    pub fn radius_mm(&self) -> f64 {
        self.shape.radius_mm() + self.allowance_mm
    }

    /// Radius in samples, allowance included.
    pub fn radius(&self) -> f64 {
        self.radius_mm() / self.step_mm
    }

    /// Samples from the axis to the outermost one that can lie under the cutter: the halo of a
    /// cutter location; a closing takes twice as much.
    pub fn reach(&self) -> usize {
        ((self.radius_mm() + REACH_MM) / self.step_mm).floor() as usize
    }

    /// Refuses rows so far apart that the cutter leaves strips between them untouched.
    ///
    /// # Errors
    /// `every` rows are more than the cutter is wide.
    pub fn covers_between(&self, every: usize) -> Result<(), Error> {
        let most = 2 * self.reach();
        if every <= most {
            return Ok(());
        }
        Err(Error::Strips {
            every,
            step_mm: self.step_mm,
            cutter: self.shape.to_string(),
            radius_mm: self.radius_mm(),
            most,
        })
    }

    /// s(d): how far the cutter's surface stands below its lowest point's level (so never
    /// positive) at `distance_mm` from its axis; None past the radius.
    #[inline]
    pub fn s_mm(&self, distance_mm: f64) -> Option<f64> {
        if distance_mm > self.radius_mm() + REACH_MM {
            return None;
        }
        let r_mm = (distance_mm - self.allowance_mm).clamp(0.0, self.shape.radius_mm());
        self.shape.height_mm(r_mm).map(|height_mm| 0.0 - height_mm)
    }

    /// Radius in mm of the flat disc at the bottom; 0 where the profile rises at once.
    pub(super) fn plateau_mm(&self) -> f64 {
        self.allowance_mm
            + match self.shape {
                Shape::Ball { .. } | Shape::Taper { .. } => 0.0,
                Shape::Flat { diameter_mm } => 0.5 * diameter_mm,
                Shape::Bull { diameter_mm, corner_radius_mm } => 0.5 * diameter_mm - corner_radius_mm,
                Shape::Vee { tip_diameter_mm, .. } => 0.5 * tip_diameter_mm,
            }
    }

    /// Whether the profile is a plain half sphere.
    pub(super) fn is_ball(&self) -> bool {
        matches!(self.shape, Shape::Ball { .. }) && self.allowance_mm == 0.0
    }
}
