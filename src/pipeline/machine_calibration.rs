//! Three short programs that run in air, and what their measured times say about a machine.
//!
//! 1. Legs back and forth, along X and along Y. Every one begins and ends at rest, so
//!    t = sum (L / v + v / a): acceleration.
//! 2. Legs of 1 mm that turn by 90 and by 20 degrees: the corner rule's deviation.
//! 3. The way of one long leg in blocks of 0.1 mm: the least time of a block.
//!
//! The constants are found by timing the programs' own text with the model that times every other
//! program, so whatever the model knows (spin-up, approach, look-ahead) cancels out.

use crate::cutter::Shape;
use crate::machine::{self, Corner, Machine, Tool};
use crate::post::{self, Dialect, Program, StockFacts, ZZero};
use crate::toolpath::{Kind, Move, Toolpath};
use crate::verify::{self, Kinematics, Options, Reading};

/// Feed of all three programs, where the machine makes it.
const FEED_MM_MIN: f64 = 1800.0;
/// The programs stay within this square from their zero.
pub const ROOM_MM: f64 = 60.0;
/// Above Z0.
pub const HEIGHT_MM: f64 = 5.0;
/// A measured time may miss what is possible by this share, for the hand on the stopwatch.
const MISS: f64 = 0.02;
/// A block's time is not seen where it adds less than this share.
const UNSEEN: f64 = 0.01;

/// A program to measure.
#[derive(Clone, Debug)]
pub struct Measured {
    pub name: &'static str,
    /// What its time is for, in an operator's words.
    pub what: &'static str,
    pub text: Vec<u8>,
    /// Its time by the profile as it stands.
    pub expected_s: f64,
    reading: Reading,
}

/// What three times say.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    /// The profile with its new constants.
    pub machine: Machine,
    /// Of the new profile, against the times measured, as shares.
    pub off: [f64; 3],
    /// Whether the corner's deviation was found: LinuxCNC's and a full stop have none.
    pub corner_found: bool,
}

/// Why a machine can't be calibrated.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Machine(#[from] machine::Error),
    #[error(transparent)]
    Post(#[from] post::Error),
    #[error("the program to measure was not read back: {0}")]
    ReadBack(#[from] verify::Error),
    #[error(
        "{machine} travels {x_mm} x {y_mm} mm, the programs need {ROOM_MM} x {ROOM_MM} mm; hint: its motion can be written into the profile by hand"
    )]
    Room { machine: String, x_mm: f64, y_mm: f64 },
    #[error("time {number} is {seconds} s, it must be a number of seconds above 0")]
    NotATime { number: usize, seconds: f64 },
    #[error(
        "time 1 is {seconds} s, with any acceleration the legs take {least_s:.2} to {most_s:.0} s at their feed; hint: time program 1 from start to rest, with no feed override"
    )]
    Acceleration { seconds: f64, least_s: f64, most_s: f64 },
    #[error(
        "time 2 is {seconds} s, with the acceleration found its corners take {least_s:.2} s (none slows) to {most_s:.2} s (all stop); hint: time it from start to rest, in the order 1 2 3"
    )]
    Corners { seconds: f64, least_s: f64, most_s: f64 },
    #[error(
        "time 3 is {seconds} s, with the acceleration found its way takes {least_s:.2} s at least; hint: time it from start to rest, in the order 1 2 3"
    )]
    Blocks { seconds: f64, least_s: f64 },
    #[error(
        "the line to {machine} takes {transfer_s:.1} s for program {number}, longer than its motion: nothing is learnt from its time; hint: a faster line, or send from memory"
    )]
    Transfer { machine: String, number: usize, transfer_s: f64 },
}

/// Writes the three programs in a dialect of the machine.
pub fn programs(machine: &Machine, dialect: &Dialect) -> Result<[Measured; 3], Error> {
    let (x_mm, y_mm) = (machine.travel.x_mm, machine.travel.y_mm);
    if x_mm < ROOM_MM || y_mm < ROOM_MM {
        return Err(Error::Room { machine: machine.name.clone(), x_mm, y_mm });
    }
    Ok([
        measured(
            machine,
            dialect,
            1,
            "1-acceleration",
            "legs of 5 mm back and forth: acceleration",
            &legs(),
        )?,
        measured(machine, dialect, 2, "2-corners", "turns of 90 and 20 degrees: corners", &corners())?,
        measured(machine, dialect, 3, "3-blocks", "blocks of 0.1 mm: time of a block", &blocks())?,
    ])
}

