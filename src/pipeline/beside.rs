//! What a job cuts beside a tile's surface: holes, marks, the slot around it, and the run in air before all that.

use super::plan::{self, Program, TileSetup};
use super::shop::Shop;
use crate::job::{Face, Kind, Operation, Place};
use crate::machine::{Guard, Tool};
use crate::toolpath::beside::{CutOut, Holes, Mark, Room, Tab, cut_out, holes, mark, outline};
use crate::toolpath::{Error, Site, Toolpath};

/// Height of a mark's letters where the job names none.
const LETTERS_MM: f64 = 2.0;

/// One such operation of a tile.
pub struct Work<'a> {
    pub operation: &'a Operation,
    pub tool: &'a Tool,
    pub tile: &'a TileSetup,
    pub shop: &'a Shop,
    pub guard: &'a Guard,
}

impl Work<'_> {
    /// Plans the operation; `site` is that of the tile's top, `others` are the programs that an outline goes around.
    pub fn path(&self, site: &Site, others: &[Program]) -> Result<Toolpath, Error> {
        let operation = self.operation;
        let site = match operation.face {
            Face::Top => *site,
            // The underside is a plane, and the program's zero lies on it.
            Face::Underside => Site { top_allowance_mm: 0.0, z_zero_mm: 0.0, ..*site },
        };
        let most_mm = self.shop.stock.thickness_mm + self.shop.fixture.sacrificial_mm;
        let depth_mm = operation.depth_mm.unwrap_or_default();
        match operation.kind {
            Kind::Drill => {
                let params = Holes {
                    shape: self.tool.shape,
                    at_mm: self.places(&site),
                    diameter_mm: operation.diameter_mm,
                    depth_mm,
                    stepdown_mm: plan::stepdown_mm(operation, self.tool).unwrap_or_else(|| {
                        let radius_mm = self.tool.shape.radius_mm();
                        self.tool.max_depth_mm.map_or(radius_mm, |most_mm| most_mm.min(radius_mm))
                    }),
                    most_mm,
                    slot_mm: self.slot_mm(),
                    faces_up: operation.face == Face::Top,
                };
                holes(&site, &params)
            }
            Kind::Mark => {
                let rooms = operation.places.iter().map(|place| match place {
                    Place::Back => Room::Back,
                    Place::Centre => Room::Tile,
                    _ => Room::Front,
                });
                let own = match operation.face {
                    Face::Top => Room::Front,
                    Face::Underside => Room::Tile,
                };
                let rooms: Vec<Room> = rooms.collect();
                let params = Mark {
                    shape: self.tool.shape,
                    text: &self.tile.setup.tile.name,
                    rooms: if rooms.is_empty() { vec![own] } else { rooms },
                    height_mm: operation.height_mm.unwrap_or(LETTERS_MM),
                    depth_mm,
                    most_mm,
                };
                mark(&site, &params)
            }
            Kind::CutOut => cut_out(&site, &cut_out_of(operation, self.tool, self.shop)),
            _ => outline(&site, &self.rectangles(&site, others), self.above_mm(&site, others)),
        }
    }

    /// Width of the slots around the tile.
    fn slot_mm(&self) -> f64 {
        let slots = self.shop.tools.iter().zip(&self.shop.kinds).filter(|(_, kind)| **kind == Kind::CutOut);
        slots.map(|(tool, _)| 2.0 * tool.shape.radius_mm()).fold(0.0, f64::max)
    }

    /// Middles of the holes in the frame of the face that is up.
    fn places(&self, site: &Site) -> Vec<[f64; 2]> {
        let lattice = site.surface.lattice();
        let [width, height] = [lattice.width_mm, lattice.height_mm];
        let out = 0.5 * site.margin_mm;
        let (left, right, front, back) = (-out, width + out, -out, height + out);
        let (x, y) = (0.5 * width, 0.5 * height);
        let named = self.operation.places.iter().map(|place| match place {
            Place::Left => [left, y],
            Place::Right => [right, y],
            Place::Front => [x, front],
            Place::Back => [x, back],
            Place::FrontLeft => [left, front],
            Place::FrontRight => [right, front],
            Place::BackLeft => [left, back],
            Place::BackRight => [right, back],
            Place::Centre => [x, y],
        });
        let all = named.chain(self.operation.holes_mm.iter().copied());
        match self.operation.face {
            Face::Top => all.collect(),
            // As seen from behind, turned over left to right.
            Face::Underside => all.map(|[x, y]| [width - x, y]).collect(),
        }
    }

    /// The tile, and the box of all that is cut on its top.
    fn rectangles(&self, site: &Site, others: &[Program]) -> Vec<[[f64; 2]; 2]> {
        let lattice = site.surface.lattice();
        let tile = [[0.0; 2], [lattice.width_mm, lattice.height_mm]];
        let [mut low, mut high] = tile;
        for extent in others.iter().filter(|other| other.face == Face::Top).map(|other| &other.extent) {
            low = [0, 1].map(|axis| extent.low_mm[axis].min(low[axis]));
            high = [0, 1].map(|axis| extent.high_mm[axis].max(high[axis]));
        }
        vec![tile, [low, high]]
    }

    /// As low as the job asks, or on the clearance plane where a clamp stands in the way of that.
    fn above_mm(&self, site: &Site, others: &[Program]) -> f64 {
        let above_mm = self.operation.above_or_default_mm().min(site.clearance_mm);
        let runs = self.rectangles(site, others);
        let meets = runs.iter().any(|[low, high]| {
            let corners = [*low, [high[0], low[1]], *high, [low[0], high[1]], *low];
            let place = |[x, y]: [f64; 2]| [x, y, above_mm];
            corners.windows(2).any(|pair| self.guard.meets(place(pair[0]), place(pair[1]), plan::SPARE_MM))
        });
        if meets { site.clearance_mm } else { above_mm }
    }
}

/// What a cut-out asks for.
pub fn cut_out_of(operation: &Operation, tool: &Tool, shop: &Shop) -> CutOut {
    let count = operation.tabs.unwrap_or(1);
    CutOut {
        shape: tool.shape,
        stepdown_mm: plan::stepdown_mm(operation, tool).unwrap_or_default(),
        thickness_mm: shop.stock.thickness_mm,
        through_mm: operation.through_mm.unwrap_or(0.0),
        sacrificial_mm: shop.fixture.sacrificial_mm,
        tab: (count > 0).then(|| Tab {
            count,
            width_mm: operation.tab_width_mm.unwrap_or(3.0),
            height_mm: operation.tab_height_mm.unwrap_or(1.0),
        }),
    }
}
