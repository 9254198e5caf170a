//! A levelled tile whose faces are held only while it is worked on.
//!
//! Turned, a tile is a mesh of all its triangles: 60 kB for each cell of 200 facets, which a part of any number of
//! tiles has no room for. It can be made from the design again at any time, to the same bits.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::grid::{Heights, Lattice, Window};
use crate::surface::{Designed, Error, Level, Surface};

/// What is always known of it, and its faces while they are held.
pub struct Levelled {
    flat: Arc<Designed>,
    lattice: Lattice,
    top_mm: f64,
    bottom_mm: f64,
    steepest: [f64; 2],
    held: Mutex<Option<Arc<dyn Surface>>>,
}

impl Levelled {
    /// Holds the faces of what was turned from `flat`.
    pub fn new(flat: Arc<Designed>, level: Level) -> Levelled {
        let surface = level.surface;
        Levelled {
            flat,
            lattice: surface.lattice(),
            top_mm: surface.top_mm(),
            bottom_mm: surface.bottom_mm(),
            steepest: surface.steepest(),
            held: Mutex::new(Some(Arc::new(surface))),
        }
    }

    /// Makes the faces again if they are not held.
    pub fn hold(&self) -> Result<Arc<dyn Surface>, Error> {
        if let Some(surface) = &*self.guard() {
            return Ok(Arc::clone(surface));
        }
        // Not under the lock: turning uses all threads, and each of them may come here for something else meanwhile.
        let surface: Arc<dyn Surface> = Arc::new(self.flat.levelled()?.surface);
        Ok(Arc::clone(self.guard().get_or_insert(surface)))
    }

    /// Lets the faces go until they are asked for.
    pub fn shed(&self) {
        *self.guard() = None;
    }

    fn guard(&self) -> MutexGuard<'_, Option<Arc<dyn Surface>>> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Surface for Levelled {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn top_mm(&self) -> f64 {
        self.top_mm
    }

    fn bottom_mm(&self) -> f64 {
        self.bottom_mm
    }

    fn steepest(&self) -> [f64; 2] {
        self.steepest
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        self.hold()?.heights(window, datum_mm)
    }

    fn heights_onto(&self, window: Window, datum_mm: f64, z_mm: &mut [f32]) -> Result<(), Error> {
        self.hold()?.heights_onto(window, datum_mm, z_mm)
    }

    fn heights_mirrored(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        self.hold()?.heights_mirrored(window, datum_mm)
    }

    fn range_mm(&self, window: Window) -> Result<Option<[f64; 2]>, Error> {
        self.hold()?.range_mm(window)
    }

    /// None where the tile could not be turned again, which asking for its heights then tells.
    fn outlines(&self, low_mm: [f64; 2], high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        self.hold().map_or_else(|_| Vec::new(), |surface| surface.outlines(low_mm, high_mm))
    }
}
