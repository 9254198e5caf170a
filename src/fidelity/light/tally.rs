use super::View;
use super::view::BINS;

/// Bins across the hemisphere of all outgoing directions, by (o_x, o_y) from -1 to 1.
pub const ROOM_BINS: usize = 200;

/// Bins of the room that make one bin of the uniformity.
const FINE: usize = ROOM_BINS / BINS;

/// Bins that the audience fills less than this are left out of the uniformity.
const FILLED: f64 = 0.25;

/// Shares of the incident light; they sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    pub on_audience: f64,
    pub leak: f64,
    pub absorbed: f64,
    /// Not followed to its end: after six bounces, into another microfacet, or flat past what is known of the surface.
    pub unresolved: f64,
}

/// Sums of light over the samples seen so far.
#[derive(Clone, Debug)]
pub struct LightTally {
    pub(super) samples: u64,
    /// Samples that the projector does not reach.
    pub(super) shadowed: u64,
    pub(super) drawn: bool,
    pub(super) incident: f64,
    pub(super) on_audience: f64,
    pub(super) leak: f64,
    pub(super) absorbed: f64,
    pub(super) unresolved: f64,
    /// Light by direction, [`ROOM_BINS`] squared: all that leaves, and what meets the audience.
    pub(super) room: Vec<f64>,
    pub(super) met: Vec<f64>,
}

impl Default for LightTally {
    fn default() -> LightTally {
        LightTally {
            samples: 0,
            shadowed: 0,
            drawn: false,
            incident: 0.0,
            on_audience: 0.0,
            leak: 0.0,
            absorbed: 0.0,
            unresolved: 0.0,
            room: vec![0.0; ROOM_BINS * ROOM_BINS],
            met: vec![0.0; ROOM_BINS * ROOM_BINS],
        }
    }
}

impl LightTally {
    /// Adds another tally; the caller keeps the order of blocks so that sums are the same each run.
    pub fn merge(&mut self, other: &LightTally) {
        self.samples += other.samples;
        self.shadowed += other.shadowed;
        self.drawn |= other.drawn;
        self.incident += other.incident;
        self.on_audience += other.on_audience;
        self.leak += other.leak;
        self.absorbed += other.absorbed;
        self.unresolved += other.unresolved;
        for (sum, bin) in self.met.iter_mut().zip(&other.met) {
            *sum += bin;
        }
        for (sum, bin) in self.room.iter_mut().zip(&other.room) {
            *sum += bin;
        }
    }

    /// Takes samples out that are held, as `before`, and puts them in again as `after`.
    pub(super) fn exchange(&mut self, before: &LightTally, after: &LightTally) {
        self.samples = self.samples + after.samples - before.samples;
        self.shadowed = self.shadowed + after.shadowed - before.shadowed;
        let put = |sum: &mut f64, before: f64, after: f64| *sum = (*sum - before + after).max(0.0);
        put(&mut self.incident, before.incident, after.incident);
        put(&mut self.on_audience, before.on_audience, after.on_audience);
        put(&mut self.leak, before.leak, after.leak);
        put(&mut self.absorbed, before.absorbed, after.absorbed);
        put(&mut self.unresolved, before.unresolved, after.unresolved);
        let bins = |sums: &mut [f64], before: &[f64], after: &[f64]| {
            for ((sum, before), after) in sums.iter_mut().zip(before).zip(after) {
                put(sum, *before, *after);
            }
        };
        bins(&mut self.room, &before.room, &after.room);
        bins(&mut self.met, &before.met, &after.met);
    }

    /// The light that fell, and what of it reached the audience, as cosines summed over samples.
    pub fn incident_and_on_audience(&self) -> [f64; 2] {
        [self.incident, self.on_audience]
    }

    /// Shares of the incident light, or None before any light fell.
    pub fn shares(&self) -> Option<Shares> {
        (self.incident > 0.0).then(|| Shares {
            on_audience: self.on_audience / self.incident,
            leak: self.leak / self.incident,
            absorbed: self.absorbed / self.incident,
            unresolved: self.unresolved / self.incident,
        })
    }

    /// Standard error of the share on the audience where directions are drawn: that of as many independent draws as
    /// there are samples, which is more than it is.
    pub fn standard_error(&self) -> Option<f64> {
        let share = self.shares()?.on_audience;
        self.drawn.then(|| (share * (1.0 - share) / self.samples as f64).sqrt())
    }

    /// Part of the samples that the projector does not reach.
    pub fn shadowed_fraction(&self) -> Option<f64> {
        (self.samples > 0).then(|| self.shadowed as f64 / self.samples as f64)
    }

    /// Gain in each bin of direction, [`ROOM_BINS`] squared by (o_x, o_y), lowest y first.
    pub fn room_gain(&self) -> Vec<f64> {
        let bin_sr = (2.0 / ROOM_BINS as f64).powi(2);
        let per_sr = std::f64::consts::PI / (bin_sr * self.incident);
        self.room.iter().map(|flux| flux * per_sr).collect()
    }

