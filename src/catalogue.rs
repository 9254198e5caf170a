//! Data files by name: machines, dialects, fixtures and tool libraries.
//!
//! A name that holds a slash or ends in `.toml` is a path, taken from the folder of the job; any
//! other name is looked for in that folder and then among the files that come with the program.

use std::path::Path;

use crate::settings::{self, Source};

/// What a data file describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Machine,
    Dialect,
    Fixture,
    Library,
}

impl Kind {
    fn noun(self) -> &'static str {
        match self {
            Kind::Machine => "machine",
            Kind::Dialect => "post",
            Kind::Fixture => "fixture",
            Kind::Library => "tool library",
        }
    }

    fn embedded(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Kind::Machine => MACHINES,
            Kind::Dialect => DIALECTS,
            Kind::Fixture => FIXTURES,
            Kind::Library => LIBRARIES,
        }
    }
}

macro_rules! file {
    ($name:literal, $path:literal) => {
        ($name, include_str!(concat!("../", $path)))
    };
}

const MACHINES: &[(&str, &str)] = &[
    file!("grbl-router", "posts/machines/grbl-router.toml"),
    file!("linuxcnc-mill", "posts/machines/linuxcnc-mill.toml"),
    file!("linuxcnc-sim", "posts/machines/linuxcnc-sim.toml"),
    file!("roland-egx-350", "posts/machines/roland-egx-350.toml"),
    file!("roland-egx-400", "posts/machines/roland-egx-400.toml"),
    file!("roland-egx-600", "posts/machines/roland-egx-600.toml"),
    file!("roland-mdx-20", "posts/machines/roland-mdx-20.toml"),
    file!("roland-mdx-40a", "posts/machines/roland-mdx-40a.toml"),
    file!("roland-mdx-50", "posts/machines/roland-mdx-50.toml"),
    file!("roland-mdx-540", "posts/machines/roland-mdx-540.toml"),
    file!("roland-srm-20", "posts/machines/roland-srm-20.toml"),
];
const DIALECTS: &[(&str, &str)] = &[
    file!("fanuc", "posts/fanuc.toml"),
    file!("fluidnc", "posts/fluidnc.toml"),
    file!("grbl", "posts/grbl.toml"),
    file!("grblhal", "posts/grblhal.toml"),
    file!("haas", "posts/haas.toml"),
    file!("linuxcnc", "posts/linuxcnc.toml"),
    file!("mach3", "posts/mach3.toml"),
    file!("rml1", "posts/rml1.toml"),
    file!("rml1-25um", "posts/rml1-25um.toml"),
    file!("roland-nc", "posts/roland-nc.toml"),
];
const FIXTURES: &[(&str, &str)] = &[
    file!("clamps", "fixtures/clamps.toml"),
    file!("corner-clamps", "fixtures/corner-clamps.toml"),
    file!("dowel-plate", "fixtures/dowel-plate.toml"),
    file!("tape-board", "fixtures/tape-board.toml"),
    file!("vacuum-plate", "fixtures/vacuum-plate.toml"),
    file!("vise", "fixtures/vise.toml"),
];
const LIBRARIES: &[(&str, &str)] =
    &[file!("tools", "samples/tools.toml"), file!("tools-srm-20", "samples/tools-srm-20.toml")];

/// Why a data file was not found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{noun} \"{name}\" is not known; hint: {hint}, or give a file as ./{name}.toml")]
    Unknown { noun: &'static str, name: String, hint: String },
    #[error(transparent)]
    File(#[from] settings::Error),
}

/// The names of the files that come with the program, in alphabetical order.
pub fn names(kind: Kind) -> impl Iterator<Item = &'static str> {
    kind.embedded().iter().map(|(name, _)| *name)
}

