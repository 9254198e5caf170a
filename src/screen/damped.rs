//! Damped least squares for symmetric systems that are not definite.

/// Steps of conjugate gradients; what is left after them is below what the damping leaves.
const STEPS: usize = 100;

/// A symmetric sparse matrix K, by rows, the diagonal apart.
#[derive(Default)]
pub(super) struct Sparse {
    diagonal: Vec<f64>,
    /// Where the entries of each row begin, and of one past the last.
    start: Vec<usize>,
    column: Vec<u32>,
    value: Vec<f64>,
}

/// Vectors of the iteration, kept from one system to the next.
#[derive(Default)]
pub(super) struct Iterates {
    x: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    gradient: Vec<f64>,
}

impl Sparse {
    /// Begins a matrix.
    pub fn clear(&mut self) {
        self.diagonal.clear();
        self.column.clear();
        self.value.clear();
        self.start.clear();
        self.start.push(0);
    }

    /// An entry of the next row.
    pub fn entry(&mut self, column: usize, value: f64) {
        self.column.push(column as u32);
        self.value.push(value);
    }

    /// Ends that row.
    pub fn end_row(&mut self, diagonal: f64) {
        self.diagonal.push(diagonal);
        self.start.push(self.column.len());
    }

    /// The mean of the diagonal's absolute values.
    pub fn stiffness(&self) -> f64 {
        self.diagonal.iter().map(|d| d.abs()).sum::<f64>() / self.diagonal.len().max(1) as f64
    }

    fn times(&self, x: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.diagonal.iter().zip(x).zip(self.start.windows(2)).map(|((d, own), row)| {
            let row = row[0]..row[1];
            let others = self.column[row.clone()].iter().zip(&self.value[row]);
            d * own + others.map(|(&column, value)| value * x[column as usize]).sum::<f64>()
        }));
    }

    /// The x that makes |K x - r|^2 + damping^2 |x|^2 least, by conjugate gradients (CGLS).
    pub fn solve<'a>(&self, r: &[f64], damping: f64, iterates: &'a mut Iterates) -> &'a [f64] {
        let Iterates { x, residual, direction, image, gradient } = iterates;
        x.clear();
        x.resize(r.len(), 0.0);
        residual.clear();
        residual.extend_from_slice(r);
        self.times(residual, direction);
        let mut size = dot(direction, direction);
        let damping2 = damping * damping;
        for _ in 0..STEPS {
            self.times(direction, image);
            let curvature = dot(image, image) + damping2 * dot(direction, direction);
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let step = size / curvature;
            x.iter_mut().zip(&*direction).for_each(|(x, d)| *x += step * d);
            residual.iter_mut().zip(&*image).for_each(|(r, i)| *r -= step * i);
            self.times(residual, gradient);
            gradient.iter_mut().zip(&*x).for_each(|(g, x)| *g -= damping2 * x);
            let before = std::mem::replace(&mut size, dot(gradient, gradient));
            let turn = size / before;
            direction.iter_mut().zip(&*gradient).for_each(|(d, g)| *d = g + turn * *d);
        }
        x
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_found_makes_the_damped_sum_of_squares_least() {
        // A ring with both signs on the diagonal.
        let n = 30;
        let mut matrix = Sparse::default();
        matrix.clear();
        for k in 0..n {
            matrix.entry((k + 1) % n, 1.0);
            matrix.entry((k + n - 1) % n, 1.0);
            matrix.end_row(if k % 3 == 0 { 0.5 } else { -2.0 });
        }
        let r: Vec<f64> = (0..n).map(|k| ((k * 7 % 11) as f64) - 5.0).collect();
        let mut iterates = Iterates::default();
        let x = matrix.solve(&r, 0.3, &mut iterates).to_vec();
        let (mut image, mut normal) = (Vec::new(), Vec::new());
        matrix.times(&x, &mut image);
        let left: Vec<f64> = r.iter().zip(&image).map(|(r, i)| r - i).collect();
        matrix.times(&left, &mut normal);
        for (n, x) in normal.iter().zip(&x) {
            assert!((n - 0.09 * x).abs() < 1e-9, "{n} {x}");
        }
        assert!(x.iter().any(|x| x.abs() > 1.0));
        assert_eq!(matrix.solve(&vec![0.0; n], 0.3, &mut iterates), vec![0.0; n]);
    }
}
