//! One small program in every dialect, as bytes. `BLESS=1 cargo test --test golden_post` writes
//! them anew; read the difference before committing it.

use std::path::PathBuf;

use screenmill::machine::{Library, Machine};
use screenmill::post::{self, Dialect, Program, StockFacts, ZZero};
use screenmill::toolpath::{Kind, Move, Toolpath};

fn small(unit_mm: f64) -> Toolpath {
    let per_mm = (1.0 / unit_mm).round() as i32;
    let at = |kind, x: i32, y: i32, z: i32| Move { kind, to: [x, y, z] };
    let moves = vec![
        at(Kind::Rapid, -per_mm / 2, per_mm / 4, 5 * per_mm),
        at(Kind::Rapid, -per_mm / 2, per_mm / 4, per_mm / 2),
        at(Kind::Plunge, -per_mm / 2, per_mm / 4, -12),
        at(Kind::Cut, per_mm, per_mm / 4, -7),
        at(Kind::Cut, per_mm, per_mm / 4, -7),
        at(Kind::Cut, 2 * per_mm, per_mm / 4, -7),
        at(Kind::Cut, 2 * per_mm, per_mm / 2, -7),
        at(Kind::Plunge, 2 * per_mm, per_mm / 2, -9),
        at(Kind::Cut, 0, per_mm / 2, -9),
        at(Kind::Rapid, 0, per_mm / 2, 5 * per_mm),
        at(Kind::Rapid, 0, 0, 5 * per_mm),
        at(Kind::Plunge, 0, 0, -1),
        at(Kind::Cut, 1, 1, 0),
    ];
    Toolpath { unit_mm, moves, pass_starts: vec![0, 10], tilt: None }
}

fn written(dialect: &str, machine: &str, library: &str, z_zero: ZZero) -> String {
    let dialect = Dialect::find(dialect, None).expect("a dialect that comes along");
    let machine = Machine::find(machine, None).expect("a machine that comes along");
    // Controllers with a tool table are shown with a changer.
    let tool_changer = matches!(dialect.name.as_str(), "mach3" | "haas" | "fanuc");
    let machine = Machine { tool_changer, ..machine };
    let library = Library::find(library, None).expect("a library that comes along");
    let path = small(dialect.unit_mm);
    let mut tool = library.tool("ball-1").expect("in the library").clone();
    tool.spindle_rpm = tool.spindle_rpm.clamp(machine.spindle.rpm_min, machine.spindle.rpm_max);
    let stock = StockFacts {
        material: "aluminium-6082".into(),
        width_mm: 26.0,
        height_mm: 18.5,
        thickness_mm: 20.0,
        top_allowance_mm: 0.2,
    };
    let program = Program {
        path: &path,
        part: "Kino (Saal 3) ~ größe!",
        tile: "r0c0",
        operation: "finish",
        number: 1,
        section: None,
        tool: &tool,
        stock: &stock,
        spindle: true,
        z_zero,
        wcs: "G54",
        clearance_mm: 5.0,
        notes: &[("note", "touch off Z anew after every tool, X and Y never".into())],
    };
    let mut text = Vec::new();
    let facts = post::write(&program, &dialect, &machine, &mut text).expect("written");
    assert_eq!(facts.bytes, text.len() as u64);
    assert_eq!(facts.lines, text.iter().filter(|&&b| b == b'\n').count() as u64);
    String::from_utf8(text).expect("ASCII").replace(env!("CARGO_PKG_VERSION"), "VERSION")
}

#[test]
fn programs_are_these_bytes() {
    let cases = [
        ("linuxcnc.ngc", written("linuxcnc", "linuxcnc-mill", "tools", ZZero::StockTop)),
        ("linuxcnc-part-top.ngc", written("linuxcnc", "linuxcnc-mill", "tools", ZZero::PartTop)),
        ("mach3.tap", written("mach3", "linuxcnc-mill", "tools", ZZero::StockTop)),
        ("haas.nc", written("haas", "linuxcnc-mill", "tools", ZZero::StockTop)),
        ("fanuc.nc", written("fanuc", "linuxcnc-mill", "tools", ZZero::StockTop)),
        ("mdx-20.rml", written("rml1-25um", "roland-mdx-20", "tools", ZZero::StockTop)),
        ("srm-20.nc", written("roland-nc", "roland-srm-20", "tools-srm-20", ZZero::StockTop)),
        ("grbl.nc", written("grbl", "grbl-router", "tools", ZZero::StockTop)),
        ("egx-600.rml", written("rml1", "roland-egx-600", "tools", ZZero::StockTop)),
        ("srm-20.rml", written("rml1", "roland-srm-20", "tools-srm-20", ZZero::StockTop)),
    ];
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/post");
    for (name, text) in cases {
        let path = folder.join(name);
        if std::env::var_os("BLESS").is_some() {
            std::fs::write(&path, &text).expect("tests/golden is writable");
        }
        let golden = std::fs::read_to_string(&path).expect("blessed");
        assert_eq!(text, golden, "{name}");
    }
}
