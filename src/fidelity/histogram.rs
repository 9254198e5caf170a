//! Counts of a quantity that is never negative, from which any percentile can be read.

use super::rounding::to_u32;

/// Bins of a page; a page is held only once something falls into it.
const PAGE: usize = 4096;
/// Values below 2^LINEAR_BITS quanta keep a bin each.
const LINEAR_BITS: u32 = 20;
/// Every doubling above is cut into 2^(LINEAR_BITS - 1) bins.
const HALF: u64 = 1 << (LINEAR_BITS - 1);
const PAST_LINEAR: f64 = (1u64 << LINEAR_BITS) as f64;
/// Values whose bins are worked out together.
const TOGETHER: usize = 128;
/// Past 2^TOP_BITS quanta everything shares the last bin.
const TOP_BITS: u32 = 40;

/// A histogram of whole quanta: each value has its own bin below 2^20 quanta, and bins no wider than one part
/// in 2^19 above. Adding and merging are integer sums, so the order of work cannot change it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Histogram {
    pages: Vec<Option<Box<[u64]>>>,
    count: u64,
}

impl Histogram {
    /// Counts a value given in quanta, rounded to the nearest; negative and NaN count as 0.
    pub fn add(&mut self, quanta: f64) {
        // By way of i64: plain x86-64 has no conversion to unsigned.
        let bin = bin_of((quanta + 0.5).max(0.0) as i64 as u64);
        self.page(bin / PAGE)[bin % PAGE] += 1;
        self.count += 1;
    }

    /// Counts as [`Histogram::add`] does, many at once. What rounds to 0 costs next to nothing: most of a closing is
    /// the design itself, and one bin raised again and again waits for itself.
    pub fn add_all(&mut self, quanta: &[f64]) {
        let (mut bins, mut above) = ([0u32; TOGETHER], [0u8; TOGETHER]);
        for quanta in quanta.chunks(TOGETHER) {
            let bins = &mut bins[..quanta.len()];
            let to = &mut *bins;
            pulp::Arch::new().dispatch(move || {
                for (bin, quanta) in to.iter_mut().zip(quanta) {
                    let bounded = if *quanta > 0.0 { *quanta } else { 0.0 };
                    let bounded = if bounded < PAST_LINEAR { bounded } else { PAST_LINEAR };
                    *bin = to_u32((bounded + 0.5).floor());
                }
            });
            let mut kept = 0;
            for (k, &bin) in bins.iter().enumerate() {
                above[kept] = k as u8;
                kept += usize::from(bin != 0);
            }
            let zeros = quanta.len() - kept;
            if zeros > 0 {
                self.page(0)[0] += zeros as u64;
                self.count += zeros as u64;
            }
            let mut above = above[..kept].iter().map(|k| usize::from(*k)).peekable();
            while let Some(k) = above.next() {
                let page = bins[k] as usize / PAGE;
                if page >= PAST_LINEAR as usize / PAGE {
                    self.add(quanta[k]);
                    continue;
                }
                let counts = self.page(page);
                counts[bins[k] as usize % PAGE] += 1;
                let mut counted = 1;
                while let Some(k) = above.next_if(|&k| bins[k] as usize / PAGE == page) {
                    counts[bins[k] as usize % PAGE] += 1;
                    counted += 1;
                }
                self.count += counted;
            }
        }
    }

    fn page(&mut self, page: usize) -> &mut [u64] {
        if page >= self.pages.len() {
            self.pages.resize(page + 1, None);
        }
        self.pages[page].get_or_insert_with(|| vec![0; PAGE].into_boxed_slice())
    }

    /// Takes over everything another one counted.
    pub fn merge(&mut self, other: &Histogram) {
        if other.pages.len() > self.pages.len() {
            self.pages.resize(other.pages.len(), None);
        }
        for (mine, theirs) in self.pages.iter_mut().zip(&other.pages) {
            match (mine.as_mut(), theirs) {
                (_, None) => {}
                (None, Some(page)) => *mine = Some(page.clone()),
                (Some(mine), Some(page)) => mine.iter_mut().zip(page.iter()).for_each(|(a, b)| *a += b),
            }
        }
        self.count += other.count;
    }

    /// How many values were counted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The smallest value that at least `fraction` of all values do not exceed (nearest rank), in quanta;
    /// `None` when nothing was counted.
    pub fn percentile(&self, fraction: f64) -> Option<f64> {
        if self.count == 0 {
            return None;
        }
        let rank = ((fraction * self.count as f64).ceil() as u64).clamp(1, self.count);
        let mut seen = 0;
        for (number, page) in self.pages.iter().enumerate() {
            for (offset, &count) in page.iter().flat_map(|page| page.iter().enumerate()) {
                seen += count;
                if seen >= rank {
                    return Some(value_of(number * PAGE + offset));
                }
            }
        }
        None
    }
}

fn bin_of(quanta: u64) -> usize {
    if quanta < 1 << LINEAR_BITS {
        return quanta as usize;
    }
    let quanta = quanta.min((1 << TOP_BITS) - 1);
    let octave = quanta.ilog2() - LINEAR_BITS;
    let within = (quanta >> (octave + 1)) - HALF;
    ((1 << LINEAR_BITS) + u64::from(octave) * HALF + within) as usize
}

/// The middle of a bin.
fn value_of(bin: usize) -> f64 {
    let bin = bin as u64;
    if bin < 1 << LINEAR_BITS {
        return bin as f64;
    }
    let above = bin - (1 << LINEAR_BITS);
    let width = (1u64 << (above / HALF + 1)) as f64;
    (above % HALF + HALF) as f64 * width + 0.5 * (width - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_comes_back_within_its_bin() {
        for exponent in 0..40 {
            for near in [0u64, 1, 2, 77] {
                let quanta = (1u64 << exponent) + near;
                let back = value_of(bin_of(quanta));
                let allowed = if quanta < 1 << 20 { 0.0 } else { quanta as f64 / (1 << 19) as f64 };
                assert!((back - quanta as f64).abs() <= allowed, "{quanta} came back as {back}");
            }
        }
        assert_eq!(bin_of(u64::MAX), bin_of((1 << 40) - 1));
    }

    #[test]
    fn many_at_once_are_the_same() {
        let mut values: Vec<f64> = (0..3000).map(|i| f64::from(i * i % 7919) * 211.3).collect();
        values.extend([f64::NAN, -3.0, 0.5, 1e15, f64::INFINITY, 1_048_575.5, 1_048_576.0]);
        let (mut one_by_one, mut at_once) = (Histogram::default(), Histogram::default());
        values.iter().for_each(|value| one_by_one.add(*value));
        at_once.add_all(&values);
        assert_eq!(one_by_one, at_once);
    }

    #[test]
    fn a_percentile_is_the_nearest_rank() {
        let mut histogram = Histogram::default();
        for value in [5.0, 1.0, 3.0, 2_000_000.0] {
            histogram.add(value);
        }
        assert_eq!(histogram.percentile(0.5), Some(3.0));
        assert_eq!(histogram.percentile(0.75), Some(5.0));
        assert_eq!(histogram.percentile(0.0), Some(1.0));
        assert!((histogram.percentile(0.99).expect("counted") - 2e6).abs() < 4.0);
        assert_eq!(Histogram::default().percentile(0.5), None);
    }
}
