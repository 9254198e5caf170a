//! `light`: a surface of any origin in the place of the design it was made from, in front of the scene's audience.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::Error;
use super::judge::blocks;
use super::light::{self, Sight};
use crate::fidelity::light::{Centres, LightTally, Plane, Pose, Shares, planes};
use crate::fidelity::{Pixels, polish};
use crate::grid::{Lattice, Window};
use crate::progress::Progress;
use crate::report::Light;
use crate::report::light_picture::MOST_PIXELS;
use crate::screen::{Design, Scene};
use crate::surface::{self, Designed, Surface};

/// Surfaces that stand off the design by more than this, in the median, have another zero.
const ANOTHER_ZERO_MM: f64 = 0.001;

/// Samples that the median is taken of.
const PROBED: usize = 40_000;

/// What is lit.
#[derive(Clone, Debug)]
pub struct Relit {
    pub design: PathBuf,
    pub surface: PathBuf,
    pub pixel_mm: Option<f64>,
    pub scene: PathBuf,
    pub far_field: bool,
    /// Removal of the model of polishing.
    pub polish_um: Option<f64>,
}

/// Where the light goes.
pub struct Lit {
    pub lattice: Lattice,
    pub light: Light,
    /// The design by its planes, every metal a mirror.
    pub by_planes: Shares,
    pub notes: Vec<String>,
    /// Of the design, then of the surface.
    pub maps: [Pixels; 2],
    pub tallies: [LightTally; 2],
    pub scene: Scene,
    pub middle_m: DVec3,
}

/// Lights a surface and the design it was made from.
pub fn relit(case: &Relit, progress: &dyn Progress) -> Result<Lit, Error> {
    let scene = Scene::read(&case.scene)?;
    let design = Arc::new(Design::read(&case.design)?);
    let step_mm = surface::pitch_mm(&case.surface, case.pixel_mm)?;
    let options =
        surface::Options { pixel_mm: case.pixel_mm, ..surface::Options::at_step(step_mm.unwrap_or(0.01)) };
    let opened = surface::open(&case.surface, &options)?;
    let mut notes = opened.notes;
    let cut = opened.surface;
    let designed = Designed::whole(Arc::clone(&design), cut.lattice().step_mm)?;
    let lattice = designed.lattice();
    fits(&design, &case.design, &scene, &case.scene)?;
    let (wanted, found) = (lattice, cut.lattice());
    if (wanted.columns, wanted.rows) != (found.columns, found.rows) {
        return Err(Error::SurfaceOfAnother { surface: case.surface.clone(), wanted, found });
    }
    let top_mm = designed.top_mm();
    let lower_mm = lower(&designed, cut.as_ref())?;
    let cut_datum_mm = if lower_mm.abs() > ANOTHER_ZERO_MM {
        notes.push(format!(
            "the surface stands {lower_mm:.4} mm under the design in the median: taken as another zero of its heights"
        ));
        top_mm - lower_mm
    } else {
        top_mm
    };
    let centres = Centres {
        cell_mm: design.cell_mm,
        columns: design.core.columns(),
        z_mm: design.core_cells().map(|cell| cell.elevation_mm - top_mm).collect(),
    };
    let steepest = designed.steepest();
    let corner_m = |index: i32, length_m: f64| f64::from(index) * design.cell_mm * 1e-3 - 0.5 * length_m;
    let origin_m = DVec3::new(
        corner_m(design.core.c0, scene.width_m),
        corner_m(design.core.r0, scene.height_m),
        top_mm * 1e-3,
    );
    let sight = Sight {
        scene: &scene,
        pose: Pose { origin_m, rotation: DMat3::IDENTITY },
        steepest: steepest[0].hypot(steepest[1]),
        far_field: case.far_field.then_some(&centres),
    };
    let by_planes = of_planes(&designed, &design, &sight).ok_or(Error::NoLightFalls)?;
    let mut maps = [0, 1].map(|_| Pixels::new(lattice.columns, lattice.rows, MOST_PIXELS));
    let mut tallies = [LightTally::default(), LightTally::default()];
    progress.begin("light", 2 * (lattice.columns * lattice.rows) as u64);
    let halo = light::halo(lattice.step_mm);
    let polish_mm = case.polish_um.map(|um| 1e-3 * um);
    let mut after_polish = LightTally::default();
    let surfaces: [(&dyn Surface, f64); 2] = [(&designed, top_mm), (cut.as_ref(), cut_datum_mm)];
    for (index, (surface, datum_mm)) in surfaces.into_iter().enumerate() {
        let (tally, map) = (&mut tallies[index], &mut maps[index]);
        for window in blocks(&lattice).into_iter().flatten() {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let heights = surface.heights(window.grown(halo), datum_mm)?;
            sight.add(tally, &heights, window, lattice.step_mm, Some(map));
            if let (1, Some(removal_mm)) = (index, polish_mm) {
                let around = window.grown(halo + polish::reach(lattice.step_mm));
                let wide = polish::polished(&surface.heights(around, datum_mm)?, lattice.step_mm, removal_mm);
                sight.add(&mut after_polish, &wide.crop(heights.window), window, lattice.step_mm, None);
            }
            progress.advance(window.samples() as u64);
        }
    }
    let middle_m = sight.pose.point_m(DVec3::new(0.5 * lattice.width_mm, 0.5 * lattice.height_mm, 0.0));
    let view = light::view(&scene, &light::points(&sight.pose, &lattice));
    let mut light = light::summary(&tallies[0], &tallies[1], &view).ok_or(Error::NoLightFalls)?;
    let over_screen = |map| light::over_screen(light::of_cells(&scene, map, lattice.step_mm).into_iter());
    light.screen_uniformity_designed = over_screen(&maps[0]);
    light.screen_uniformity_machined = over_screen(&maps[1]);
    light.polished = polish_mm.and_then(|removal_mm| light::polished(&after_polish, removal_mm, &view));
    Ok(Lit { lattice, light, by_planes, notes, maps, tallies, middle_m, scene })
}

