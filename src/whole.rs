//! Files that stand under their names whole or not at all.

use std::fs::File;
use std::io::{Error, ErrorKind, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// A file on its way to its name: until [`Whole::publish`] it is hidden beside it, and it is gone if it is dropped before.
#[derive(Debug)]
pub struct Whole {
    file: NamedTempFile,
    path: PathBuf,
}

impl Whole {
    /// Begins an empty file, with the mode of any new one. Errors: a folder that cannot be written to, or a name that
    /// stands for something other than a file (a folder, a device: renaming would replace it).
    pub fn beside(path: &Path) -> Result<Whole> {
        match path.metadata() {
            Ok(there) if there.is_dir() => return Err(ErrorKind::IsADirectory.into()),
            Ok(there) if !there.is_file() => return Err(Error::other("it is a device and no file")),
            _ => {}
        }
        let mut builder = tempfile::Builder::new();
        // Temporary files are private; this one becomes a user's, as far as the umask lets it.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        // The error names the hidden file, which means nothing to a user; its kind is enough.
        let file = builder.prefix(".screenmill-").tempfile_in(folder(path));
        let file = file.map_err(|error| Error::from(error.kind()))?;
        Ok(Whole { file, path: path.to_path_buf() })
    }

    /// Where it is for now.
    pub fn hidden(&self) -> &Path {
        self.file.path()
    }

    /// The file itself.
    pub fn file_mut(&mut self) -> &mut File {
        self.file.as_file_mut()
    }

    /// Gives it its name; what stood there is replaced.
    pub fn publish(self) -> Result<()> {
        self.file.persist(&self.path).map(|_| ()).map_err(|error| error.error)
    }
}

impl Write for Whole {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.file_mut().write(bytes)
    }

    fn flush(&mut self) -> Result<()> {
        self.file_mut().flush()
    }
}

impl Seek for Whole {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.file_mut().seek(to)
    }
}

/// Gives all their names or none: if one cannot have its own, those before it are taken away again. The error
/// comes with the name.
pub fn publish_all(files: impl IntoIterator<Item = Whole>) -> std::result::Result<(), (PathBuf, Error)> {
    let mut named = Vec::new();
    for file in files {
        let path = file.path.clone();
        if let Err(error) = file.publish() {
            for path in named {
                // What cannot be removed cannot be helped.
                let _ = std::fs::remove_file::<PathBuf>(path);
            }
            return Err((path, error));
        }
        named.push(path);
    }
    Ok(())
}

/// The folder that a file is in.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_get_their_names_together_or_not_at_all() {
        let folder = tempfile::tempdir().expect("a folder");
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        let made = || [&a, &b].map(|path| Whole::beside(path).expect("a file"));
        let files = made();
        // In the meantime the second name is taken by what cannot be replaced.
        std::fs::create_dir(&b).expect("a folder");
        let (path, _) = publish_all(files).expect_err("a folder in the way");
        assert_eq!(path, b);
        let left: Vec<_> = std::fs::read_dir(folder.path()).expect("a folder").collect();
        assert_eq!(left.len(), 1, "{left:?}");
        assert_eq!(Whole::beside(&b).expect_err("a folder").kind(), ErrorKind::IsADirectory);
        std::fs::remove_dir(&b).expect("empty");
        publish_all(made()).expect("both");
        assert!(a.is_file() && b.is_file());
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 2);
    }

    #[test]
    #[cfg(unix)]
    fn a_device_is_not_replaced() {
        assert!(Whole::beside(Path::new("/dev/null")).is_err());
    }
}