/// The text of the file that `name` means to a job in `folder` (the current one if None).
pub fn find(kind: Kind, name: &str, folder: Option<&Path>) -> Result<Source, Error> {
    let folder = folder.unwrap_or(Path::new(""));
    if !is_name(name) {
        return Ok(Source::read(&folder.join(name))?);
    }
    let beside = folder.join(format!("{name}.toml"));
    if !name.is_empty() && declares(kind, &beside) {
        return Ok(Source::read(&beside)?);
    }
    match kind.embedded().iter().find(|(known, _)| *known == name) {
        Some((known, text)) => Ok(Source::new(text, &format!("{known}.toml"))),
        None => {
            let known: Vec<&str> = names(kind).collect();
            let shown = name.chars().take(60).flat_map(char::escape_debug).collect();
            Err(Error::Unknown { noun: kind.noun(), name: shown, hint: nearest(name, &known) })
        }
    }
}

/// Whether it is a name, and no path.
pub fn is_name(name: &str) -> bool {
    !name.contains(['/', '\\']) && !name.ends_with(".toml")
}

/// Whether a file beside the job is of this kind: `linuxcnc.toml` may be a dialect or a job.
fn declares(kind: Kind, path: &Path) -> bool {
    let wanted = match kind {
        Kind::Machine => "travel",
        Kind::Dialect => "word",
        Kind::Fixture => "border_mm",
        Kind::Library => "tool",
    };
    match Source::read(path).map(|source| source.parse::<toml::Table>()) {
        Ok(Ok(table)) => table.contains_key(wanted),
        Ok(Err(_)) => true,
        Err(settings::Error::Read { .. }) => false,
        Err(_) => true,
    }
}

/// "did you mean ...?" with the nearest of the names known, else all of them.
pub fn nearest(word: &str, known: &[&str]) -> String {
    let likeness = |name: &str| strsim::jaro_winkler(&word.to_lowercase(), &name.to_lowercase());
    let best = known.iter().map(|name| (likeness(name), *name)).max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((likeness, name)) if likeness > 0.75 => format!("did you mean \"{name}\"?"),
        Some(_) => {
            let quoted: Vec<String> = known.iter().take(20).map(|name| format!("\"{name}\"")).collect();
            format!("known: {}", quoted.join(", "))
        }
        None => "none is known here".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_path_then_a_file_beside_the_job_then_one_that_comes_along() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let own = folder.path().join("grbl-router.toml");
        assert_eq!(
            find(Kind::Machine, "grbl-router", Some(folder.path())).expect("embedded").path(),
            "grbl-router.toml"
        );
        std::fs::write(&own, "schema = 1\n[travel]\n").expect("writable");
        let found = find(Kind::Machine, "grbl-router", Some(folder.path())).expect("beside the job");
        assert_eq!(found.path(), own.display().to_string());
        let by_path = find(Kind::Machine, "./grbl-router.toml", Some(folder.path())).expect("a path");
        assert!(by_path.path().ends_with("grbl-router.toml"));
        std::fs::write(folder.path().join("rml1.toml"), "schema = 1\n[part]\n").expect("writable");
        assert_eq!(
            find(Kind::Dialect, "rml1", Some(folder.path())).expect("the job beside is no dialect").path(),
            "rml1.toml"
        );
    }

    #[test]
    fn an_unknown_name_is_told_the_nearest() {
        let message = |kind, name| find(kind, name, None).expect_err("unknown").to_string();
        assert_eq!(
            message(Kind::Machine, "roland-egx-660"),
            "machine \"roland-egx-660\" is not known; hint: did you mean \"roland-egx-600\"?, or give a file as ./roland-egx-660.toml"
        );
        assert_eq!(
            message(Kind::Dialect, "zz"),
            "post \"zz\" is not known; hint: known: \"fanuc\", \"fluidnc\", \"grbl\", \"grblhal\", \"haas\", \"linuxcnc\", \
             \"mach3\", \"rml1\", \"rml1-25um\", \"roland-nc\", or give a file as ./zz.toml"
        );
    }
}
