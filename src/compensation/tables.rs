use super::Profile;
use super::cones::Cones;
use super::stencil::Stencil;
use super::way::has_chords;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Bytes of tables that are kept; past that all are made anew.
const MOST_BYTES: usize = 1 << 26;

/// A cutter with its tables for positions on samples and for rows at any place between them, each made once: a
/// row's distances from the samples depend on its offset from them alone.
#[derive(Debug)]
pub struct Tables {
    profile: Profile,
    made: Mutex<Vec<Arc<Stencil>>>,
    on_samples: OnceLock<Stencil>,
    cones: OnceLock<Cones>,
}

impl Tables {
    pub fn new(profile: Profile) -> Tables {
        Tables { profile, made: Mutex::default(), on_samples: OnceLock::new(), cones: OnceLock::new() }
    }

    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The table for positions on samples.
    pub(super) fn on_samples(&self) -> &Stencil {
        self.on_samples.get_or_init(|| Stencil::new(&self.profile, 0.0, 0.0))
    }

    /// Where samples can touch it, for positions on samples.
    pub(super) fn cones(&self) -> &Cones {
        let cones = || Cones::new(&self.profile, self.on_samples(), has_chords(&self.profile));
        self.cones.get_or_init(cones)
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
