//! How long work tells where it is and hears that it should stop. It never changes an answer.

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
