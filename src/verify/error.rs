use std::fmt;

/// Where in a program's text: both count from 1, the column in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub line: u64,
    pub column: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// Why a program's text was not read.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("the text could not be read: {0}")]
    Io(#[from] std::io::Error),
    #[error("the text holds no motion; hint: is this a program in G-code or RML-1?")]
    Empty,
    #[error(
        "{at}: byte 0x{byte:02x} is not printable ASCII, and some controllers take such a byte as a command, even inside a comment; hint: save the text as plain ASCII"
    )]
    NotAscii { at: Place, byte: u8 },
    #[error("{at}: \"{found}\" does not begin a word; hint: a word is a letter and a number")]
    Character { at: Place, found: char },
    #[error(
        "{at}: \"{found}\" begins a parameter or an expression, only plain numbers are read; hint: have the numbers written out"
    )]
    Expression { at: Place, found: char },
    #[error("{at}: the comment that begins here is not closed; hint: ) on the same line")]
    CommentOpen { at: Place },
    #[error("{at}: a comment inside a comment; hint: controllers disagree about where it ends")]
    CommentNested { at: Place },
    #[error(
        "{at}: a block that begins with / is skipped by some controllers and run by others; hint: take out the block, or its /"
    )]
    BlockDelete { at: Place },
    #[error(
        "{at}: the word {letter} has no number; hint: a word is a letter and a number, as in X1.5; macros and prose are not read"
    )]
    NumberMissing { at: Place, letter: char },
    #[error(
        "{at}: the number of {letter} has an exponent; hint: write it out, most controllers do not read 1e3"
    )]
    Exponent { at: Place, letter: char },
    #[error("{at}: the number of {letter} has more than 17 digits before its point")]
    Digits { at: Place, letter: char },
    #[error("{at}: G4 names no time; hint: P or X with the seconds")]
    DwellTime { at: Place },
    #[error("{at}: the number of {letter} has two signs or two points, or a sign inside")]
    NumberMalformed { at: Place, letter: char },
    #[error("line {line}: longer than {most} bytes; hint: is this a program?")]
    LineTooLong { line: u64, most: usize },
    #[error(
        "{at}: the line goes on past the {most} bytes{counted} that this machine's controller takes; hint: shorten its comment, or put its words on two lines"
    )]
    LineCut { at: Place, most: usize, counted: &'static str },
    #[error(
        "{at}: the word {letter} is not read; hint: three axes X Y Z, arcs with I J K R, words F G M N O P Q S T H"
    )]
    Word { at: Place, letter: char },
    #[error(
        "{at}: the code {letter}{number} is not known; hint: take it out if it moves nothing, else write its motions with G0 and G1"
    )]
    Code { at: Place, letter: char, number: f64 },
    #[error("{at}: {code} is {what}, which is not read; hint: {hint}")]
    Unread { at: Place, code: &'static str, what: &'static str, hint: &'static str },
    #[error("{at}: the word {letter} stands twice in one block; hint: a line for each")]
    Repeated { at: Place, letter: char },
    #[error(
        "{at}: {letter}{second} and {letter}{first} in one block say different things; hint: a line for each"
    )]
    Conflict { at: Place, letter: char, first: f64, second: f64 },
    #[error("{at}: the word {letter} has no use in this block; hint: nothing in the block takes it")]
    Unused { at: Place, letter: char },
    #[error("{at}: {what} is {value}, it must lie in {low} .. {high}")]
    Range { at: Place, what: &'static str, value: f64, low: f64, high: f64 },
    #[error("{at}: axis words without a motion; hint: G0, G1, G2 or G3 must come first")]
    NoMotion { at: Place },
    #[error("{at}: a feed motion at feed {feed_mm_min}; hint: F must name a feed above 0 first")]
    Feed { at: Place, feed_mm_min: f64 },
    #[error(
        "{at}: a feed motion while {axes} is not known; hint: position with a rapid that names Z, then X and Y"
    )]
    Nowhere { at: Place, axes: &'static str },
    #[error("{at}: the arc has neither a centre in its plane nor R; hint: G17 takes I J, G18 I K, G19 J K")]
    ArcCentre { at: Place },
    #[error(
        "{at}: an absolute centre (G90.1) with one of its two words; hint: name both, controllers take the other for 0, for where the arc starts, or not at all"
    )]
    ArcAbsolute { at: Place },
    #[error(
        "{at}: a feed in the block that changes the units: LinuxCNC takes it in those before, Grbl in those after; hint: F in a later block"
    )]
    FeedUnits { at: Place },
    #[error(
        "{at}: the arc's end lies at radius {end_mm:.4} mm, its start at {start_mm:.4} mm; hint: is the centre relative (G91.1) or absolute (G90.1)?"
    )]
    ArcRadius { at: Place, start_mm: f64, end_mm: f64 },
    #[error(
        "{at}: an arc of radius {radius_mm:.4} mm cannot join points {apart_mm:.4} mm apart; hint: R of at least half of that"
    )]
    ArcReach { at: Place, radius_mm: f64, apart_mm: f64 },
    #[error("{at}: G{second} after G{first}: the offset between the two is not known")]
    Offsets { at: Place, first: f64, second: f64 },
    #[error("line {line}: the text ends without M2, M30 or a closing %; hint: is the file complete?")]
    NoEnd { line: u64 },
    #[error("{at}: {motions} motions are more than can be held; hint: cut the program in parts")]
    TooMany { at: Place, motions: usize },
    #[error(
        "{at}: the command {name} is not known to RML-1; hint: it has no comments, and a G-code text has none of its commands"
    )]
    Command { at: Place, name: String },
    #[error("{at}: a number without a command; hint: one comma between numbers, no blank after a sign")]
    Loose { at: Place },
    #[error(
        "{at}: {command} has {found} numbers, it takes {wanted}; hint: a comma between two, no exponents"
    )]
    Count { at: Place, command: &'static str, found: usize, wanted: &'static str },
    #[error("{at}: a comma without a number after it")]
    Comma { at: Place },
    #[error(
        "{at}: a number with two signs or two points, or a sign inside or alone; hint: -300, without a blank"
    )]
    Signs { at: Place },
    #[error("{at}: !RC{value} is neither a speed code, 0 .. 15, nor a speed in rpm, 100 .. 32767")]
    SpeedCode { at: Place, value: f64 },
    #[error("{at}: {value} is not a whole number of units; hint: controllers may drop the fraction")]
    Fraction { at: Place, value: f64 },
    #[error("{at}: {command} belongs to mode {mode}, the text began in mode {began}; hint: {hint}")]
    Mode { at: Place, command: &'static str, mode: u8, began: u8, hint: String },
    #[error("{at}: the last command has no terminator; hint: end the text with ; or a new line")]
    Terminator { at: Place },
    #[error(
        "{at}: {command} moves before {speed} named a speed; hint: name it after DF and IN, which reset it"
    )]
    Speed { at: Place, command: &'static str, speed: &'static str },
}
