//! Map files and pictures of one tile, from strips of full rows.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::Error;
use super::judge::Strip;
use crate::grid::{Heights, Lattice, Window};
use crate::report::MapFiles;
use crate::report::maps::{self, MapRow, Reducer};
use crate::report::picture::{self, Caption, Kind, Preview};
use crate::surface::HeightWriter;

/// The maps of a tile while they are written: z in the part's frame.
pub struct Maps {
    folder: PathBuf,
    tile: String,
    offset_mm: f64,
    reducer: Reducer,
    writers: Vec<HeightWriter>,
    preview: Preview,
}

impl Maps {
    /// Opens the four maps of a tile under `staging`/maps; `offset_mm` is the tile's z = 0 in the part's frame.
    pub fn create(
        staging: &Path,
        tile: &str,
        lattice: &Lattice,
        full: bool,
        offset_mm: f64,
    ) -> Result<Maps, Error> {
        let folder = staging.join("maps");
        std::fs::create_dir_all(&folder).map_err(|source| Error::Output { path: folder.clone(), source })?;
        let (columns, rows) = (lattice.columns, lattice.rows);
        let reducer = match full {
            true => Reducer::by_factor(columns, rows, 1),
            false => Reducer::within(columns, rows, maps::FULL_SAMPLES),
        };
        let pitch_mm = lattice.step_mm * reducer.factor() as f64;
        let writers = Kind::ALL
            .iter()
            .map(|kind| {
                let path = folder.join(format!("{tile}-{}.tif", kind.name()));
                HeightWriter::create(&path, reducer.columns(), reducer.rows(), pitch_mm, [0.0, 0.0])
            })
            .collect::<Result<_, _>>()?;
        let preview = Preview::new(reducer.columns(), reducer.rows(), pitch_mm);
        Ok(Maps { folder, tile: tile.into(), offset_mm, reducer, writers, preview })
    }

    /// Takes the next full rows of the tile.
    pub fn push(&mut self, strip: &Strip) -> Result<(), Error> {
        let strip = maps::Strip {
            design: &strip.design.z_mm,
            machined: &strip.machined.z_mm,
            cavity: &strip.cavity.z_mm,
        };
        let (writers, preview, offset_mm) = (&mut self.writers, &mut self.preview, self.offset_mm);
        self.reducer.push(strip, |row: &MapRow| -> Result<(), Error> {
            let shifted = |z_mm: &[f32]| z_mm.iter().map(|z| (f64::from(*z) + offset_mm) as f32).collect();
            let layers: [Vec<f32>; 4] =
                [shifted(&row.design), shifted(&row.machined), row.deviation.clone(), row.cavity.clone()];
            for (writer, z_mm) in writers.iter_mut().zip(layers) {
                let window = Window { column: 0, row: row.row as i64, columns: z_mm.len(), rows: 1 };
                writer.write(&Heights { window, z_mm })?;
            }
            Ok(preview.take(row)?)
        })
    }

    /// Gives the maps their names, draws their pictures, and tells by which whole factor they are reduced.
    pub fn finish(
        self,
        part: &str,
        origin_mm: [f64; 2],
        notes: &[String],
    ) -> Result<(MapFiles, usize), Error> {
        for writer in self.writers {
            writer.finish()?;
        }
        let factor = self.reducer.factor();
        let caption =
            Caption { part: part.into(), tile: self.tile.clone(), origin_mm, notes: notes.to_vec() };
        let (folder, tile, preview) = (&self.folder, &self.tile, &self.preview);
        Kind::ALL.into_par_iter().try_for_each(|kind| {
            let path = folder.join(format!("{tile}-{}.png", kind.name()));
            picture::write_png(&path, &preview.draw(kind, &caption))
        })?;
        let name = |kind: Kind| format!("maps/{}-{}.tif", self.tile, kind.name());
        let [design, machined, deviation, cavity] = Kind::ALL.map(name);
        Ok((MapFiles { design, machined, deviation, cavity }, factor))
    }
}

/// The one map of `check`: cavities of a set of cutters.
pub struct CavityMap {
    folder: PathBuf,
    tile: String,
    reducer: Reducer,
    writer: HeightWriter,
    preview: Preview,
}

impl CavityMap {
    /// Opens the map of a tile under `out`/maps.
    pub fn create(out: &Path, tile: &str, lattice: &Lattice, full: bool) -> Result<CavityMap, Error> {
        let folder = out.join("maps");
        std::fs::create_dir_all(&folder).map_err(|source| Error::Output { path: folder.clone(), source })?;
        let (columns, rows) = (lattice.columns, lattice.rows);
        let reducer = match full {
            true => Reducer::by_factor(columns, rows, 1),
            false => Reducer::within(columns, rows, maps::FULL_SAMPLES),
        };
        let pitch_mm = lattice.step_mm * reducer.factor() as f64;
        let path = folder.join(format!("{tile}-cavity.tif"));
        let writer = HeightWriter::create(&path, reducer.columns(), reducer.rows(), pitch_mm, [0.0, 0.0])?;
        let preview = Preview::new(reducer.columns(), reducer.rows(), pitch_mm);
        Ok(CavityMap { folder, tile: tile.into(), reducer, writer, preview })
    }

    /// Takes the next row of blocks, each its design and its cavities.
    pub fn push(&mut self, blocks: &[(Heights, Heights)], columns: usize) -> Result<(), Error> {
        let rows = blocks.first().map_or(0, |block| block.0.window.rows);
        let mut design = vec![f32::NAN; rows * columns];
        let mut cavity = design.clone();
        for (from, depth) in blocks {
            for row in 0..rows {
                let at = row * columns + from.window.column as usize;
                let own = row * from.window.columns..(row + 1) * from.window.columns;
                design[at..at + from.window.columns].copy_from_slice(&from.z_mm[own.clone()]);
                cavity[at..at + from.window.columns].copy_from_slice(&depth.z_mm[own]);
            }
        }
        let strip = maps::Strip { design: &design, machined: &design, cavity: &cavity };
        let (writer, preview) = (&mut self.writer, &mut self.preview);
        self.reducer.push(strip, |row: &MapRow| -> Result<(), Error> {
            let z_mm = row.cavity.clone();
            let window = Window { column: 0, row: row.row as i64, columns: z_mm.len(), rows: 1 };
            writer.write(&Heights { window, z_mm })?;
            Ok(preview.take(row)?)
        })
    }

    /// Gives the map its name and draws it.
    pub fn finish(self, part: &str, origin_mm: [f64; 2], note: String) -> Result<(), Error> {
        self.writer.finish()?;
        let caption = Caption { part: part.into(), tile: self.tile.clone(), origin_mm, notes: vec![note] };
        let path = self.folder.join(format!("{}-cavity.png", self.tile));
        Ok(picture::write_png(&path, &self.preview.draw(Kind::Cavity, &caption))?)
    }
}
