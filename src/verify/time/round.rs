use glam::DVec3;

/// An arc of a program about one of the frame's axes, possibly a helix, as its chords give it back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Round {
    pub to: DVec3,
    /// Halfway along.
    pub middle: DVec3,
    pub length: f64,
    pub radius: f64,
    pub angle: f64,
    /// Unit tangents at its ends.
    pub first: DVec3,
    pub last: DVec3,
    /// Unit vectors towards the centre, from its ends.
    pub inward: [DVec3; 2],
    /// It turns counterclockwise about this axis.
    pub normal: DVec3,
    /// How far it climbs along `normal`.
    pub climb: f64,
    from: DVec3,
}

impl Round {
    /// The point at a share of its way.
    pub fn point(&self, share: f64) -> DVec3 {
        let (sin, cos) = (self.angle * share).sin_cos();
        let (out, along) = (-self.inward[0], self.normal.cross(-self.inward[0]));
        let centre = self.from + self.inward[0] * self.radius;
        centre + (out * cos + along * sin) * self.radius + self.normal * (self.climb * share)
    }

    /// Into how many chords Grbl cuts it: floor(angle r / (2 sqrt(tol (2 r - tol)))).
    pub fn grbl_chords(&self, tolerance: f64) -> u32 {
        let half = (tolerance * (2.0 * self.radius - tolerance)).max(f64::MIN_POSITIVE).sqrt();
        (0.5 * self.angle * self.radius / half).floor().clamp(1.0, 1e8) as u32
    }
}

/// Gathers the chords of an arc.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chords {
    from: DVec3,
    at: DVec3,
    radius: f64,
    count: u32,
    left: u32,
    first: DVec3,
    last: DVec3,
    /// Which axes the chords bend in.
    bent: DVec3,
    side: DVec3,
}

impl Chords {
    pub fn new(from: DVec3, radius: f64, count: u32) -> Chords {
        let none = DVec3::ZERO;
        Chords { from, at: from, radius, count, left: count, first: none, last: none, bent: none, side: none }
    }

    /// Takes the next chord; true with the last.
    pub fn add(&mut self, to: DVec3) -> bool {
        let chord = to - self.at;
        self.at = to;
        if self.left == self.count {
            self.first = chord;
        } else {
            let bend = chord - self.last;
            self.bent += bend * bend;
            self.side += self.last.cross(chord);
        }
        self.last = chord;
        self.left = self.left.saturating_sub(1);
        self.left == 0
    }

    /// The whole arc; None for a single chord, which is a line.
    pub fn round(&self) -> Option<Round> {
        if self.count < 2 || self.radius <= 0.0 {
            return None;
        }
        let bent = self.bent.to_array();
        let upright = (0..3).min_by(|a, b| bent[*a].total_cmp(&bent[*b]))?;
        let side = self.side.to_array()[upright];
        let normal = DVec3::AXES[upright] * if side < 0.0 { -1.0 } else { 1.0 };
        let flat = |v: DVec3| v - normal * v.dot(normal);
        let chord = flat(self.first).length();
        let turn = 2.0 * (0.5 * chord / self.radius).min(1.0).asin();
        let angle = turn * f64::from(self.count);
        let climb = (self.at - self.from).dot(normal);
        let planar = angle * self.radius;
        // A chord's direction is the tangent at its middle.
        let tangent = |chord: DVec3, back: f64| {
            let along = flat(chord).normalize_or_zero();
            let (sin, cos) = back.sin_cos();
            along * cos + normal.cross(along) * sin
        };
        let (start, end) = (tangent(self.first, -0.5 * turn), tangent(self.last, 0.5 * turn));
        let rising = |along: DVec3| (along * planar + normal * climb).normalize_or_zero();
        let mut round = Round {
            to: self.at,
            middle: self.at,
            length: planar.hypot(climb),
            radius: self.radius,
            angle,
            first: rising(start),
            last: rising(end),
            inward: [normal.cross(start), normal.cross(end)],
            normal,
            climb,
            from: self.from,
        };
        round.middle = round.point(0.5);
        Some(round)
    }
}