fn legs() -> Vec<[f64; 2]> {
    let leg = |axis: usize| {
        let mut far = [0.0; 2];
        far[axis] = 5.0;
        [far, [0.0; 2]]
    };
    let of = |axis| std::iter::repeat_n(leg(axis), 50).flatten();
    of(0).chain(of(1)).collect()
}

fn corners() -> Vec<[f64; 2]> {
    // A staircase to (25, 25), and a zigzag of 10 degrees to either side of X; each back the same way.
    let stairs: Vec<[f64; 2]> = (1..=50).map(|i| [f64::from((i + 1) / 2), f64::from(i / 2)]).collect();
    let (sin, cos) = 10.0f64.to_radians().sin_cos();
    let zigzag: Vec<[f64; 2]> = (1..=50).map(|i| [f64::from(i) * cos, f64::from(i % 2) * sin]).collect();
    let mut points = Vec::new();
    for _ in 0..2 {
        for way in [&stairs, &zigzag] {
            points.extend_from_slice(way);
            points.extend(way.iter().rev().skip(1));
            points.push([0.0; 2]);
        }
    }
    points
}

fn blocks() -> Vec<[f64; 2]> {
    let there = (1..=500).map(|i| [0.1 * f64::from(i), 0.0]);
    let back = (0..500).rev().map(|i| [0.1 * f64::from(i), 0.0]);
    std::iter::repeat_n(there.chain(back), 6).flatten().collect()
}

fn measured(
    machine: &Machine,
    dialect: &Dialect,
    number: u32,
    name: &'static str,
    what: &'static str,
    points: &[[f64; 2]],
) -> Result<Measured, Error> {
    let unit_mm = dialect.unit_mm;
    let grid = |mm: f64| (mm / unit_mm).round() as i32;
    let height = (HEIGHT_MM / unit_mm).ceil() as i32;
    let at = |kind: Kind, p: [f64; 2]| Move { kind, to: [grid(p[0]), grid(p[1]), height] };
    let mut moves = vec![at(Kind::Rapid, [0.0; 2])];
    moves.extend(points.iter().map(|p| at(Kind::Cut, *p)));
    let path = Toolpath { unit_mm, moves, ..Toolpath::default() };
    let feed = FEED_MM_MIN.min(machine.rate.feed_xy_max_mm_min).max(machine.rate.feed_min_mm_min);
    let plunge = feed.min(machine.rate.feed_z_max_mm_min);
    let shape = Shape::Ball { diameter_mm: 1.0 };
    let tool = Tool::inline(shape, feed, plunge, machine.spindle.rpm_min)?;
    let stock = StockFacts {
        material: "air".into(),
        width_mm: ROOM_MM,
        height_mm: ROOM_MM,
        thickness_mm: 1.0,
        top_allowance_mm: 0.0,
    };
    let program = Program {
        path: &path,
        part: "none, runs in air",
        tile: "none",
        operation: name,
        number,
        section: None,
        tool: &tool,
        stock: &stock,
        spindle: true,
        z_zero: ZZero::StockTop,
        wcs: dialect.wcs.first().map_or("", String::as_str),
        clearance_mm: HEIGHT_MM,
        notes: &[("time", what.into())],
    };
    let mut text = Vec::new();
    post::write(&program, dialect, machine, &mut text)?;
    let reading = Reading::of(&text, &Options { rml_unit_mm: dialect.unit_mm, ..Options::default() })?;
    let expected_s = verify::time(&reading, &Kinematics::from(machine)).total_s;
    Ok(Measured { name, what, text, expected_s, reading })
}