/// Refuses a design that is not of this scene's screen.
fn fits(design: &Design, path: &Path, scene: &Scene, scene_path: &Path) -> Result<(), Error> {
    let (columns, rows) = (scene.columns() as i32, scene.rows() as i32);
    let core = design.core;
    let inside = core.c0 >= 0 && core.r0 >= 0 && core.c1 <= columns && core.r1 <= rows;
    if (design.cell_mm - scene.microgeometry.width_mm).abs() > 1e-9 * design.cell_mm || !inside {
        return Err(Error::DesignOfAnother {
            design: path.into(),
            scene: scene_path.into(),
            core,
            cell_mm: design.cell_mm,
            columns,
            rows,
            width_mm: scene.microgeometry.width_mm,
        });
    }
    Ok(())
}

/// How far the surface stands under the design in the median over a grid of samples, in mm.
fn lower(designed: &Designed, cut: &dyn Surface) -> Result<f64, Error> {
    let lattice = designed.lattice();
    let datum_mm = designed.top_mm();
    // Whole rows are cheap to read; a few hundred of them say enough.
    let rows = (PROBED / lattice.columns.max(1)).clamp(4, lattice.rows.max(4));
    let mut lower = Vec::new();
    for k in 0..rows {
        let row = (k * lattice.rows / rows) as i64;
        let window = Window { row, rows: 1, ..lattice.window() };
        let (wanted, found) = (designed.heights(window, datum_mm)?, cut.heights(window, datum_mm)?);
        let pairs = wanted.z_mm.iter().zip(&found.z_mm);
        lower.extend(pairs.map(|(a, b)| f64::from(a - b)).filter(|d| d.is_finite()));
    }
    lower.sort_unstable_by(f64::total_cmp);
    Ok(lower.get(lower.len() / 2).copied().unwrap_or(0.0))
}

/// The light of the design's planes.
fn of_planes(designed: &Designed, design: &Design, sight: &Sight) -> Option<Shares> {
    let top_mm = designed.top_mm();
    let cells: Vec<_> = design.core_cells().map(|cell| (cell.column, cell.row)).collect();
    let sums: Vec<[f64; 4]> = cells
        .par_iter()
        .map(|&(column, row)| {
            let faces = designed.faces(column, row).into_iter();
            let pieces: Vec<Plane> = faces
                .map(|face| Plane {
                    gradient: face.gradient,
                    outline_mm: face.outline_mm.iter().map(|p| [p[0], p[1], p[2] - top_mm]).collect(),
                })
                .collect();
            planes(&pieces, &sight.pose, &sight.room())
        })
        .collect();
    let whole = sums.iter().fold([0.0; 4], |sum, part| std::array::from_fn(|k| sum[k] + part[k]));
    Shares::of_planes(whole)
}
