use std::fmt;
use std::str::FromStr;

/// The profile of a cutter: how far its surface stands above its lowest point, over the distance
/// from its axis. Every profile is convex. Written `ball:0.5`, `flat:1`, `bull:2:0.2`,
/// `vee:60:0.1:6`, `taper:0.2:10:3`; all lengths are mm, angles degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    Ball {
        diameter_mm: f64,
    },
    Flat {
        diameter_mm: f64,
    },
    Bull {
        diameter_mm: f64,
        corner_radius_mm: f64,
    },
    /// A cone with a flat tip.
    Vee {
        included_angle_deg: f64,
        tip_diameter_mm: f64,
        diameter_mm: f64,
    },
    /// A cone with a ball tip that it touches tangentially.
    Taper {
        tip_diameter_mm: f64,
        half_angle_deg: f64,
        diameter_mm: f64,
    },
}

impl Shape {
    /// The largest radius in mm.
    pub fn radius_mm(&self) -> f64 {
        0.5 * match *self {
            Shape::Ball { diameter_mm }
            | Shape::Flat { diameter_mm }
            | Shape::Bull { diameter_mm, .. }
            | Shape::Vee { diameter_mm, .. }
            | Shape::Taper { diameter_mm, .. } => diameter_mm,
        }
    }

    /// Height in mm of the cutter's surface above its lowest point at `r_mm` from its axis; None
    /// past the largest radius. A point at distance exactly R is under the cutter.
    #[inline]
    pub fn height_mm(&self, r_mm: f64) -> Option<f64> {
        let radius = self.radius_mm();
        if r_mm.is_nan() || r_mm > radius {
            return None;
        }
        let ball = |r: f64, d: f64| r - (r * r - d * d).max(0.0).sqrt();
        Some(match *self {
            Shape::Ball { .. } => ball(radius, r_mm),
            Shape::Flat { .. } => 0.0,
            Shape::Bull { corner_radius_mm, .. } => {
                let d = r_mm - (radius - corner_radius_mm);
                if d <= 0.0 { 0.0 } else { ball(corner_radius_mm, d) }
            }
            Shape::Vee { included_angle_deg, tip_diameter_mm, .. } => {
                let d = (r_mm - 0.5 * tip_diameter_mm).max(0.0);
                d / (0.5 * included_angle_deg).to_radians().tan()
            }
            Shape::Taper { tip_diameter_mm, half_angle_deg, .. } => {
                let tip = 0.5 * tip_diameter_mm;
                let (sin, cos) = half_angle_deg.to_radians().sin_cos();
                let tangent = tip * cos;
                if r_mm <= tangent {
                    ball(tip, r_mm)
                } else {
                    tip * (1.0 - sin) + (r_mm - tangent) * cos / sin
                }
            }
        })
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Shape::Ball { diameter_mm } => write!(f, "ball:{diameter_mm}"),
            Shape::Flat { diameter_mm } => write!(f, "flat:{diameter_mm}"),
            Shape::Bull { diameter_mm, corner_radius_mm } => {
                write!(f, "bull:{diameter_mm}:{corner_radius_mm}")
            }
            Shape::Vee { included_angle_deg, tip_diameter_mm, diameter_mm } => {
                write!(f, "vee:{included_angle_deg}:{tip_diameter_mm}:{diameter_mm}")
            }
            Shape::Taper { tip_diameter_mm, half_angle_deg, diameter_mm } => {
                write!(f, "taper:{tip_diameter_mm}:{half_angle_deg}:{diameter_mm}")
            }
        }
    }
}

/// Why a cutter's spelling was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParseError {
    #[error(
        "cutter \"{text}\" has no known profile; hint: ball:D, flat:D, bull:D:CORNER, vee:ANGLE:TIP:D or taper:TIP:HALF_ANGLE:D"
    )]
    Profile { text: String },
    #[error("cutter \"{text}\" has {found} numbers, {profile} takes {wanted}; hint: {usage}")]
    Count { text: String, profile: &'static str, found: usize, wanted: usize, usage: &'static str },
    #[error("cutter \"{text}\": \"{word}\" is not a number")]
    Number { text: String, word: String },
    #[error("cutter \"{text}\": {what} is {value}, it must lie in {low} .. {high}")]
    Range { text: String, what: &'static str, value: f64, low: f64, high: f64 },
}

impl FromStr for Shape {
    type Err = ParseError;

    fn from_str(text: &str) -> Result<Shape, ParseError> {
        let mut words = text.trim().split(':');
        let name = words.next().unwrap_or_default();
        let mut numbers = Vec::new();
        for word in words {
            let value = word
                .trim()
                .parse::<f64>()
                .ok()
                .filter(|v| v.is_finite())
                .ok_or_else(|| ParseError::Number { text: text.into(), word: word.into() })?;
            numbers.push(value);
        }
        let take = |profile, wanted: usize, usage| {
            if numbers.len() == wanted {
                Ok(())
            } else {
                Err(ParseError::Count { text: text.into(), profile, found: numbers.len(), wanted, usage })
            }
        };
        let within = |what, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(value)
            } else {
                Err(ParseError::Range { text: text.into(), what, value, low, high })
            }
        };
        let diameter = |value| within("the diameter in mm", value, 0.01, 100.0);
        match name {
            "ball" => {
                take("ball", 1, "ball:0.5 is a ball of 0.5 mm diameter")?;
                Ok(Shape::Ball { diameter_mm: diameter(numbers[0])? })
            }
            "flat" => {
                take("flat", 1, "flat:1 is a flat end of 1 mm diameter")?;
                Ok(Shape::Flat { diameter_mm: diameter(numbers[0])? })
            }
            "bull" => {
                take("bull", 2, "bull:2:0.2 is 2 mm in diameter with a corner radius of 0.2 mm")?;
                let diameter_mm = diameter(numbers[0])?;
                let corner_radius_mm = within("the corner radius in mm", numbers[1], 0.0, 0.5 * diameter_mm)?;
                Ok(Shape::Bull { diameter_mm, corner_radius_mm })
            }
            "vee" => {
                take("vee", 3, "vee:60:0.1:6 is 60 degrees, 0.1 mm at the tip, 6 mm at most")?;
                let included_angle_deg = within("the included angle in degrees", numbers[0], 1.0, 179.0)?;
                let diameter_mm = diameter(numbers[2])?;
                let tip_diameter_mm = within("the tip diameter in mm", numbers[1], 0.0, diameter_mm)?;
                Ok(Shape::Vee { included_angle_deg, tip_diameter_mm, diameter_mm })
            }
            "taper" => {
                take("taper", 3, "taper:0.2:10:3 is a 0.2 mm ball tip, 10 degrees a side, 3 mm at most")?;
                let diameter_mm = diameter(numbers[2])?;
                let tip_diameter_mm = within("the tip diameter in mm", numbers[0], 0.01, diameter_mm)?;
                let half_angle_deg = within("the half angle in degrees", numbers[1], 0.5, 89.0)?;
                Ok(Shape::Taper { tip_diameter_mm, half_angle_deg, diameter_mm })
            }
            _ => Err(ParseError::Profile { text: text.into() }),
        }
    }
}
