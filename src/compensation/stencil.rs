use super::Profile;
use super::lanes::{LANES, NONE};
use super::profile::REACH_MM;

/// No data between the values of two rows, so that groups of lanes may run over the ends of a row.
const PADDING: usize = 3 * LANES;

/// One row of a stencil: the samples dx in `lo ..= hi` columns from the cutter's axis, of which
/// `flat_lo ..= flat_hi` lie under its flat bottom. Empty when lo > hi.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    pub lo: i32,
    pub hi: i32,
    pub flat_lo: i32,
    pub flat_hi: i32,
    /// s(dx) stands at `base - dx` of the stencil's values: reversed, because the cutter
    /// positions that one sample touches run against dx.
    base: usize,
}

impl Arc {
    /// Its columns as two spans, either of which may be empty; without those under the flat
    /// bottom if these are to be left out.
    #[inline(always)]
    pub fn spans(&self, skip_flat: bool) -> [[i32; 2]; 2] {
        if skip_flat && self.flat_lo <= self.flat_hi {
            [[self.lo, self.flat_lo - 1], [self.flat_hi + 1, self.hi]]
        } else {
            [[self.lo, self.hi], [1, 0]]
        }
    }
}

/// s(d) in f32 on a lattice of offsets that is off the whole pitches by a fraction: entry (k, dx)
/// is for a sample ((dx + fx), (k + fy)) pitches from the cutter's axis.
#[derive(Clone, Debug)]
pub(super) struct Stencil {
    pub fx: f64,
    pub fy: f64,
    first: i64,
    /// From a row's values to those of the next; all else is no data.
    stride: usize,
    arcs: Vec<Arc>,
    values: Vec<f32>,
    /// More than rounding can shift the difference of two entries, in mm.
    pub slack_mm: f32,
}

/// An arc with its values.
#[derive(Clone, Copy)]
pub(super) struct ArcRef<'a> {
    pub arc: Arc,
    pub values: &'a [f32],
}

impl ArcRef<'_> {
    /// s at a column of this arc.
    #[inline(always)]
    pub fn s(&self, dx: i32) -> f32 {
        self.values[(self.arc.base as i64 - dx as i64) as usize]
    }

    /// Where s(dx) stands in `values`; larger dx come before it. dx may lie 2 LANES outside.
    #[inline(always)]
    pub fn index(&self, dx: i32) -> usize {
        (self.arc.base as i64 - dx as i64) as usize
    }
}

impl Stencil {
    pub fn new(profile: &Profile, fx: f64, fy: f64) -> Stencil {
        let step_mm = profile.step_mm();
        let reach = profile.reach() as i64 + 1;
        let plateau_mm = profile.plateau_mm();
        let mut arcs = Vec::new();
        let columns = 2 * reach as usize + 1;
        let stride = columns + PADDING;
        let mut values = vec![NONE; PADDING + columns * stride];
        let mut deepest = 0.0f32;
        for (row, k) in (-reach..=reach).enumerate() {
            let dy_mm = (k as f64 + fy) * step_mm;
            let (mut lo, mut hi, mut flat_lo, mut flat_hi) = (1, 0, 1, 0);
            let base = PADDING + row * stride + reach as usize;
            for dx in -reach..=reach {
                let dx_mm = (dx as f64 + fx) * step_mm;
                let distance_mm = (dx_mm * dx_mm + dy_mm * dy_mm).sqrt();
                let Some(s_mm) = profile.s_mm(distance_mm) else { continue };
                if lo > hi {
                    lo = dx as i32;
                }
                hi = dx as i32;
                values[(base as i64 - dx) as usize] = s_mm as f32;
                deepest = deepest.min(s_mm as f32);
                if s_mm == 0.0 && distance_mm <= plateau_mm + REACH_MM {
                    if flat_lo > flat_hi {
                        flat_lo = dx as i32;
                    }
                    flat_hi = dx as i32;
                }
            }
            arcs.push(Arc { lo, hi, flat_lo, flat_hi, base });
        }
        Stencil { fx, fy, first: -reach, stride, arcs, values, slack_mm: 4.0 * deepest.abs() * f32::EPSILON }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice()) + size_of_val(self.arcs.as_slice())
    }

    /// All values, where s(0) of the axis' own row stands in them, and how far from a row to the next: s(dx) of row k stands
    /// at `origin + k stride - dx`, for k as far as one row out of reach and dx as far as 2 LANES.
    #[inline(always)]
    pub fn values(&self) -> (&[f32], i32, i32) {
        (&self.values, self.arc_there(0).index(0) as i32, self.stride as i32)
    }

    /// The samples k rows above the axis.
    #[inline(always)]
    pub fn arc(&self, k: i64) -> Option<ArcRef<'_>> {
        let arc = *self.arcs.get(usize::try_from(k - self.first).ok()?)?;
        (arc.lo <= arc.hi).then_some(ArcRef { arc, values: &self.values })
    }

    /// As [`Stencil::arc`], of a row that is within reach.
    #[inline(always)]
    pub fn arc_there(&self, k: i32) -> ArcRef<'_> {
        ArcRef { arc: self.arcs[(i64::from(k) - self.first) as usize], values: &self.values }
    }
}
