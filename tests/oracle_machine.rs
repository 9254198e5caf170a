//! Splitting and placing against their own definitions.

use proptest::prelude::*;
use screenmill::catalogue::{self, Kind};
use screenmill::machine::{
    Blanks, Bounds, Error, Fixture, Guard, Library, Machine, Quantum, Setup, Stock, Tile, ZNeed, fits_z,
    floor_mm, split, split_to_fit,
};

fn stock(blanks: Blanks) -> Stock {
    Stock { thickness_mm: 20.0, top_allowance_mm: 0.2, margin_mm: 3.0, min_floor_mm: 2.0, blanks }
}

fn machine(name: &str) -> Machine {
    Machine::find(name, None).expect("a machine that comes along")
}

fn fixture(name: &str) -> Fixture {
    Fixture::find(name, None).expect("a fixture that comes along")
}

#[test]
fn all_that_comes_along_is_valid_and_named_as_its_file() {
    for name in catalogue::names(Kind::Machine) {
        let machine = machine(name);
        assert_eq!(machine.name, name);
        for dialect in &machine.dialects {
            assert!(screenmill::post::Dialect::find(dialect, None).is_ok(), "{name}: {dialect}");
        }
    }
    for name in catalogue::names(Kind::Fixture) {
        assert_eq!(fixture(name).name, name);
    }
    for name in catalogue::names(Kind::Dialect) {
        assert_eq!(screenmill::post::Dialect::find(name, None).expect("valid").name, name);
    }
}

#[test]
fn every_tool_runs_on_the_machine_its_library_is_for() {
    let pairs = [
        ("tools", "roland-egx-600"),
        ("tools", "linuxcnc-mill"),
        ("tools", "grbl-router"),
        ("tools-srm-20", "roland-srm-20"),
    ];
    for (library, name) in pairs {
        let machine = machine(name);
        for tool in &Library::find(library, None).expect("comes along").tools {
            let setting = machine.run(tool).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!((setting.rpm - tool.spindle_rpm).abs() <= 0.5 * 22_000.0 / 14.0, "{}", tool.name);
        }
    }
}

#[test]
fn the_paper_s_prototype_is_one_tile_and_the_corner_of_the_screen_several() {
    let stock = stock(Blanks::PerTile);
    let cell = Quantum::Cell { cell_mm: 4.0 };
    let egx = split([200.0, 200.0], cell, 0.6, &stock, &machine("roland-egx-600"), &fixture("vacuum-plate"))
        .expect("fits");
    assert_eq!(egx.len(), 1);
    assert_eq!((egx[0].name.as_str(), egx[0].width_mm, egx[0].height_mm), ("r0c0", 200.0, 200.0));
    let srm = split([400.0, 400.0], cell, 0.6, &stock, &machine("roland-srm-20"), &fixture("vacuum-plate"))
        .expect("fits");
    // 203.2 - 10 - 6 leaves 46 cells of 100: three columns; 152.4 - 16 leaves 34: three rows.
    assert_eq!(srm.len(), 9);
    let widths: Vec<f64> = srm[..3].iter().map(|t| t.width_mm).collect();
    assert_eq!(widths, [132.0, 132.0, 136.0]);
    assert_eq!(srm[4].name, "r1c1");
    assert_eq!((srm[4].x_mm, srm[4].y_mm), (132.0, 132.0));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn tiles_cover_the_part_once_fit_the_machine_and_are_equal(
        columns in 1..260usize, rows in 1..260usize, overrun in 0.0..3.0f64, margin in 0.0..8.0f64, one in any::<bool>()
    ) {
        let machine = machine("roland-srm-20");
        let fixture = fixture("vacuum-plate");
        let blanks = if one { Blanks::One } else { Blanks::PerTile };
        let stock = Stock { margin_mm: margin, ..stock(blanks) };
        let cell = 4.0;
        let size = [columns as f64 * cell, rows as f64 * cell];
        let tiles = split(size, Quantum::Cell { cell_mm: cell }, overrun, &stock, &machine, &fixture).expect("fits");
        let travel = [machine.travel.x_mm, machine.travel.y_mm];
        let (mut area, mut shortest, mut longest) = (0.0, [f64::MAX; 2], [0.0f64; 2]);
        for tile in &tiles {
            area += tile.width_mm * tile.height_mm;
            for (axis, (start, length)) in
                [(tile.x_mm, tile.width_mm), (tile.y_mm, tile.height_mm)].into_iter().enumerate()
            {
                prop_assert_eq!((start / cell).fract(), 0.0);
                prop_assert_eq!((length / cell).fract(), 0.0);
                shortest[axis] = shortest[axis].min(length);
                longest[axis] = longest[axis].max(length);
            }
            let setup = Setup::place(tile.clone(), size, &stock, &machine, &fixture);
            let motions = Bounds {
                low_mm: [-overrun, -overrun, -1.0],
                high_mm: [tile.width_mm + overrun, tile.height_mm + overrun, 5.0],
            };
            prop_assert!(setup.check(&motions, 0.0, &machine).is_ok());
            if !one {
                for (axis, travel) in travel.into_iter().enumerate() {
                    let zero = setup.zero_on_table_mm[axis];
                    prop_assert!(zero + setup.blank.low_mm[axis] >= 5.0 - 1e-9);
                    prop_assert!(zero + setup.blank.high_mm[axis] <= travel - 5.0 + 1e-9);
                }
            }
        }
        prop_assert!((area - size[0] * size[1]).abs() < 1e-6);
        prop_assert!(longest[0] - shortest[0] <= cell && longest[1] - shortest[1] <= cell);
        // No fewer would do: one column less makes some tile too long.
        for (axis, travel) in travel.into_iter().enumerate() {
            let count = tiles.iter().map(|t| [t.column, t.row][axis]).max().unwrap_or(0) + 1;
            if count > 1 {
                let cells = [columns, rows][axis];
                let room = if one { travel - 10.0 - 2.0 * overrun } else {
                    (travel - 2.0 * overrun).min(travel - 10.0 - 2.0 * margin)
                };
                prop_assert!(cells.div_ceil(count - 1) as f64 * cell > room - 1e-6);
            }
        }
    }
}

