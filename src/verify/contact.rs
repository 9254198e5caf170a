//! Where along a straight move a cutter is lowest over a point, in closed form.
//!
//! A point at distance d across the move and s along it is under the cutter at height
//! z(t) = z0 + m t + rise(d^2 + (t - s)^2). A cutter's rise is convex in its radius, so z is convex in t and
//! its minimum over the whole line lies at t = s + slide(d), whatever s: slide is the u in [-q, q]
//! (q the half chord) that minimises m u + rise(d^2 + u^2).

use crate::cutter::Shape;

/// What a slope m makes of a cutter; computed once per move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lean {
    pub m: f64,
    /// Share of the half chord, or ratio u / d on a cone.
    ball: f64,
    cone: f64,
}

/// One cutter profile as the sweep needs it.
pub(super) trait Contact: Copy + Sync {
    /// Whether it cuts as deep as in the middle all over.
    const FLAT: bool = false;
    /// Largest radius in mm.
    fn radius(&self) -> f64;
    fn lean(&self, m: f64) -> Lean;
    /// The minimiser u for d^2 = `d2` and half chord `q`.
    fn slide(&self, d2: f64, q: f64, lean: &Lean) -> f64;
    /// Height above the lowest point at squared radius `r2`; past the rim that of the rim.
    fn rise(&self, r2: f64) -> f64;
}

fn ball_share(m: f64) -> f64 {
    m / (1.0 + m * m).sqrt()
}

/// u / d of the lowest contact on a cone of slope c; infinite where the move is steeper.
fn cone_ratio(m: f64, c: f64) -> f64 {
    let m = m.abs();
    if m < c { m / (c * c - m * m).sqrt() } else { f64::INFINITY }
}

/// The cone's u, kept between the circle where the cone begins and the rim.
fn cone_slide(d2: f64, q: f64, begins: f64, lean: &Lean) -> f64 {
    if lean.m == 0.0 {
        return 0.0;
    }
    let inner = (begins * begins - d2).max(0.0).sqrt().min(q);
    let u = if lean.cone.is_infinite() { q } else { (lean.cone * d2.sqrt()).clamp(inner, q) };
    if lean.m > 0.0 { -u } else { u }
}

#[derive(Clone, Copy)]
pub(super) struct Ball {
    radius: f64,
}

impl Contact for Ball {
    fn radius(&self) -> f64 {
        self.radius
    }

    fn lean(&self, m: f64) -> Lean {
        Lean { m, ball: ball_share(m), cone: 0.0 }
    }

    #[inline(always)]
    fn slide(&self, _d2: f64, q: f64, lean: &Lean) -> f64 {
        -lean.ball * q
    }

    #[inline(always)]
    fn rise(&self, r2: f64) -> f64 {
        self.radius - (self.radius * self.radius - r2).max(0.0).sqrt()
    }
}

#[derive(Clone, Copy)]
pub(super) struct Flat {
    radius: f64,
}

impl Contact for Flat {
    const FLAT: bool = true;

    fn radius(&self) -> f64 {
        self.radius
    }

    fn lean(&self, m: f64) -> Lean {
        Lean { m, ball: if m == 0.0 { 0.0 } else { m.signum() }, cone: 0.0 }
    }

    #[inline(always)]
    fn slide(&self, _d2: f64, q: f64, lean: &Lean) -> f64 {
        -lean.ball * q
    }

    #[inline(always)]
    fn rise(&self, _r2: f64) -> f64 {
        0.0
    }
}

#[derive(Clone, Copy)]
pub(super) struct Bull {
    radius: f64,
    corner: f64,
}

impl Contact for Bull {
    fn radius(&self) -> f64 {
        self.radius
    }

    fn lean(&self, m: f64) -> Lean {
        Lean { m, ball: 0.0, cone: 0.0 }
    }

    /// On the corner the condition |m| = rise'(r) u / r is a quartic, so it is bisected; z is flat
    /// about its minimum, and a nanometre in u is far less in z.
    #[inline]
    fn slide(&self, d2: f64, q: f64, lean: &Lean) -> f64 {
        if lean.m == 0.0 {
            return 0.0;
        }
        let m = lean.m.abs();
        let flat = self.radius - self.corner;
        let mut low = (flat * flat - d2).max(0.0).sqrt().min(q);
        let mut high = q;
        while high - low > 1e-9 {
            let u = 0.5 * (low + high);
            let r = (d2 + u * u).sqrt();
            let out = r - flat;
            let down = (self.corner * self.corner - out * out).max(0.0).sqrt();
            if out * u < m * r * down {
                low = u;
            } else {
                high = u;
            }
        }
        let u = 0.5 * (low + high);
        if lean.m > 0.0 { -u } else { u }
    }

