use super::ball::{Ball, Reachable};
use super::blocks::{Lanes, ROWS};
use super::lanes::{LANES, Vectors};
use super::runs::Offsets;
use super::sweep::{Moderate, Sides, Slopes, Sweeper, size, steep_start};
use std::marker::PhantomData;

/// The boxes of samples, lane by lane: offsets at which each can touch.
pub(super) struct Boxes<V: Vectors> {
    pub x_low: [[f32; LANES]; ROWS],
    pub x_high: [[f32; LANES]; ROWS],
    pub y_low: [[f32; LANES]; ROWS],
    pub y_high: [[f32; LANES]; ROWS],
    /// Samples with a box.
    pub boxed: [u16; ROWS],
    /// Rows whose samples are bounded one by one, counted since it was last asked.
    pub bounded: usize,
    vectors: PhantomData<V>,
}

impl<V: Vectors> Boxes<V> {
    pub fn new() -> Boxes<V> {
        let none = [[0.0; LANES]; ROWS];
        Boxes {
            x_low: none,
            x_high: none,
            y_low: none,
            y_high: none,
            boxed: [0; ROWS],
            bounded: 0,
            vectors: PhantomData,
        }
    }

    /// Those of the samples `of` these lanes; `whole` rounds boxes to the lattice inwards.
    #[inline(always)]
    pub fn fill(
        &mut self,
        lanes: &Lanes,
        of: &[u16; ROWS],
        ball: &Ball,
        moderate: &Option<Moderate>,
        whole: bool,
    ) {
        let scale = V::splat((1.0 / ball.step_mm) as f32);
        let sweeper = Sweeper::<V>::new(ball);
        // Nothing is steeper than what moderate slopes are, without any.
        let steepest = V::splat(moderate.as_ref().map_or(-1.0, |moderate| moderate.steepest));
        for (r, &bits) in of.iter().enumerate() {
            self.boxed[r] = 0;
            if bits == 0 {
                continue;
            }
            self.bounded += 1;
            let x_next = V::multiply(V::load(&lanes.x_next[r]), scale);
            let x_before = V::multiply(V::load(&lanes.x_before[r]), scale);
            let y_next = V::multiply(V::load(&lanes.y_next[r]), scale);
            let y_before = V::multiply(V::load(&lanes.y_before[r]), scale);
            let x_size = V::greater(size::<V>(x_next), size::<V>(x_before));
            let y_size = V::greater(size::<V>(y_next), size::<V>(y_before));
            let of_moderate = bits & V::at_least(steepest, V::greater(x_size, y_size));
            let steep = bits & !of_moderate;
            if let Some(moderate) = moderate
                && of_moderate != 0
            {
                let mut at = moderate.start::<V>(x_next, x_before, y_next, y_before);
                let around = at.rounded(whole);
                if of_moderate & around.there() != 0 {
                    let slopes = Slopes::<V>::new(x_next, x_before, y_next, y_before);
                    for _ in 0..moderate.sweeps {
                        slopes.sweep(&mut at, &sweeper);
                    }
                    self.put(r, of_moderate, &at.rounded(whole));
                }
            }
            if steep != 0 {
                self.bounded += 1;
                let radius = V::splat(ball.radius as f32);
                let start = V::splat((1.0 + ball.room()) as f32);
                let mut at = steep_start::<V>(radius, start, [x_next, x_before, y_next, y_before]);
                let slopes = Slopes::<V>::new(x_next, x_before, y_next, y_before);
                for _ in 0..4 {
                    slopes.sweep(&mut at, &sweeper);
                }
                self.put(r, steep, &at.rounded(whole));
            }
        }
    }

    /// Takes the boxes of some samples of a row.
    #[inline(always)]
    fn put(&mut self, r: usize, bits: u16, at: &Sides<V>) {
        self.boxed[r] |= bits & at.there();
        V::store(V::choose(bits, at.x_low, V::load(&self.x_low[r])), &mut self.x_low[r]);
        V::store(V::choose(bits, at.x_high, V::load(&self.x_high[r])), &mut self.x_high[r]);
        V::store(V::choose(bits, at.y_low, V::load(&self.y_low[r])), &mut self.y_low[r]);
        V::store(V::choose(bits, at.y_high, V::load(&self.y_high[r])), &mut self.y_high[r]);
    }

