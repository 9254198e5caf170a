//! The linear system of a Newton step: the graph Laplacian of neighbouring planes.

use std::sync::Once;

use faer::prelude::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Par, Side};

/// Most products that the envelope's factorisation may take; beyond, a sparse one with a
/// fill-reducing order is tried. Planes that spread over the square stay far below, a plane that
/// borders on most of two thousand others does not.
const MOST_PRODUCTS: usize = 100_000_000;

/// Sums that are kept apart in a scalar product, so that it vectorises.
const LANES: usize = 4;

/// A symmetric matrix of non-positive couplings with rows that sum to zero, factored within its
/// envelope: row i is kept from its first coupling to the diagonal. The unknowns come in the order of their
/// planes along one axis, in which a plane and its neighbours stand within about a column of
/// planes of each other; with 200 of them that costs a fifth of a general sparse factorisation,
/// which spends its time on finding an order and on memory.
#[derive(Default)]
pub(super) struct Laplacian {
    couplings: Vec<(u32, u32, f64)>,
    diagonal: Vec<f64>,
    /// First column kept of every row, and where in `values` column 0 of the row would stand.
    first: Vec<usize>,
    values: Vec<f64>,
    row: Vec<usize>,
}

impl Laplacian {
    /// Starts anew with so many unknowns.
    pub fn clear(&mut self, unknowns: usize) {
        self.couplings.clear();
        self.diagonal.clear();
        self.diagonal.resize(unknowns, 0.0);
    }

    /// Couples two unknowns by a positive weight. Each pair once.
    pub fn couple(&mut self, i: usize, j: usize, weight: f64) {
        self.couplings.push((i.max(j) as u32, i.min(j) as u32, weight));
        self.diagonal[i] += weight;
        self.diagonal[j] += weight;
    }

    /// Solves L d = r with the last unknown pinned to 0, since only differences count; `r` sums to
    /// zero. None if L is singular beyond that.
    pub fn solve(&mut self, r: &[f64]) -> Option<Vec<f64>> {
        let n = r.len();
        if n < 2 {
            return Some(vec![0.0; n]);
        }
        let free = n - 1;
        self.first.clear();
        self.first.extend(0..free);
        for &(high, low, _) in &self.couplings {
            if (high as usize) < free {
                let first = &mut self.first[high as usize];
                *first = (*first).min(low as usize);
            }
        }
        let products: usize =
            self.first.iter().enumerate().map(|(i, first)| (i - first) * (i - first) / 2).sum();
        let mut step = if products > MOST_PRODUCTS {
            self.solve_sparse(&r[..free])?
        } else {
            self.solve_envelope(&r[..free])?
        };
        step.push(0.0);
        step.iter().all(|d| d.is_finite()).then_some(step)
    }

    fn solve_envelope(&mut self, r: &[f64]) -> Option<Vec<f64>> {
        let free = r.len();
        // Row i has columns first[i] ..= i; it begins at row[i].
        self.row.clear();
        let mut size = 0;
        for (i, first) in self.first.iter().enumerate() {
            self.row.push(size);
            size += i - first + 1;
        }
        self.values.clear();
        self.values.resize(size, 0.0);
        for &(high, low, weight) in &self.couplings {
            let (high, low) = (high as usize, low as usize);
            if high < free {
                self.values[self.row[high] + low - self.first[high]] -= weight;
            }
        }
        for i in 0..free {
            self.values[self.row[i] + i - self.first[i]] = self.diagonal[i];
        }
        let mut step = r.to_vec();
        for i in 0..free {
            let first = self.first[i];
            let (above, own) = self.values.split_at_mut(self.row[i]);
            let own = &mut own[..=i - first];
            for j in first..i {
                let (other_first, other) = (self.first[j], self.row[j]);
                let from = first.max(other_first);
                let row = &above[other..=other + j - other_first];
                let sum = dot(&own[from - first..j - first], &row[from - other_first..j - other_first]);
                own[j - first] = (own[j - first] - sum) * row[j - other_first];
            }
            let (diagonal, own) = own.split_last_mut()?;
            let pivot = *diagonal - dot(own, own);
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            // The diagonal keeps 1 / L_ii: a product is quicker than a division.
            *diagonal = 1.0 / pivot.sqrt();
            step[i] = (step[i] - dot(own, &step[first..i])) * *diagonal;
        }
        for i in (0..free).rev() {
            let first = self.first[i];
            let own = &self.values[self.row[i]..=self.row[i] + i - first];
            let value = step[i] * own[i - first];
            step[i] = value;
            for (above, l) in step[first..i].iter_mut().zip(own) {
                *above -= l * value;
            }
        }
        Some(step)
    }

    fn solve_sparse(&self, r: &[f64]) -> Option<Vec<f64>> {
        // Cells are what runs in parallel; a factorisation split over threads would round by their number.
        static ONE_THREAD: Once = Once::new();
        ONE_THREAD.call_once(|| faer::set_global_parallelism(Par::Seq));
        let free = r.len();
        let inner = self.couplings.iter().filter(|c| (c.0 as usize) < free);
        let mut entries: Vec<Triplet<u32, u32, f64>> =
            inner.map(|&(high, low, weight)| Triplet::new(high, low, -weight)).collect();
        entries.extend((0..free).map(|i| Triplet::new(i as u32, i as u32, self.diagonal[i])));
        let matrix = SparseColMat::<u32, f64>::try_new_from_triplets(free, free, &entries).ok()?;
        let factors = matrix.sp_cholesky(Side::Lower).ok()?;
        let solved = factors.solve(&Mat::from_fn(free, 1, |i, _| r[i]));
        Some((0..free).map(|i| solved[(i, 0)]).collect())
    }
}

/// The scalar product, summed in the same order on every processor.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (groups_a, groups_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let mut rest = 0.0;
    for (a, b) in groups_a.remainder().iter().zip(groups_b.remainder()) {
        rest += a * b;
    }
    let mut sums = [0.0; LANES];
    for (a, b) in groups_a.zip(groups_b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_envelope_and_the_sparse_solver_agree() {
        let (across, up) = (17, 12);
        let mut laplacian = Laplacian::default();
        laplacian.clear(across * up);
        for x in 0..across {
            for y in 0..up {
                let at = x * up + y;
                let weight = 1.0 + 0.5 * ((at * 37 % 11) as f64);
                if y + 1 < up {
                    laplacian.couple(at + 1, at, weight);
                }
                if x + 1 < across {
                    laplacian.couple(at, at + up, 0.3 * weight);
                }
            }
        }
        let mut r: Vec<f64> = (0..across * up).map(|k| ((k * 29 % 31) as f64) - 15.0).collect();
        let mean = r.iter().sum::<f64>() / r.len() as f64;
        r.iter_mut().for_each(|r| *r -= mean);
        let envelope = laplacian.solve(&r).expect("not singular");
        let sparse = laplacian.solve_sparse(&r[..r.len() - 1]).expect("not singular");
        for (a, b) in envelope.iter().zip(&sparse) {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
    }

    #[test]
    fn unknowns_in_two_parts_are_refused() {
        let mut laplacian = Laplacian::default();
        laplacian.clear(4);
        laplacian.couple(0, 1, 1.0);
        laplacian.couple(2, 3, 1.0);
        assert_eq!(laplacian.solve(&[1.0, -1.0, 1.0, -1.0]), None);
    }
}
