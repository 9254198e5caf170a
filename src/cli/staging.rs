//! Outputs of a job appear whole: they are made in a hidden folder beside and renamed at the end.

use std::fs;
use std::path::{Path, PathBuf};

use screenmill::pipeline::Error;
use screenmill::report;
use tempfile::TempDir;

use super::console;

/// A hidden folder inside the output folder, removed with all it holds unless it is published.
pub struct Staging {
    folder: TempDir,
    out: PathBuf,
    /// Whether the output folder was made for this run.
    made: bool,
    published: bool,
}

impl Staging {
    /// Makes the output folder, if it is not there, and the hidden one in it.
    pub fn beside(out: &Path) -> Result<Staging, Error> {
        let refused = |source| Error::OutputFolder { path: out.to_path_buf(), source };
        let made = !out.exists();
        fs::create_dir_all(out).map_err(refused)?;
        let folder = tempfile::Builder::new().prefix(".screenmill-").tempdir_in(out).map_err(refused)?;
        console::unfinished(if made { out } else { folder.path() });
        Ok(Staging { folder, out: out.to_path_buf(), made, published: false })
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The same refusal with files named where they would have ended up.
    pub fn named(&self, error: report::Error) -> report::Error {
        let at_last = |path: String| match Path::new(&path).strip_prefix(self.folder.path()) {
            Ok(name) => self.out.join(name).display().to_string(),
            Err(_) => path,
        };
        match error {
            report::Error::Io { path, source } => report::Error::Io { path: at_last(path), source },
            report::Error::Figure { path, source } => report::Error::Figure { path: at_last(path), source },
            other => other,
        }
    }

    /// Puts these under their final names; what an earlier run left there goes first.
    pub fn publish(mut self, outputs: &[&str]) -> Result<(), Error> {
        console::finished(if self.made { &self.out } else { self.folder.path() });
        for name in outputs {
            let (from, to) = (self.folder.path().join(name), self.out.join(name));
            let failed = |source| Error::OutputFolder { path: to.clone(), source };
            if to.is_dir() {
                fs::remove_dir_all(&to).map_err(failed)?;
            } else if to.exists() {
                fs::remove_file(&to).map_err(failed)?;
            }
            if from.exists() && !is_empty(&from) {
                fs::rename(&from, &to).map_err(failed)?;
            }
        }
        self.published = true;
        Ok(())
    }
}

/// Whether a folder holds no file, at any depth.
fn is_empty(path: &Path) -> bool {
    path.is_dir()
        && fs::read_dir(path)
            .is_ok_and(|mut entries| entries.all(|entry| entry.is_ok_and(|e| is_empty(&e.path()))))
}

impl Drop for Staging {
    fn drop(&mut self) {
        if self.made && !self.published {
            // Nothing else is in a folder that this run made.
            let _ = fs::remove_dir_all(self.folder.path());
            let _ = fs::remove_dir(&self.out);
        }
    }
}