    #[inline(always)]
    fn rise(&self, r2: f64) -> f64 {
        let out = (r2.sqrt() - (self.radius - self.corner)).max(0.0);
        self.corner - (self.corner * self.corner - out * out).max(0.0).sqrt()
    }
}

#[derive(Clone, Copy)]
pub(super) struct Vee {
    radius: f64,
    tip: f64,
    slope: f64,
}

impl Contact for Vee {
    fn radius(&self) -> f64 {
        self.radius
    }

    fn lean(&self, m: f64) -> Lean {
        Lean { m, ball: 0.0, cone: cone_ratio(m, self.slope) }
    }

    #[inline(always)]
    fn slide(&self, d2: f64, q: f64, lean: &Lean) -> f64 {
        cone_slide(d2, q, self.tip, lean)
    }

    #[inline(always)]
    fn rise(&self, r2: f64) -> f64 {
        (r2.sqrt() - self.tip).max(0.0) * self.slope
    }
}

#[derive(Clone, Copy)]
pub(super) struct Taper {
    radius: f64,
    tip: f64,
    /// Radius and height at which the cone leaves the ball.
    tangent: f64,
    tangent_height: f64,
    slope: f64,
}

impl Contact for Taper {
    fn radius(&self) -> f64 {
        self.radius
    }

    fn lean(&self, m: f64) -> Lean {
        Lean { m, ball: ball_share(m), cone: cone_ratio(m, self.slope) }
    }

    #[inline]
    fn slide(&self, d2: f64, q: f64, lean: &Lean) -> f64 {
        let on_ball = -lean.ball * (self.tip * self.tip - d2).max(0.0).sqrt();
        if d2 + on_ball * on_ball <= self.tangent * self.tangent && on_ball.abs() <= q {
            on_ball
        } else {
            cone_slide(d2, q, self.tangent, lean)
        }
    }

    #[inline(always)]
    fn rise(&self, r2: f64) -> f64 {
        if r2 <= self.tangent * self.tangent {
            self.tip - (self.tip * self.tip - r2).max(0.0).sqrt()
        } else {
            self.tangent_height + (r2.sqrt() - self.tangent) * self.slope
        }
    }
}

/// Runs `$body` with `$contact` bound to the shape's own type, so that each kernel is compiled for it.
macro_rules! with_contact {
    ($shape:expr, $contact:ident => $body:expr) => {
        match $crate::verify::contact::Profile::of($shape) {
            $crate::verify::contact::Profile::Ball($contact) => $body,
            $crate::verify::contact::Profile::Flat($contact) => $body,
            $crate::verify::contact::Profile::Bull($contact) => $body,
            $crate::verify::contact::Profile::Vee($contact) => $body,
            $crate::verify::contact::Profile::Taper($contact) => $body,
        }
    };
}
pub(super) use with_contact;

pub(super) enum Profile {
    Ball(Ball),
    Flat(Flat),
    Bull(Bull),
    Vee(Vee),
    Taper(Taper),
}

impl Profile {
    pub fn of(shape: &Shape) -> Profile {
        let radius = shape.radius_mm();
        match *shape {
            Shape::Ball { .. } => Profile::Ball(Ball { radius }),
            Shape::Flat { .. } => Profile::Flat(Flat { radius }),
            Shape::Bull { corner_radius_mm: corner, .. } => Profile::Bull(Bull { radius, corner }),
            Shape::Vee { included_angle_deg, tip_diameter_mm, .. } => Profile::Vee(Vee {
                radius,
                tip: 0.5 * tip_diameter_mm,
                slope: 1.0 / (0.5 * included_angle_deg).to_radians().tan(),
            }),
            Shape::Taper { tip_diameter_mm, half_angle_deg, .. } => {
                let tip = 0.5 * tip_diameter_mm;
                let (sin, cos) = half_angle_deg.to_radians().sin_cos();
                Profile::Taper(Taper {
                    radius,
                    tip,
                    tangent: tip * cos,
                    tangent_height: tip * (1.0 - sin),
                    slope: cos / sin,
                })
            }
        }
    }
}