#[test]
fn a_remainder_that_is_no_whole_sample_goes_to_the_last_tile() {
    let tiles = split(
        [400.0037, 10.0],
        Quantum::Sample { step_mm: 0.01 },
        1.0,
        &stock(Blanks::PerTile),
        &machine("roland-srm-20"),
        &fixture("vacuum-plate"),
    )
    .expect("fits");
    assert_eq!(tiles.len(), 3);
    let end = tiles[2].x_mm + tiles[2].width_mm;
    assert!((end - 400.0037).abs() < 1e-9);
    for tile in &tiles[..2] {
        let samples = tile.width_mm / 0.01;
        assert!((samples - samples.round()).abs() < 1e-6);
    }
}

#[test]
fn what_is_too_deep_in_one_piece_is_cut_in_smaller_ones() {
    let (machine, fixture) = (machine("roland-egx-600"), fixture("vacuum-plate"));
    let stock = stock(Blanks::PerTile);
    // A slope of 0.2 in X: a tile is as deep as a fifth of its width.
    let need = |width_mm: f64| ZNeed { depth_mm: 0.2 * width_mm, top_allowance_mm: 0.2, clearance_mm: 5.0 };
    let cell = Quantum::Cell { cell_mm: 4.0 };
    let tiles = split_to_fit([400.0, 8.0], cell, 0.5, 20.0, &stock, &machine, &fixture, |tile| {
        Ok::<_, Error>(fits_z(&tile.name, need(tile.width_mm), &machine).err())
    })
    .expect("narrower tiles are less deep");
    // Up to 186.5 mm wide: three do, no fewer.
    assert_eq!(tiles.len(), 3);
    assert!(tiles.iter().all(|tile| fits_z(&tile.name, need(tile.width_mm), &machine).is_ok()));
    // A blank that is too wide as it lies, along Y: only Y is divided further, by one.
    let (size, room_mm) = ([400.0, 400.0], 103.0);
    let blank = |tile: &Tile| Error::Blank {
        tile: tile.name.clone(),
        length_mm: tile.height_mm + 2.0,
        axis: "Y",
        room_mm,
        machine: machine.name.clone(),
        fixture: fixture.name.clone(),
    };
    let first = split(size, cell, 0.5, &stock, &machine, &fixture).expect("fits");
    let tiles = split_to_fit(size, cell, 0.5, 20.0, &stock, &machine, &fixture, |tile| {
        Ok::<_, Error>((tile.height_mm + 2.0 > room_mm).then(|| blank(tile)))
    })
    .expect("shorter tiles fit");
    let columns = |tiles: &[Tile]| tiles.iter().filter(|tile| tile.row == 0).count();
    assert!(columns(&first) == columns(&tiles) && tiles.len() == 4 * columns(&tiles), "{}", tiles.len());
    let deep = ZNeed { depth_mm: 51.9, top_allowance_mm: 0.2, clearance_mm: 5.0 };
    let refusal = split_to_fit([400.0, 8.0], cell, 0.5, 20.0, &stock, &machine, &fixture, |tile| {
        Ok::<_, Error>(fits_z(&tile.name, deep, &machine).err())
    })
    .expect_err("no tile is less deep");
    assert_eq!(
        refusal.to_string(),
        "tile r0c0 needs 57.1 mm of Z travel, roland-egx-600 has 42.5 mm; hint: level = \"plane\" or smaller tiles"
    );
}

