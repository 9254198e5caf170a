use super::field::{Field, Targets};
use super::outlet::Outlet;
use super::tiles::{Going, OnTile};
use crate::grid::Window;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

/// Samples that a thread takes at once, about, while others might run out of work; where there are few, so many parts
/// of a thread's share; and rows, at least.
const SAMPLES: usize = 1 << 19;
const PARTS: usize = 8;
const ROWS: usize = 32;

/// Reaches of a cutter that must be left of a chain for half of it to be taken away: who takes it looks at one reach of
/// samples below its first row.
const WORTH: usize = 4;

/// Rows of targets above one another that one search goes along, as far as they are left.
struct Chain<'b> {
    /// Column of the first target, row of the next one, and the row after the last.
    column: i64,
    row: i64,
    end: i64,
    to: VecDeque<Outlet<'b>>,
    has_thread: bool,
}

/// Work on the samples of `out`, every `every`-th row, by searches that go upwards in strips of so many columns. A
/// thread without a strip takes half of what is left of another one's: threads end together, though a machine seldom
/// gives them the same speed, and no row is looked at twice but where a strip was halved.
pub(super) fn on_chains(of: &OnTile<'_>, out: Window, width: usize, to: Vec<Outlet<'_>>) {
    let (every, reach) = (of.every as usize, of.profile.reach());
    let threads = rayon::current_num_threads();
    let rows = to.len();
    let mut strips: Vec<VecDeque<Outlet<'_>>> = Vec::new();
    strips.resize_with(out.columns.div_ceil(width), || VecDeque::with_capacity(rows));
    for to in to {
        for (strip, to) in strips.iter_mut().zip(to.split(width)) {
            strip.push_back(to);
        }
    }
    let at_once = match threads {
        1 => rows,
        _ => (SAMPLES / width).min(out.columns * rows / (width * threads * PARTS)).max(ROWS.div_ceil(every)),
    };
    let least = (WORTH * reach).div_ceil(every).max(2 * at_once);
    let chains = Chains::new(strips, out, every, width, [at_once, least]);
    (0..threads).into_par_iter().with_max_len(1).for_each(|_| {
        let mut scratch = (Field::empty(0, 0), Targets::new(0, 0));
        while let Some(chain) = chains.claim() {
            let mut going = None;
            while chains.go_on(chain, of, &mut scratch, &mut going) {}
        }
    });
}

/// All chains, those that are done among them.
struct Chains<'b> {
    all: Mutex<Vec<Chain<'b>>>,
    every: i64,
    /// Rows that are taken at once, and that a chain which is halved has at least.
    at_once: usize,
    least: usize,
}

impl<'b> Chains<'b> {
    fn new(
        strips: Vec<VecDeque<Outlet<'b>>>,
        out: Window,
        every: usize,
        width: usize,
        [at_once, least]: [usize; 2],
    ) -> Chains<'b> {
        let chain = |(k, to)| {
            let column = out.column + (k * width) as i64;
            Chain { column, row: out.row, end: out.row_end(), to, has_thread: false }
        };
        let all = Mutex::new(strips.into_iter().enumerate().map(chain).collect());
        Chains { all, every: every as i64, at_once, least }
    }

    /// A chain for a thread without one: one that no thread has, or else the upper half of the longest.
    fn claim(&self) -> Option<usize> {
        let mut chains = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(k) = chains.iter().position(|chain| !chain.has_thread) {
            chains[k].has_thread = true;
            return Some(k);
        }
        let longest = chains.iter_mut().max_by_key(|chain| chain.to.len())?;
        if longest.to.len() < self.least {
            return None;
        }
        let kept = longest.to.len() / 2;
        let row = longest.row + kept as i64 * self.every;
        let upper = Chain { row, to: longest.to.split_off(kept), ..*longest };
        chains.push(upper);
        Some(chains.len() - 1)
    }

    /// Does the next rows of a chain; false if none are left.
    fn go_on(
        &self,
        chain: usize,
        of: &OnTile<'_>,
        scratch: &mut (Field, Targets),
        going: &mut Option<Going>,
    ) -> bool {
        let Some((tile, end, mut to)) = self.next(chain) else { return false };
        of.go_on(tile, end, &mut to, scratch, going);
        true
    }

    /// The next rows of a chain, and the row at which it was to end at first.
    fn next(&self, chain: usize) -> Option<(Window, i64, Vec<Outlet<'b>>)> {
        let mut chains = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        let chain = &mut chains[chain];
        let rows = self.at_once.min(chain.to.len());
        let columns = chain.to.front()?.columns();
        let tile = Window { column: chain.column, row: chain.row, columns, rows };
        chain.row += rows as i64 * self.every;
        Some((tile, chain.end, chain.to.drain(..rows).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::field::Sense;
    use super::super::tiles::surfaces;
    use super::super::way::Way;
    use super::super::{Profile, Tables, cutter_location_rows};
    use super::*;

    #[test]
    fn halves_of_a_strip_meet() {
        for (name, h) in surfaces::all(90) {
            for (cutter, every) in [("ball:0.2", 1), ("ball:0.4", 1), ("ball:0.3", 3)] {
                let profile = Profile::new(cutter.parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
                let tables = Tables::new(profile);
                let all = h.window.grown(7);
                // One thread alone never halves a strip.
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
                let whole = pool.install(|| cutter_location_rows(&h, &profile, all, every));
                let of = OnTile::new((&h).into(), &tables, every, Sense::Raise, Way::Contacts);
                let mut halved = vec![0.0; whole.z_mm.len()];
                let strip = Outlet::plain(&mut halved, all.columns).into();
                let chains = Chains::new(vec![strip], all, every, all.columns, [3, 4]);
                let mut threads = [0, 1, 2].map(|_| (None, (Field::empty(0, 0), Targets::new(0, 0)), None));
                for round in 0.. {
                    let mut are_done = true;
                    for (k, (chain, scratch, going)) in threads.iter_mut().enumerate() {
                        if round == 2 * k {
                            *chain = chains.claim();
                            assert!(chain.is_some() || whole.window.rows < 30, "enough for three");
                        }
                        are_done &= !chain.is_some_and(|chain| chains.go_on(chain, &of, scratch, going));
                    }
                    if are_done && round > 4 {
                        break;
                    }
                }
                let bits = |z_mm: &[f32]| z_mm.iter().map(|z| z.to_bits()).collect::<Vec<_>>();
                assert!(bits(&halved) == bits(&whole.z_mm), "{cutter} on {name}");
            }
        }
    }
}
