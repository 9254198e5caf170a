//! How long work tells where it is and hears that it should stop. It never changes an answer.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

/// Where a stage reports to. Implementations may be called from any thread.
pub trait Progress: Sync {
    /// A stage begins; `total` steps are to come.
    fn begin(&self, stage: &str, total: u64);

    /// So many steps of the stage are done.
    fn advance(&self, steps: u64);

    /// Whether the work should end as soon as it can.
    fn interrupted(&self) -> bool {
        false
    }
}

/// Says nothing and never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
}

/// So many things made on all threads, in their order; or the error of the first in order that fails, whatever the
/// threads. What stands behind a failure is no longer begun, so that a mistake in all of them is told soon.
pub fn in_order<T: Send, E: Send>(
    count: usize,
    make: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    in_order_with(count, || (), |(), at| make(at))
}

/// The same with something that each thread makes for itself and uses again.
pub fn in_order_with<T: Send, E: Send, W>(
    count: usize,
    own: impl Fn() -> W + Sync + Send,
    make: impl Fn(&mut W, usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let failed = AtomicUsize::new(usize::MAX);
    let made: Vec<Option<Result<T, E>>> = (0..count)
        .into_par_iter()
        .map_init(own, |own, at| {
            let go_on = at < failed.load(Ordering::Relaxed);
            go_on.then(|| make(own, at).inspect_err(|_| _ = failed.fetch_min(at, Ordering::Relaxed)))
        })
        .collect();
    made.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_failure_in_order_is_told_and_few_behind_it_are_begun() {
        assert_eq!(
            in_order(1000, |at| Ok::<_, usize>(2 * at)).expect("all"),
            (0..2000).step_by(2).collect::<Vec<_>>()
        );
        let begun = AtomicUsize::new(0);
        let found = in_order(100_000, |at| {
            begun.fetch_add(1, Ordering::Relaxed);
            if at >= 70 { Err(at) } else { Ok(()) }
        });
        assert_eq!(found, Err(70));
        assert!(begun.into_inner() < 50_000);
    }
}
