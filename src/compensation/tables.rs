use super::Profile;
use super::stencil::Stencil;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of tables that are kept; past that all are made anew.
const MOST_BYTES: usize = 1 << 26;

/// A cutter with its tables for rows at any place between the samples, each made once: a row's distances from
/// the samples depend on its offset from them alone.
#[derive(Debug)]
pub struct Tables {
    profile: Profile,
    made: Mutex<Vec<Arc<Stencil>>>,
}

impl Tables {
    pub fn new(profile: Profile) -> Tables {
        Tables { profile, made: Mutex::default() }
    }

    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The table for samples at whole pitches and (fx, fy) from the axis.
    pub(super) fn at(&self, fx: f64, fy: f64) -> Arc<Stencil> {
        let made = || self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let find = |made: &[Arc<Stencil>]| made.iter().find(|s| s.fx == fx && s.fy == fy).cloned();
        if let Some(stencil) = find(&made()) {
            return stencil;
        }
        // Not under the lock: others make other tables meanwhile, at worst the same one.
        let stencil = Arc::new(Stencil::new(&self.profile, fx, fy));
        let mut made = made();
        let bytes = stencil.bytes();
        if (made.len() + 1) * bytes > MOST_BYTES {
            made.clear();
        }
        if find(&made).is_none() {
            made.push(stencil.clone());
        }
        stencil
    }
}
