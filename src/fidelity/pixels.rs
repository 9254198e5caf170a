use crate::grid::Window;

/// Weighted means over squares of samples, for a picture of a tile or of a part of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// Samples along a side of a pixel.
    pub factor: usize,
    pub columns: usize,
    pub rows: usize,
    /// First pixel's column and row in the picture.
    first: [usize; 2],
    /// Of value times weight.
    sums: Vec<f64>,
    weights: Vec<f64>,
}

/// Sums and weights of the pixels that a row of samples lies in.
pub(super) struct Line {
    factor: i64,
    first: i64,
    pixels: Vec<[f64; 2]>,
}

impl Line {
    /// Adds a value times its weight, and the weight, at a column.
    #[inline]
    pub fn add(&mut self, column: i64, [weight, sum]: [f64; 2]) {
        let pixel = &mut self.pixels[(column / self.factor - self.first) as usize];
        *pixel = [pixel[0] + weight, pixel[1] + sum];
    }

    /// Adds what [`Line::add`] takes of samples side by side.
    pub fn add_run(&mut self, column: i64, weights: &[f64], sums: &[f64]) {
        let mut at = 0;
        while at < weights.len() {
            let pixel = (column + at as i64) / self.factor;
            let end = (((pixel + 1) * self.factor - column) as usize).min(weights.len());
            let to = &mut self.pixels[(pixel - self.first) as usize];
            *to = [to[0] + total(&weights[at..end]), to[1] + total(&sums[at..end])];
            at = end;
        }
    }
}

/// A sum that need not wait for each addend.
#[inline(always)]
pub(super) fn total(values: &[f64]) -> f64 {
    let (eights, rest) = values.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        for (sum, value) in sums.iter_mut().zip(eight) {
            *sum += value;
        }
    }
    for (sum, value) in sums.iter_mut().zip(rest) {
        *sum += value;
    }
    sums.iter().sum()
}

impl Pixels {
    /// Nothing yet, for a tile of this many samples; no side longer than `most` pixels.
    pub fn new(columns: usize, rows: usize, most: usize) -> Pixels {
        let factor = columns.max(rows).div_ceil(most).max(1);
        Pixels::of(factor, [0, 0], columns.div_ceil(factor), rows.div_ceil(factor))
    }

    fn of(factor: usize, first: [usize; 2], columns: usize, rows: usize) -> Pixels {
        let zero = vec![0.0; columns * rows];
        Pixels { factor, columns, rows, first, sums: zero.clone(), weights: zero }
    }

    /// Nothing yet, for the pixels of this picture that samples of `window` lie in.
    pub fn part(&self, window: Window) -> Pixels {
        let range = |start: i64, end: i64| {
            let first = start as usize / self.factor;
            (first, (end as usize - 1) / self.factor - first + 1)
        };
        let (column, columns) = range(window.column, window.column_end());
        let (row, rows) = range(window.row, window.row_end());
        Pixels::of(self.factor, [column, row], columns, rows)
    }

    /// Nothing yet, for the samples of a row.
    pub(super) fn line(&self, window: Window) -> Line {
        let factor = self.factor as i64;
        let first = window.column / factor;
        let count = (window.column_end() - 1) / factor - first + 1;
        Line { factor, first, pixels: vec![[0.0; 2]; count as usize] }
    }

    /// Adds a row of samples.
    pub(super) fn add(&mut self, row: i64, line: &Line) {
        let start =
            (row as usize / self.factor - self.first[1]) * self.columns + line.first as usize - self.first[0];
        for (offset, [weight, sum]) in line.pixels.iter().enumerate() {
            self.weights[start + offset] += weight;
            self.sums[start + offset] += sum;
        }
    }

    /// Adds what another part of the same picture holds; the caller keeps an order.
    pub fn merge(&mut self, other: &Pixels) {
        for row in 0..other.rows {
            let start =
                (row + other.first[1] - self.first[1]) * self.columns + other.first[0] - self.first[0];
            for column in 0..other.columns {
                let from = row * other.columns + column;
                self.sums[start + column] += other.sums[from];
                self.weights[start + column] += other.weights[from];
            }
        }
    }

    /// Sum of all values times their weights, and of all weights.
    pub fn total(&self) -> [f64; 2] {
        [self.sums.iter().sum(), self.weights.iter().sum()]
    }

    /// The means over squares of `samples` along each side, each of the pixels whose middle lies in it, where there are
    /// any.
    pub fn means_of_squares(&self, samples: usize) -> Vec<f64> {
        let square = |pixel: usize| (pixel * self.factor + self.factor / 2) / samples.max(1);
        let across = square(self.columns.saturating_sub(1)) + 1;
        let mut squares = vec![[0.0; 2]; across * (square(self.rows.saturating_sub(1)) + 1)];
        for (index, (sum, weight)) in self.sums.iter().zip(&self.weights).enumerate() {
            let (column, row) = (index % self.columns, index / self.columns);
            let found = &mut squares[square(row) * across + square(column)];
            *found = [found[0] + sum, found[1] + weight];
        }
        squares.iter().filter(|[_, weight]| *weight > 0.0).map(|[sum, weight]| sum / weight).collect()
    }

    /// The mean of every pixel by row, lowest y first; NaN where there is nothing.
    pub fn means(&self) -> Vec<f64> {
        self.sums.iter().zip(&self.weights).map(|(sum, weight)| sum / weight).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_picture_make_the_picture() {
        let whole = Window { column: 0, row: 0, columns: 103, rows: 57 };
        let value = |column: i64, row: i64| (column * 7 + row * 13) as f64;
        let fill = |pixels: &mut Pixels, window: Window| {
            for row in window.row..window.row_end() {
                let mut line = pixels.line(window);
                let columns = window.column..window.column_end();
                if row % 2 == 0 {
                    columns.for_each(|c| line.add(c, [1.0, value(c, row)]));
                } else {
                    let sums: Vec<f64> = columns.map(|c| value(c, row)).collect();
                    line.add_run(window.column, &vec![1.0; sums.len()], &sums);
                }
                pixels.add(row, &line);
            }
        };
        let mut at_once = Pixels::new(103, 57, 30);
        assert_eq!((at_once.factor, at_once.columns, at_once.rows), (4, 26, 15));
        fill(&mut at_once, whole);
        let mut pieced = Pixels::new(103, 57, 30);
        for (column, columns) in [(0, 50), (50, 53)] {
            for (row, rows) in [(0, 21), (21, 36)] {
                let window = Window { column, row, columns, rows };
                let mut part = pieced.part(window);
                fill(&mut part, window);
                pieced.merge(&part);
            }
        }
        assert_eq!(at_once, pieced);
        assert_eq!(at_once.means()[0], (0..16).map(|k| value(k % 4, k / 4)).sum::<f64>() / 16.0);
        assert_eq!(at_once.total()[1], 103.0 * 57.0);
        // Pixels of 4 samples in squares of 52: 13 of them to the first, and as many to the second.
        let squares = at_once.means_of_squares(52);
        let mean = |columns: std::ops::Range<i64>, rows: std::ops::Range<i64>| {
            let count = ((columns.end - columns.start) * (rows.end - rows.start)) as f64;
            rows.flat_map(|r| columns.clone().map(move |c| value(c, r))).sum::<f64>() / count
        };
        assert_eq!(squares.len(), 4);
        assert!((squares[0] - mean(0..52, 0..52)).abs() < 1e-9);
        assert!((squares[3] - mean(52..103, 52..57)).abs() < 1e-9);
    }
}
