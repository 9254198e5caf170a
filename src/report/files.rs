//! Files appear under their names whole or not at all.

use std::io::{BufWriter, Write};
use std::path::Path;

use serde::Serialize;

use super::Error;

/// Writes a file beside its name and renames it once it is whole.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), Error>,
) -> Result<(), Error> {
    let failed = |source| Error::Io { path: path.display().to_string(), source };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private; this one becomes a user's file, as far as the umask lets it.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let file = builder.prefix(".screenmill-").tempfile_in(folder);
    // The error names the temporary file, which means nothing to a user; its kind is enough.
    let mut file = file.map_err(|error| failed(error.kind().into()))?;
    let mut writer = BufWriter::new(file.as_file_mut());
    write(&mut writer)?;
    writer.flush().map_err(failed)?;
    drop(writer);
    file.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

/// Writes anything as indented JSON with a newline at its end.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Error> {
    write_whole(path, |writer| {
        let failed = |source| Error::Io { path: path.display().to_string(), source };
        serde_json::to_writer_pretty(&mut *writer, value).map_err(|error| failed(error.into()))?;
        writeln!(writer).map_err(failed)
    })
}
