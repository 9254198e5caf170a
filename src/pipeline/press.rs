//! From a planned operation to its program files, and the files read back.

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::Error;
use super::plan::{Program, TileSetup};
use super::shop::Shop;
use crate::job::{Face, Job, Kind, Operation, ZZero};
use crate::post::{self, Dialect, Section};
use crate::progress::Progress;
use crate::toolpath::Toolpath;
use crate::verify::{self, Reading};

/// Where the programs of a tile in one dialect are made.
pub struct Press<'a> {
    pub job: &'a Job,
    pub shop: &'a Shop,
    pub tile: &'a TileSetup,
    pub dialect: &'a Dialect,
    /// The job's staging folder.
    pub folder: &'a Path,
    pub progress: &'a dyn Progress,
}

impl Press<'_> {
    /// Writes an operation, in sections where it has to be cut in sections, and reads each back. `number`
    /// is that of the first program among those of the tile.
    pub fn print(&self, operation: usize, number: u32, path: &Toolpath) -> Result<Vec<Program>, Error> {
        let Press { job, shop, tile, .. } = self;
        let wanted = &job.operations[operation];
        let face = wanted.face;
        let blank = tile.setup.blank;
        let stock = post::StockFacts {
            material: job.stock.material.clone(),
            width_mm: blank.high_mm[0] - blank.low_mm[0],
            height_mm: blank.high_mm[1] - blank.low_mm[1],
            thickness_mm: job.stock.thickness_mm,
            top_allowance_mm: match face {
                Face::Top => tile.allowance_mm,
                Face::Underside => 0.0,
            },
        };
        let notes = notes(wanted);
        let whole = post::Program {
            path,
            part: &job.name,
            tile: &tile.setup.tile.name,
            operation: wanted.kind.word(),
            number,
            section: None,
            tool: &shop.tools[operation],
            stock: &stock,
            z_zero: match (face, job.stock.z_zero) {
                (Face::Top, ZZero::PartTop) => post::ZZero::PartTop,
                _ => post::ZZero::StockTop,
            },
            spindle: wanted.kind != Kind::Outline,
            wcs: &job.machine.wcs,
            clearance_mm: tile.clearance_mm - tile.zero_over_face_mm(face),
            notes: &notes,
        };
        let mut programs = Vec::new();
        for (section, path) in post::sections(&whole, self.dialect, &shop.machine)? {
            let number = number + section.map_or(0, |section| section.index - 1);
            let program = post::Program { path: &path, section, number, ..whole.clone() };
            programs.push(self.one(operation, &program)?);
            if self.progress.interrupted() {
                return Err(Error::Interrupted);
            }
        }
        Ok(programs)
    }

    fn one(&self, operation: usize, program: &post::Program) -> Result<Program, Error> {
        let file = self.file(operation, program.section);
        let path = self.folder.join(&file);
        let output = |source| Error::Output { path: path.clone(), source };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(output)?;
        }
        self.progress.begin("write", 1);
        let mut out = BufWriter::with_capacity(1 << 20, File::create(&path).map_err(output)?);
        let written = post::write(program, self.dialect, &self.shop.machine, &mut out)?;
        out.flush().map_err(output)?;
        self.progress.begin("read back", 1);
        let open = File::open(&path).map_err(output)?;
        let options = verify::Options { rml_unit_mm: self.dialect.unit_mm, ..verify::Options::default() };
        let reading = Reading::from(&mut BufReader::with_capacity(1 << 20, open), &options)
            .map_err(|source| Error::ReadBack { path: file.clone(), source })?;
        let known = reading.motions.iter().filter(|motion| motion.known()).map(|motion| motion.to_mm);
        let lowest = |lowest: [f64; 3], place: [f64; 3]| if place[2] < lowest[2] { place } else { lowest };
        let ((extent, lowest_mm), timing) = rayon::join(
            || (reading.extent(), known.reduce(lowest)),
            || verify::time(&reading, &(&self.shop.machine).into()),
        );
        post::stamp_time(&mut out, &written, self.dialect, timing.total_s)?;
        out.flush().map_err(output)?;
        let tilt = program.path.tilt;
        let face = self.job.operations[operation].face;
        let section = program.section;
        Ok(Program { file, operation, face, section, reading, extent, lowest_mm, timing, tilt })
    }

    /// `programs/<tile>-<nn>-<operation>-<tool>.<ext>`, with `-s<nn>` for a section, in a folder for each
    /// post where there are several.
    fn file(&self, operation: usize, section: Option<Section>) -> PathBuf {
        let tool = self.shop.tools[operation].name.replace(':', "-");
        let kind = self.job.operations[operation].kind.word();
        let section = section.map_or(String::new(), |section| {
            let digits = section.count.to_string().len().max(2);
            format!("-s{:0digits$}", section.index)
        });
        let (tile, dialect) = (&self.tile.setup.tile.name, self.dialect);
        let name = format!("{tile}-{:02}-{kind}-{tool}{section}.{}", operation + 1, dialect.extension);
        let programs = Path::new("programs");
        if self.shop.dialects.len() > 1 {
            programs.join(&dialect.name).join(name)
        } else {
            programs.join(name)
        }
    }
}

/// What the header says of work beside the surface.
fn notes(operation: &Operation) -> Vec<(&'static str, String)> {
    let mut notes = Vec::new();
    if operation.face == Face::Underside {
        notes.push((
            "face",
            "underside: turn the blank over left to right; X0 Y0 is the tile's lower left corner as it lies then"
                .into(),
        ));
    }
    if operation.kind == Kind::Outline {
        notes.push(("air", "runs round the tile, then round all that is cut, spindle off".into()));
    }
    notes
}