/// Finds a machine's acceleration, corner deviation and block time from the times of the three
/// programs, in seconds from start to rest. The accelerations of all axes change by one factor.
///
/// # Errors
/// Times that no constants would give.
pub fn calibrate(machine: &Machine, dialect: &Dialect, times_s: [f64; 3]) -> Result<Calibrated, Error> {
    for (index, seconds) in times_s.into_iter().enumerate() {
        if !(seconds > 0.0 && seconds < 1e6) {
            return Err(Error::NotATime { number: index + 1, seconds });
        }
    }
    let programs = programs(machine, dialect)?;
    let mut found = Kinematics::from(machine);
    let before = found;
    for (index, program) in programs.iter().enumerate() {
        let timing = verify::time(&program.reading, &found);
        if timing.waiting_s > 0.0 {
            let (machine, transfer_s) = (machine.name.clone(), timing.total_s);
            return Err(Error::Transfer { machine, number: index + 1, transfer_s });
        }
    }
    let time = |index: usize, machine: &Kinematics| verify::time(&programs[index].reading, machine).total_s;
    let scaled = |scale: f64, machine: &Kinematics| Kinematics {
        acceleration_mm_s2: before.acceleration_mm_s2.map(|a| a * scale),
        ..*machine
    };
    found.block_s = 0.0;
    let mut scale = 1.0;
    // The block's time is seen in program 3 beside the acceleration, and in program 1 if it is long.
    for _ in 0..3 {
        let [low, high] = [1.0, 1e5].map(|a| a / before.acceleration_mm_s2[0]);
        let [most_s, least_s] = [low, high].map(|scale| time(0, &scaled(scale, &found)));
        if !(least_s..=most_s).contains(&times_s[0]) {
            return Err(Error::Acceleration { seconds: times_s[0], least_s, most_s });
        }
        scale = falling(low.ln(), high.ln(), times_s[0], |s| time(0, &scaled(s.exp(), &found))).exp();
        found = scaled(scale, &found);
        let least_s = time(2, &Kinematics { block_s: 0.0, ..found });
        if times_s[2] < least_s * (1.0 - MISS) {
            return Err(Error::Blocks { seconds: times_s[2], least_s });
        }
        let block_s = |t: f64| Kinematics { block_s: -t, ..found };
        // LinuxCNC's blocks take what its servo loop takes.
        let own_pace = machine.motion.corner == Corner::Blend;
        found.block_s = if own_pace || times_s[2] < least_s * (1.0 + UNSEEN) {
            0.0
        } else {
            falling(-10.0, 0.0, times_s[2], |t| time(2, &block_s(t))).abs()
        };
    }
    let mut calibrated = machine.clone();
    let motion = &mut calibrated.motion;
    motion.acceleration_mm_s2.x *= scale;
    motion.acceleration_mm_s2.y *= scale;
    motion.acceleration_mm_s2.z *= scale;
    motion.block_s = found.block_s;
    let corner_found = motion.corner == Corner::JunctionDeviation;
    if corner_found {
        let turned = |mm: f64| Kinematics { corner: verify::Corner::JunctionDeviation { mm }, ..found };
        let [most_s, least_s] = [0.0, 10.0].map(|mm| time(1, &turned(mm)));
        if times_s[1] < least_s * (1.0 - MISS) || times_s[1] > most_s * (1.0 + MISS) {
            return Err(Error::Corners { seconds: times_s[1], least_s, most_s });
        }
        motion.corner_mm = if times_s[1] >= most_s {
            0.0
        } else {
            falling(1e-6f64.ln(), 10.0f64.ln(), times_s[1], |d| time(1, &turned(d.exp()))).exp()
        };
    }
    let [a, b, c] = times_s;
    motion.source = format!("measured with calibrate-machine: {a} s, {b} s, {c} s");
    motion.unconfirmed = false;
    let found = Kinematics::from(&calibrated);
    let off = std::array::from_fn(|index| time(index, &found) / times_s[index] - 1.0);
    Ok(Calibrated { machine: calibrated, off, corner_found })
}

/// Where a falling function comes down to a value: the least such place in `low ..= high`.
fn falling(mut low: f64, mut high: f64, value: f64, of: impl Fn(f64) -> f64) -> f64 {
    if of(low) <= value {
        return low;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if of(middle) <= value {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}
