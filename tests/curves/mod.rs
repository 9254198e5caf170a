//! How far two paths are from each other as curves, wherever their vertices lie.

use std::collections::HashMap;

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

fn on(from: [f64; 3], to: [f64; 3], t: f64) -> [f64; 3] {
    std::array::from_fn(|k| from[k] + (to[k] - from[k]) * t)
}

/// The farthest that a place of one path is from the other path; infinite past a cell.
pub fn strays(a: &[[f64; 3]], b: &[[f64; 3]]) -> (f64, [f64; 3]) {
    const CELL_MM: f64 = 0.1;
    let cell = |at: [f64; 3]| [0, 1].map(|k| (at[k] / CELL_MM).floor() as i64);
    let walk = |from: [f64; 3], to: [f64; 3]| {
        let steps = (apart(from, to) / 0.02).ceil().max(1.0) as usize;
        (0..=steps).map(move |step| on(from, to, step as f64 / steps as f64))
    };
    let mut near: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (leg, pair) in b.windows(2).enumerate() {
        for [x, y] in walk(pair[0], pair[1]).map(cell) {
            for around in (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| [x, y])) {
                let legs = near.entry(around).or_default();
                if legs.last() != Some(&leg) {
                    legs.push(leg);
                }
            }
        }
    }
    let mut worst = (0.0, a[0]);
    for p in a.windows(2).flat_map(|pair| walk(pair[0], pair[1])) {
        let distance = |leg: &usize| {
            let leg = [b[*leg], b[leg + 1]];
            let along: f64 = (0..3).map(|k| (p[k] - leg[0][k]) * (leg[1][k] - leg[0][k])).sum();
            let square = apart(leg[0], leg[1]).powi(2);
            let t = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
            apart(p, on(leg[0], leg[1], t))
        };
        let nearest = near.get(&cell(p)).into_iter().flatten().map(distance).fold(f64::INFINITY, f64::min);
        if nearest > worst.0 {
            worst = (nearest, p);
        }
    }
    worst
}