    /// Mean luminance over the audience, far field, relative to a Lambertian of reflectance 1:
    /// pi * share / L, with L of Eq. 9.
    pub fn gain(&self, view: &View) -> Option<f64> {
        let shares = self.shares()?;
        (view.projected_sr > 0.0).then(|| std::f64::consts::PI * shares.on_audience / view.projected_sr)
    }

    /// 1 - (standard deviation / mean) of the luminance over the bins of direction that the audience fills.
    pub fn uniformity(&self, view: &View) -> Option<f64> {
        let bin_sr = (2.0 / BINS as f64).powi(2);
        let mut bins = vec![0.0; BINS * BINS];
        for (at, flux) in self.met.iter().enumerate() {
            bins[at % ROOM_BINS / FINE + BINS * (at / ROOM_BINS / FINE)] += flux;
        }
        let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (flux, area) in bins.iter().zip(&view.bins_sr) {
            if *area < FILLED * bin_sr {
                continue;
            }
            let luminance = flux / area;
            weight += area;
            sum += area * luminance;
            squares += area * luminance * luminance;
        }
        let mean = sum / weight;
        (mean > 0.0).then(|| 1.0 - (squares / weight - mean * mean).max(0.0).sqrt() / mean)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::super::lit::Lit;
    use super::super::{Metal, Pose, Room, body};
    use super::*;
    use crate::fidelity::pixels::Pixels;
    use crate::grid::{Heights, Window};
    use crate::optics::{ComplexIndex, Reflectance};
    use crate::screen::Polyhedron;

    const ALUMINIUM: ComplexIndex = ComplexIndex { n: 1.0, k: 6.4 };

    fn heights(window: Window, z_mm: impl Fn(f64, f64) -> f64) -> Heights {
        let mut heights = Heights::empty(window);
        for (index, z) in heights.z_mm.iter_mut().enumerate() {
            let column = window.column + (index % window.columns) as i64;
            let row = window.row + (index / window.columns) as i64;
            *z = z_mm((column as f64 + 0.5) * 0.01, (row as f64 + 0.5) * 0.01) as f32;
        }
        heights
    }

    fn light(heights: &Heights, metal: Metal, audience: &[Polyhedron]) -> LightTally {
        let window = heights.window;
        let inner = Window {
            column: window.column + 1,
            row: window.row + 1,
            columns: window.columns - 2,
            rows: window.rows - 2,
        };
        let pose = Pose { origin_m: DVec3::ZERO, rotation: DMat3::IDENTITY };
        let projector_m = DVec3::new(0.0, 0.0, 1e4);
        let room = Room { projector_m, audience, metal, steepest: 0.5, far_field: None };
        let mut tally = LightTally::default();
        tally.add(heights, inner, 0.01, &pose, &room, None);
        tally
    }

    fn sum(shares: Shares) -> f64 {
        shares.on_audience + shares.leak + shares.absorbed + shares.unresolved
    }

    #[test]
    fn a_flat_mirror_sends_everything_one_way() {
        let window = Window { column: 0, row: 0, columns: 34, rows: 34 };
        let tilted = heights(window, |x, _| 0.2 * x);
        let n = DVec3::new(-0.2, 0.0, 1.0).normalize();
        let out = 2.0 * n.z * n - DVec3::Z;
        let metal = Metal::new(Reflectance::Metal(ALUMINIUM), None, 0.0);
        let tally = light(&tilted, metal, &[body(3.0 * out, 0.01)]);
        let shares = tally.shares().expect("light fell");
        let reflected = ALUMINIUM.reflectance(n.z);
        assert!((shares.on_audience - reflected).abs() < 1e-6, "{shares:?}");
        assert!((sum(shares) - 1.0).abs() < 1e-12);
        assert_eq!(tally.standard_error(), None);
        let constant = Metal::new(Reflectance::Constant(0.7), None, 0.0);
        let even = light(&tilted, constant, &[body(3.0 * out, 0.01)]).shares().expect("light fell");
        assert!((even.on_audience - 0.7).abs() < 1e-6 && (even.absorbed - 0.3).abs() < 1e-6, "{even:?}");
        let beside = light(&tilted, metal, &[body(3.0 * out + DVec3::new(0.05, 0.0, 0.0), 0.01)]);
        assert!(beside.shares().expect("light fell").on_audience == 0.0);
    }

    #[test]
    fn a_matte_surface_has_gain_one() {
        let window = Window { column: 0, row: 0, columns: 502, rows: 502 };
        // A perfect reflector: n = 0.01, k = 100 reflects 0.99999.
        let metal = Metal::new(Reflectance::Metal(ComplexIndex { n: 0.01, k: 100.0 }), None, 1.0);
        let audience = [body(DVec3::new(0.8, 0.3, 3.0), 0.9)];
        let tally = light(&heights(window, |_, _| 0.0), metal, &audience);
        let view = View::from_points(&[DVec3::ZERO], &|p, o| audience[0].hit(p, o));
        let gain = tally.gain(&view).expect("light fell");
        assert!((gain - 1.0).abs() < 0.02, "{gain}");
        let error = tally.standard_error().expect("drawn");
        assert!(error > 1e-4 && error < 2e-3, "{error}");
        assert!((sum(tally.shares().expect("light fell")) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn light_is_kept_whatever_it_meets() {
        let window = Window { column: 0, row: 0, columns: 202, rows: 202 };
        // Grooves of 45 degrees send light twice round.
        let grooves = heights(window, |x, _| ((x / 0.4).fract() - 0.5).abs() * 0.4);
        let audience = [body(DVec3::new(0.0, 0.0, 3.0), 0.2)];
        for metal in [
            Metal::new(Reflectance::Metal(ALUMINIUM), None, 0.0),
            Metal::new(Reflectance::Metal(ALUMINIUM), Some(0.2), 0.05),
            Metal::new(Reflectance::Metal(ALUMINIUM), Some(0.7), 0.0),
        ] {
            let shares = light(&grooves, metal, &audience).shares().expect("light fell");
            assert!((sum(shares) - 1.0).abs() < 1e-9, "{shares:?}");
        }
        let mirror = light(&grooves, Metal::new(Reflectance::Metal(ALUMINIUM), None, 0.0), &audience);
        let shares = mirror.shares().expect("light fell");
        // Two reflections at 45 degrees bring it straight back, but where a ridge or a bottom lies between samples.
        let twice = ALUMINIUM.reflectance(0.5f64.sqrt()).powi(2);
        assert!((shares.on_audience - twice).abs() < 0.12, "{shares:?} {twice}");
    }

    #[test]
    fn samples_together_are_samples_by_themselves() {
        let window = Window { column: -7, row: 3, columns: 330, rows: 70 };
        let mut steps =
            heights(window, |x, y| 0.02 * (9.0 * x).sin() * (7.0 * y).cos() + 0.03 * (2.0 * x).floor());
        steps.z_mm[330 * 40 + 100] = f32::NAN;
        let audience = [body(DVec3::new(0.3, 0.1, 3.0), 0.4), body(DVec3::new(-1.0, 0.2, 3.5), 0.5)];
        let rotation = DMat3::from_rotation_x(0.1) * DMat3::from_rotation_y(-0.15);
        let pose = Pose { origin_m: DVec3::new(0.1, -0.2, 0.05), rotation };
        let metal = Metal::new(Reflectance::Metal(ALUMINIUM), None, 0.0);
        let projector_m = DVec3::new(0.2, 0.1, 3.0);
        let room = Room { projector_m, audience: &audience, metal, steepest: 0.3, far_field: None };
        let inner = Window { column: -6, row: 4, columns: 328, rows: 68 };
        let mut together = LightTally::default();
        together.add(&steps, inner, 0.01, &pose, &room, None);
        let lit = Lit::new(&steps, inner, 0.01, &pose, &room).expect("data");
        let mut alone = LightTally::default();
        for row in inner.row..inner.row_end() {
            for column in inner.column..inner.column_end() {
                lit.sample(&mut alone, column, row);
            }
        }
        assert_eq!((together.samples, together.shadowed), (alone.samples, alone.shadowed));
        let (a, b) = (together.shares().expect("light fell"), alone.shares().expect("light fell"));
        for (a, b) in [
            (a.on_audience, b.on_audience),
            (a.leak, b.leak),
            (a.absorbed, b.absorbed),
            (a.unresolved, b.unresolved),
        ] {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
        assert!(a.on_audience > 0.005 && a.leak > 0.05, "{a:?}");
        let apart: f64 = together.room.iter().zip(&alone.room).map(|(a, b)| (a - b).abs()).sum();
        assert!(apart < 1e-6 * together.incident, "{apart}");
    }

    #[test]
    fn a_map_holds_what_the_sums_hold() {
        let window = Window { column: 0, row: 0, columns: 120, rows: 90 };
        let bumps = heights(window, |x, y| 0.01 * (20.0 * x).sin() * (15.0 * y).cos());
        let audience = [body(DVec3::new(0.0, 0.0, 3.0), 0.3)];
        let pose = Pose { origin_m: DVec3::ZERO, rotation: DMat3::IDENTITY };
        let metal = Metal::new(Reflectance::Metal(ALUMINIUM), None, 0.0);
        let projector_m = DVec3::new(0.0, 0.0, 5.0);
        let room = Room { projector_m, audience: &audience, metal, steepest: 0.3, far_field: None };
        let (mut tally, mut map) = (LightTally::default(), Pixels::new(120, 90, 50));
        for column in [0, 64] {
            let part = Window { column, columns: if column == 0 { 64 } else { 56 }, ..window };
            tally.add(&bumps, part, 0.01, &pose, &room, Some(&mut map));
        }
        assert_eq!((map.factor, map.columns, map.rows), (3, 40, 30));
        let [on_audience, incident] = map.total();
        assert!((incident - tally.incident).abs() < 1e-9 * tally.incident);
        assert!((on_audience - tally.on_audience).abs() < 1e-9 * tally.incident);
        let room: f64 = tally.room.iter().sum();
        assert!((room - tally.on_audience - tally.leak).abs() < 1e-9 * tally.incident);
    }
}