#[test]
fn the_floor_is_what_the_blank_has_left() {
    let need = ZNeed { depth_mm: 12.0, top_allowance_mm: 0.2, clearance_mm: 5.0 };
    let left = floor_mm("r0c0", need, &stock(Blanks::PerTile)).expect("enough");
    assert!((left - 7.8).abs() < 1e-12);
    assert!(floor_mm("r0c0", ZNeed { depth_mm: 17.9, ..need }, &stock(Blanks::PerTile)).is_err());
}

#[test]
fn clamps_stand_where_the_blank_s_edges_are() {
    let (machine, fixture) = (machine("linuxcnc-mill"), fixture("clamps"));
    let cell = Quantum::Cell { cell_mm: 4.0 };
    let place = |margin_mm: f64| {
        let stock = Stock { margin_mm, ..stock(Blanks::PerTile) };
        let tiles = split([40.0, 40.0], cell, 1.0, &stock, &machine, &fixture).expect("fits");
        Setup::place(tiles[0].clone(), [40.0, 40.0], &stock, &machine, &fixture)
    };
    // Clamps reach 6 mm over the margin, the cutter 1 + 0.5 mm out: 7.5 mm touch, 8 mm do not.
    assert!(place(8.0).check_reach(1.5, 1.5, 3.0, 8.0).is_ok());
    let refusal = place(3.0).check_reach(1.5, 1.5, 3.0, 3.0).expect_err("in the clamp");
    assert_eq!(
        refusal.to_string(),
        "\"left\" stands in the way on tile r0c0: 3.000 mm inside it, and the cutters go 1.500 mm past its edges; hint: margin_mm = 7.5 (it is 3), or another fixture"
    );
    assert!(place(7.5).check_reach(1.5, 1.5, 3.0, 7.5).is_ok(), "the hint does what it says");
    // A plane over the clamps, and the job's own where that is higher.
    assert_eq!((place(8.0).clearance_mm(5.0), place(8.0).clearance_mm(12.0)), (10.0, 12.0));
    // Round the tile the cutter meets no clamp, across its middle line it does.
    let columns =
        Library::find("tools", None).expect("comes along").tool("ball-1").expect("in it").columns(16.0);
    // The shank is wider than the cutter, and above 4 mm of neck lower than the clamps.
    let setup = place(10.0);
    let guard = Guard::new(&setup.obstacles, columns);
    let around =
        [[-1.0, -1.0, -3.0], [41.0, -1.0, -3.0], [41.0, 41.0, -3.0], [-1.0, 41.0, -3.0], [-1.0, -1.0, -3.0]];
    assert_eq!(guard.first_met(5, |k| around[k]), None);
    let met = guard.first_met(2, |k| [[20.0, 20.0, 6.0], [-5.0, 20.0, 6.0]][k]).expect("into the left clamp");
    assert_eq!((met.what, met.obstacle.as_str()), ("cutter", "left"));
    // 20 mm deep the holder, 18 mm above the tip, is in it long before the cutter is.
    let met = guard.first_met(2, |k| [[20.0, 20.0, -12.0], [0.0, 20.0, -12.0]][k]).expect("the holder");
    assert_eq!(met.what, "holder");
    let left = &place(8.0).obstacles[0].bounds;
    assert_eq!((left.low_mm[0], left.high_mm[0]), (-48.0, -2.0));
    assert_eq!((left.low_mm[1], left.high_mm[1]), (10.0, 30.0));
}

#[test]
fn clamps_stand_along_their_side_as_the_file_says() {
    let (machine, fixture) = (machine("linuxcnc-mill"), fixture("corner-clamps"));
    let stock = Stock { margin_mm: 8.0, ..stock(Blanks::PerTile) };
    let tiles =
        split([40.0, 40.0], Quantum::Cell { cell_mm: 4.0 }, 1.0, &stock, &machine, &fixture).expect("fits");
    let setup = Setup::place(tiles[0].clone(), [40.0, 40.0], &stock, &machine, &fixture);
    // The blank runs from -8 to 48: the first clamp begins at its front end, the second ends at its back.
    let y: Vec<[f64; 2]> =
        setup.obstacles.iter().map(|o| [o.bounds.low_mm[1], o.bounds.high_mm[1]]).collect();
    assert_eq!(y, [[-8.0, 4.0], [36.0, 48.0], [-8.0, 4.0], [36.0, 48.0]]);
}

#[test]
fn a_fixture_s_largest_blank_limits_the_tiles() {
    let (machine, vise) = (machine("linuxcnc-mill"), fixture("vise"));
    let stock = stock(Blanks::PerTile);
    let tiles =
        split([200.0, 200.0], Quantum::Cell { cell_mm: 4.0 }, 1.0, &stock, &machine, &vise).expect("fits");
    // 150 - 6 hold 36 cells of 50, 100 - 6 hold 23.
    assert_eq!(tiles.iter().map(|t| t.column).max(), Some(1));
    assert_eq!(tiles.iter().map(|t| t.row).max(), Some(2));
}
