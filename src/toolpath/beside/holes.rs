use std::f64::consts::TAU;

use super::super::pen::Pen;
use super::super::{Error, Site, Toolpath};
use crate::cutter::Shape;

/// Chords of a bored hole run up to this far inside its circle, in mm.
const CHORD_MM: f64 = 0.001;

/// Holes that are drilled, or bored where they are wider than the cutter.
#[derive(Clone, Debug, PartialEq)]
pub struct Holes {
    pub shape: Shape,
    /// Their middles, in the frame of the face that is up.
    pub at_mm: Vec<[f64; 2]>,
    /// The cutter's own if left out.
    pub diameter_mm: Option<f64>,
    /// Below the face.
    pub depth_mm: f64,
    /// Of a peck, or of a turn of boring.
    pub stepdown_mm: f64,
    /// Most that may be cut below the face: the blank and the board under it.
    pub most_mm: f64,
    /// Width of the slot that is cut around the tile in another operation; 0 without one.
    pub slot_mm: f64,
    /// Whether the tile's surface is on this face, so that no hole may lie in it.
    pub faces_up: bool,
}

/// Plans the holes in their order, each from the top down.
pub fn holes(site: &Site, params: &Holes) -> Result<Toolpath, Error> {
    site.validate(0.0)?;
    let own_mm = 2.0 * params.shape.radius_mm();
    let diameter_mm = params.diameter_mm.unwrap_or(own_mm);
    // From twice the cutter's diameter on a core would stay.
    if !(diameter_mm >= own_mm && diameter_mm <= 2.0 * own_mm) {
        return Err(Error::Bore {
            diameter_mm,
            cutter: params.shape.to_string(),
            least_mm: own_mm,
            most_mm: 2.0 * own_mm,
        });
    }
    if params.depth_mm > params.most_mm + 1e-9 {
        return Err(Error::Deep { depth_mm: params.depth_mm, most_mm: params.most_mm });
    }
    let stepdown_mm = params.stepdown_mm;
    if stepdown_mm.is_nan() || stepdown_mm < site.unit_mm {
        return Err(Error::Stepdown { stepdown_mm, unit_mm: site.unit_mm });
    }
    let mut pen = Pen::new(site);
    for &at_mm in &params.at_mm {
        params.check(site, at_mm, diameter_mm)?;
        let turn_mm = 0.5 * (diameter_mm - own_mm);
        if turn_mm < site.unit_mm {
            drill(site, params, at_mm, &mut pen);
        } else {
            bore(site, params, at_mm, turn_mm, &mut pen);
        }
    }
    Ok(pen.finish())
}

impl Holes {
    fn check(&self, site: &Site, at_mm: [f64; 2], diameter_mm: f64) -> Result<(), Error> {
        let lattice = site.surface.lattice();
        let size_mm = [lattice.width_mm, lattice.height_mm];
        let radius = 0.5 * diameter_mm;
        let refused = |problem, hint| Err(Error::Hole { diameter_mm, at_mm, problem, hint });
        let past = (0..2)
            .map(|axis| {
                (-site.margin_mm - (at_mm[axis] - radius))
                    .max(at_mm[axis] + radius - size_mm[axis] - site.margin_mm)
            })
            .fold(f64::NEG_INFINITY, f64::max);
        if past > 1e-9 {
            let problem = format!("goes {past:.3} mm past the edge of the blank");
            return refused(problem, "more margin_mm, or a smaller hole");
        }
        let out = |axis: usize| (-at_mm[axis]).max(at_mm[axis] - size_mm[axis]).max(0.0);
        let away_mm = out(0).hypot(out(1));
        if self.faces_up && away_mm - radius < -1e-9 {
            let problem = format!("reaches {:.3} mm into the tile", radius - away_mm);
            return refused(problem, "move it into the margin, more margin_mm, or face = \"underside\"");
        }
        let inside = |axis: usize| at_mm[axis].min(size_mm[axis] - at_mm[axis]);
        let opened = match away_mm > 0.0 {
            true => away_mm - radius < self.slot_mm - 1e-9,
            false => inside(0).min(inside(1)) < radius,
        };
        if self.slot_mm > 0.0 && opened {
            let problem = format!("is cut open by the slot of {} mm around the tile", self.slot_mm);
            return refused(problem, "move it, or more margin_mm");
        }
        Ok(())
    }

    /// Depths below the face at which pecks or turns end.
    fn levels(&self) -> impl Iterator<Item = f64> + '_ {
        let count = (self.depth_mm / self.stepdown_mm - 1e-9).ceil().max(1.0) as usize;
        (1..=count).map(move |k| self.depth_mm * k as f64 / count as f64)
    }
}

fn drill(site: &Site, params: &Holes, at_mm: [f64; 2], pen: &mut Pen) {
    let top_mm = site.top_allowance_mm;
    for (peck, depth_mm) in params.levels().enumerate() {
        let to = site.nearest(at_mm, top_mm - depth_mm);
        if peck == 0 {
            pen.begin(to, pen.top());
        } else {
            pen.peck();
            pen.cut(to);
        }
    }
}

/// Turns down counterclockwise, so that the wall is on the right and the cutter climbs.
fn bore(site: &Site, params: &Holes, at_mm: [f64; 2], turn_mm: f64, pen: &mut Pen) {
    let top_mm = site.top_allowance_mm;
    let half = (1.0 - (CHORD_MM / turn_mm).min(0.5)).acos();
    let chords = (0.5 * TAU / half).ceil().max(8.0) as usize;
    let point = |chord: usize, z_mm: f64| {
        let (sine, cosine) = (TAU * (chord % chords) as f64 / chords as f64).sin_cos();
        site.nearest([at_mm[0] + turn_mm * cosine, at_mm[1] + turn_mm * sine], z_mm)
    };
    pen.begin(point(0, top_mm), pen.top());
    let mut from_mm = 0.0;
    for depth_mm in params.levels() {
        for chord in 1..=chords {
            let part = chord as f64 / chords as f64;
            pen.cut(point(chord, top_mm - from_mm - (depth_mm - from_mm) * part));
        }
        from_mm = depth_mm;
    }
    for chord in 1..=chords {
        pen.cut(point(chord, top_mm - from_mm));
    }
    // Away from the wall before the cutter is drawn out.
    pen.cut(site.nearest(at_mm, top_mm - from_mm));
}
