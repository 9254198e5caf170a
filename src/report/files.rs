//! Files of any kind, written whole.

use std::io::{BufWriter, Write};
use std::path::Path;

use serde::Serialize;

use super::Error;
use crate::whole::Whole;

/// Writes a file beside its name and renames it once it is whole.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), Error>,
) -> Result<(), Error> {
    let failed = |source| Error::Io { path: path.display().to_string(), source };
    write_beside(path, write)?.publish().map_err(failed)
}

/// The same, and leaves it to be renamed.
pub fn write_beside(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), Error>,
) -> Result<Whole, Error> {
    let failed = |source| Error::Io { path: path.display().to_string(), source };
    let mut file = Whole::beside(path).map_err(failed)?;
    let mut writer = BufWriter::new(&mut file);
    write(&mut writer)?;
    writer.flush().map_err(failed)?;
    drop(writer);
    Ok(file)
}

/// Writes anything as indented JSON with a newline at its end.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Error> {
    write_whole(path, |writer| {
        let failed = |source| Error::Io { path: path.display().to_string(), source };
        serde_json::to_writer_pretty(&mut *writer, value).map_err(|error| failed(error.into()))?;
        writeln!(writer).map_err(failed)
    })
}
