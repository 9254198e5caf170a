//! Programs and setups that are refused: tests/refuse/post/*.txt. The first line of a case is the
//! message, the second the change in [`refusal`] that makes it.

use std::path::PathBuf;

use screenmill::cutter::Shape;
use screenmill::machine::{
    Blanks, Bounds, Fixture, Library, Machine, Quantum, Setup, Stock, Tool, ZNeed, floor_mm, split,
};
use screenmill::post::{self, Dialect, Program, StockFacts, ZZero};
use screenmill::toolpath::{Kind, Move, Toolpath};

/// A writer that must not be written to.
struct Untouched;

impl std::io::Write for Untouched {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        panic!("a refused program has been written to");
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// A disk that is full.
struct Full;

impl std::io::Write for Full {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        Err(std::io::ErrorKind::StorageFull.into())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn program(change: &str) -> String {
    let mut dialect = Dialect::find("rml1", None).expect("comes along");
    let mut machine = Machine::find("roland-egx-600", None).expect("comes along");
    let mut tool = Library::find("tools", None).expect("comes along").tool("ball-1").expect("in it").clone();
    let at = |kind, x, y, z| Move { kind, to: [x, y, z] };
    let mut moves = vec![
        at(Kind::Rapid, 0, 0, 500),
        at(Kind::Plunge, 0, 0, -10),
        at(Kind::Cut, 100, 0, -10),
        at(Kind::Rapid, 100, 0, 500),
    ];
    let (mut unit_mm, mut clearance_mm, mut wcs) = (0.01, 5.0, "G54");
    let mut out: Box<dyn std::io::Write> = Box::new(Untouched);
    match change {
        "grid" => unit_mm = 0.001,
        "empty" => moves.clear(),
        "start" => moves[0].to[2] = 100,
        "clearance" => clearance_mm = 0.0,
        "clearance-nan" => clearance_mm = f64::NAN,
        "rapid" => moves[2].kind = Kind::Rapid,
        "value" => {
            moves[2].to[0] = 9_000_000;
            moves[3].to[0] = 9_000_000;
        }
        "feed-slow" => {
            machine.rate.feed_min_mm_min = 1.0;
            tool.plunge_mm_min = 3.0;
        }
        "feed-fast" => tool.feed_mm_min = 2000.0,
        "plunge-fast" => tool.plunge_mm_min = 1000.0,
        "feed-zero" => tool.feed_mm_min = 0.0,
        "rpm" => tool.spindle_rpm = 40_000.0,
        "rpm-nan" => tool.spindle_rpm = f64::NAN,
        "memory" => machine.transfer.memory_bytes = Some(100),
        "dwell" => machine.spindle.spin_up_s = 40.0,
        "line" => dialect.limits.line_max = 8,
        "disk" => out = Box::new(Full),
        "wcs" => {
            dialect = Dialect::find("linuxcnc", None).expect("comes along");
            unit_mm = dialect.unit_mm;
            wcs = "G60";
        }
        _ => panic!("unknown change {change}"),
    }
    let path = Toolpath { unit_mm, moves, pass_starts: vec![0], tilt: None };
    let stock = StockFacts {
        material: "aluminium".into(),
        width_mm: 10.0,
        height_mm: 10.0,
        thickness_mm: 20.0,
        top_allowance_mm: 0.2,
    };
    let program = Program {
        path: &path,
        part: "p",
        tile: "r0c0",
        operation: "finish",
        number: 1,
        section: None,
        tool: &tool,
        stock: &stock,
        spindle: true,
        z_zero: ZZero::StockTop,
        wcs,
        clearance_mm,
        notes: &[],
    };
    post::write(&program, &dialect, &machine, &mut out).expect_err(change).to_string()
}

fn setup(change: &str) -> String {
    let machine = Machine::find("roland-srm-20", None).expect("comes along");
    let fixture = Fixture::find("clamps", None).expect("comes along");
    let library = Library::find("tools", None).expect("comes along");
    let stock = Stock {
        thickness_mm: 10.0,
        top_allowance_mm: 0.2,
        margin_mm: 10.0,
        min_floor_mm: 2.0,
        blanks: Blanks::PerTile,
    };
    let tiles = |stock: &Stock, quantum| split([400.0, 400.0], quantum, 1.0, stock, &machine, &fixture);
    let cell = Quantum::Cell { cell_mm: 4.0 };
    let place = || {
        let tile = tiles(&stock, cell).expect("fits").swap_remove(0);
        Setup::place(tile, [400.0, 400.0], &stock, &machine, &fixture)
    };
    let motions = |overrun: f64| Bounds {
        low_mm: [-overrun, -overrun, -1.0],
        high_mm: [100.0 + overrun, 100.0 + overrun, 20.0],
    };
    let error = match change {
        "room-margin" => tiles(&Stock { margin_mm: 80.0, ..stock }, cell).err(),
        "room-cell" => tiles(&stock, Quantum::Cell { cell_mm: 150.0 }).err(),
        "floor" => {
            let need = ZNeed { depth_mm: 8.3, top_allowance_mm: 0.2, clearance_mm: 5.0 };
            floor_mm("r1c0", need, &stock).err()
        }
        "stroke" => place().check(&motions(60.0), 0.0, &machine).err(),
        "stroke-z" => {
            let deep = Bounds { low_mm: [0.0, 0.0, -41.0], ..motions(0.0) };
            place().check(&deep, 50.0, &machine).err()
        }
        "under-the-blank" => {
            let deep = Bounds { low_mm: [0.0, 0.0, -10.5], ..motions(0.0) };
            place().check(&deep, 0.2, &machine).err()
        }
        "clamp-near" => place().check_reach(4.5, 5.5, 3.0, stock.margin_mm).err(),
        "clamp-in-the-tile" => {
            let near = Stock { margin_mm: 2.0, ..stock };
            let tile = tiles(&near, cell).expect("fits").swap_remove(0);
            let setup = Setup::place(tile, [400.0, 400.0], &near, &machine, &fixture);
            setup.check_reach(1.0, 1.0, 3.0, near.margin_mm).err()
        }
        "vise-sheet" => {
            let vise = Fixture::find("vise", None).expect("comes along");
            let one = Stock { blanks: Blanks::One, ..stock };
            split([400.0, 90.0], cell, 1.0, &one, &machine, &vise).err()
        }
        "no-usable-area" => {
            let mut none = fixture.clone();
            none.border_mm.x = 120.0;
            split([8.0, 8.0], cell, 1.0, &stock, &machine, &none).err()
        }
        "reach" => library.tool("ball-0.4").and_then(|tool| tool.check_reach(19.5)).err(),
        "inline-feed" => Tool::inline(Shape::Ball { diameter_mm: 1.0 }, 0.0, 80.0, 20_000.0).err(),
        _ => panic!("unknown change {change}"),
    };
    error.expect(change).to_string()
}

fn refusal(change: &str) -> String {
    match change.split_once(' ') {
        Some(("program", change)) => program(change),
        Some(("setup", change)) => setup(change),
        _ => panic!("a case says program or setup"),
    }
}

#[test]
fn each_bad_program_and_setup_has_its_message() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/refuse/post");
    let mut cases: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("cases").map(|entry| entry.expect("a file").path()).collect();
    cases.sort();
    assert!(cases.len() > 20);
    for case in cases {
        let text = std::fs::read_to_string(&case).expect("a case");
        let (message, change) = text.trim_end().split_once('\n').expect("two lines");
        let found = refusal(change);
        if std::env::var_os("BLESS").is_some() {
            std::fs::write(&case, format!("{found}\n{change}\n")).expect("writable");
            println!("{change}: {found}");
            continue;
        }
        assert_eq!(found, message, "{}", case.display());
    }
}
