use crate::verify;

/// Why a program was not taken up again.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Read(#[from] verify::Error),
    #[error("no pass is found: the program never comes down from a plane; hint: is this a milling program?")]
    NoPass,
    #[error("pass {at} is asked for, the program has passes {first} to {last}; hint: --at {first} .. {last}")]
    Pass { at: u64, first: u64, last: u64 },
    #[error(
        "pass {at} begins on line {line} together with another pass; hint: one command on each line, then again"
    )]
    SameLine { at: u64, line: u32 },
    #[error("line {line} changes the tool before pass {at}; hint: one program for each tool")]
    Tool { at: u64, line: usize },
    #[error("pass {at} is reached in relative coordinates (line {line}); hint: absolute coordinates (PA)")]
    Relative { at: u64, line: usize },
    #[error("pass {at} lies on the plane of PU and PD; only passes of Z and !ZZ are resumed")]
    Flat { at: u64 },
    #[error("from pass {at} on the new text would move otherwise than the program; it was not written")]
    Differs { at: u64 },
}