    /// The box of one sample.
    #[inline(always)]
    pub fn at(&self, r: usize, lane: usize) -> Reachable {
        Reachable {
            x: [f64::from(self.x_low[r][lane]), f64::from(self.x_high[r][lane])],
            y: [f64::from(self.y_low[r][lane]), f64::from(self.y_high[r][lane])],
        }
    }

    /// The box of one sample, whose offsets are whole.
    #[inline(always)]
    pub fn offsets(&self, r: usize, lane: usize) -> Offsets {
        Offsets {
            x: [self.x_low[r][lane] as i32, self.x_high[r][lane] as i32],
            y: [self.y_low[r][lane] as i32, self.y_high[r][lane] as i32],
        }
    }

    /// The samples of small boxes.
    #[inline(always)]
    pub fn small(&self, rows: usize, most: f32) -> [u16; ROWS] {
        let most = V::splat(most);
        let mut small = [0; ROWS];
        for (r, small) in small.iter_mut().enumerate().take(rows) {
            if self.boxed[r] != 0 {
                let width = V::subtract(V::load(&self.x_high[r]), V::load(&self.x_low[r]));
                let height = V::subtract(V::load(&self.y_high[r]), V::load(&self.y_low[r]));
                *small = self.boxed[r] & V::at_least(most, V::greater(width, height));
            }
        }
        small
    }

    /// The samples among `of` whose boxes lie within `around`.
    #[inline(always)]
    pub fn within(&self, of: &[u16; ROWS], around: &Reachable) -> [u16; ROWS] {
        let (x_low, x_high) = (V::splat(around.x[0] as f32), V::splat(around.x[1] as f32));
        let (y_low, y_high) = (V::splat(around.y[0] as f32), V::splat(around.y[1] as f32));
        let mut within = [0; ROWS];
        for r in 0..ROWS {
            if of[r] != 0 {
                within[r] = of[r]
                    & V::at_least(V::load(&self.x_low[r]), x_low)
                    & V::at_least(x_high, V::load(&self.x_high[r]))
                    & V::at_least(V::load(&self.y_low[r]), y_low)
                    & V::at_least(y_high, V::load(&self.y_high[r]));
            }
        }
        within
    }

    /// The samples whose boxes have anything in common with `with`.
    #[inline(always)]
    pub fn overlapping(&self, with: &Reachable) -> [u16; ROWS] {
        let (x_low, x_high) = (V::splat(with.x[0] as f32), V::splat(with.x[1] as f32));
        let (y_low, y_high) = (V::splat(with.y[0] as f32), V::splat(with.y[1] as f32));
        let mut these = [0; ROWS];
        for (r, these) in these.iter_mut().enumerate() {
            if self.boxed[r] != 0 {
                *these = self.boxed[r]
                    & V::at_least(x_high, V::load(&self.x_low[r]))
                    & V::at_least(V::load(&self.x_high[r]), x_low)
                    & V::at_least(y_high, V::load(&self.y_low[r]))
                    & V::at_least(V::load(&self.y_high[r]), y_low);
            }
        }
        these
    }

    /// The box around those of some samples.
    #[inline(always)]
    pub fn hull(&self, of: &[u16; ROWS]) -> Reachable {
        let (mut x_low, mut x_high) = (V::splat(f32::MAX), V::splat(f32::MIN));
        let (mut y_low, mut y_high) = (x_low, x_high);
        for (r, &bits) in of.iter().enumerate() {
            if bits != 0 {
                x_low = V::choose(bits, V::less(x_low, V::load(&self.x_low[r])), x_low);
                x_high = V::choose(bits, V::greater(x_high, V::load(&self.x_high[r])), x_high);
                y_low = V::choose(bits, V::less(y_low, V::load(&self.y_low[r])), y_low);
                y_high = V::choose(bits, V::greater(y_high, V::load(&self.y_high[r])), y_high);
            }
        }
        Reachable {
            x: [f64::from(V::least(x_low)), f64::from(V::most(x_high))],
            y: [f64::from(V::least(y_low)), f64::from(V::most(y_high))],
        }
    }
}
