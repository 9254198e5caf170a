//! Which motions of a text are its travels. RML-1 has no rapid word for three axes: a program that
//! travels with `Z` says so by its speeds alone.

use super::reading::Motion;

/// What tells a program's travels from its cuts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Travel {
    /// Feed motions in X or Y at this speed or faster are travels, and so are descents.
    lateral_mm_min: Option<f32>,
    /// Straight rises at just this speed, or as fast as travels in X or Y, are travels.
    rise_mm_min: Option<f32>,
    /// Straight descents at this speed or faster are travels.
    fall_mm_min: Option<f32>,
    /// Level motions above this height are travels, whatever their speed.
    level_above_mm: Option<f64>,
}

impl Travel {
    /// Whether the motion goes at travel speed. `from_mm` is where it begins; an axis that is not known is NaN.
    pub fn fast(&self, from_mm: [f64; 3], motion: &Motion) -> bool {
        let (to, feed) = (motion.to_mm, motion.feed_mm_min);
        let reaches = |speed: Option<f32>| speed.is_some_and(|speed| feed >= speed);
        if motion.rapid() {
            return true;
        }
        if !from_mm[0].is_finite() || !from_mm[1].is_finite() {
            return self.told();
        }
        match (from_mm[0] != to[0] || from_mm[1] != to[1], to[2] < from_mm[2]) {
            (true, _) => reaches(self.lateral_mm_min),
            (false, true) => reaches(self.lateral_mm_min) || reaches(self.fall_mm_min),
            (false, false) => reaches(self.lateral_mm_min) || self.rise_mm_min == Some(feed),
        }
    }

    /// Whether the motion is a travel: a fast one, or one on a plane that nothing is cut on.
    pub fn holds(&self, from_mm: [f64; 3], motion: &Motion) -> bool {
        let level = from_mm[2] == motion.to_mm[2];
        let above = self.level_above_mm.is_some_and(|plane| motion.to_mm[2] > plane);
        (level && above) || self.fast(from_mm, motion)
    }

    /// Whether descents at travel speed are told from slower ones.
    pub fn tells_plunges(&self) -> bool {
        self.fall_mm_min.is_some()
    }

    /// Whether anything tells travels apart.
    fn told(&self) -> bool {
        self.lateral_mm_min.is_some() || self.fall_mm_min.is_some()
    }
}

/// The highest upper end and the highest lower end of some motions, in mm.
#[derive(Clone, Copy, Debug)]
struct Highest {
    upper_mm: f64,
    lower_mm: f64,
}

impl Highest {
    fn with(self, other: Highest) -> Highest {
        Highest { upper_mm: self.upper_mm.max(other.upper_mm), lower_mm: self.lower_mm.max(other.lower_mm) }
    }
}

/// Finds the travels of an RML-1 program, motion by motion.
///
/// The fastest speed in X or Y is the travel speed if slower motions lie below: if one at that speed
/// runs at or above all slower ones, or if the program's very first motion, which comes from anywhere, has it.
/// Up and down the axis may be slower than in X and Y, and than cuts, so it has a speed of its own: that of the
/// highest rise, if a descent is slower. Where cuts are as fast as travels, the plane of the travels tells: it is
/// reached by such a rise, and no other motion gets as high.
#[derive(Clone, Copy, Debug)]
pub struct TravelSearch {
    last: [f64; 3],
    /// Speed of the first motion to a known place.
    first_mm_min: Option<f32>,
    /// Whether the text has rapids of its own (PU, M).
    rapids: bool,
    /// The fastest speed in X or Y and how high its motions are.
    fastest: Option<(f32, Highest)>,
    /// How high slower motions in X or Y are.
    slower: Option<Highest>,
    /// Where the highest straight rise ends and its speed; the faster of equals.
    rise: Option<(f64, f32)>,
    /// The slowest straight descent.
    fall_mm_min: f32,
    /// Whether the cutter has come to this level by a rise at that speed.
    risen: bool,
    /// The highest end of motions in X or Y on levels after such rises, and of all others.
    risen_top_mm: f64,
    cut_top_mm: f64,
}

impl Default for TravelSearch {
    fn default() -> TravelSearch {
        TravelSearch {
            last: [f64::NAN; 3],
            first_mm_min: None,
            rapids: false,
            fastest: None,
            slower: None,
            rise: None,
            fall_mm_min: f32::INFINITY,
            risen: false,
            risen_top_mm: f64::NEG_INFINITY,
            cut_top_mm: f64::NEG_INFINITY,
        }
    }
}

impl TravelSearch {
    /// Takes the next motion in.
    pub fn add(&mut self, motion: &Motion) {
        let (to, feed) = (motion.to_mm, motion.feed_mm_min);
        let from = std::mem::replace(&mut self.last, to);
        // A way to the machine's home, or up before the first place, tells nothing.
        if !motion.known() {
            return;
        }
        self.rapids |= motion.rapid();
        self.first_mm_min.get_or_insert(feed);
        if from.iter().any(|mm| mm.is_nan()) {
            return;
        }
        if from[0] != to[0] || from[1] != to[1] {
            let ends = Highest { upper_mm: from[2].max(to[2]), lower_mm: from[2].min(to[2]) };
            self.lateral(feed, ends);
            self.risen &= from[2] == to[2];
            let top_mm = if self.risen { &mut self.risen_top_mm } else { &mut self.cut_top_mm };
            *top_mm = top_mm.max(ends.upper_mm);
        } else if to[2] > from[2] {
            let before = self.rise;
            if before.is_none_or(|(end, speed)| to[2] > end || (to[2] == end && feed > speed)) {
                self.rise = Some((to[2], feed));
            }
            if before.is_some_and(|(_, speed)| Some(speed) != self.rise.map(|rise| rise.1)) {
                // What followed rises at the speed of cuts was a cut.
                self.cut_top_mm = self.cut_top_mm.max(self.risen_top_mm);
                self.risen_top_mm = f64::NEG_INFINITY;
            }
            self.risen = self.rise.is_some_and(|(_, speed)| speed == feed);
        } else if to[2] < from[2] {
            self.fall_mm_min = self.fall_mm_min.min(feed);
            self.risen = false;
        }
    }

    fn lateral(&mut self, feed: f32, ends: Highest) {
        let (mut slower, mut fastest) = (None, self.fastest);
        match &mut fastest {
            Some((most, _)) if feed < *most => slower = Some(ends),
            Some((most, highest)) if feed == *most => *highest = highest.with(ends),
            before => slower = before.replace((feed, ends)).map(|(_, highest)| highest),
        }
        self.fastest = fastest;
        if let Some(slower) = slower {
            self.slower = Some(self.slower.map_or(slower, |highest| highest.with(slower)));
        }
    }

    /// What was found; nothing is told apart in a text that has rapids of its own.
    pub fn found(&self) -> Travel {
        if self.rapids {
            return Travel::default();
        }
        let lateral_mm_min = self.fastest.zip(self.slower).and_then(|((most, its), slower)| {
            let above = its.lower_mm >= slower.upper_mm && its.lower_mm > slower.lower_mm;
            (above || self.first_mm_min.is_some_and(|first| first >= most)).then_some(most)
        });
        let rise_mm_min = self.rise.map(|rise| rise.1);
        let fall_mm_min = rise_mm_min.filter(|rise| self.fall_mm_min < *rise);
        let told = lateral_mm_min.is_some() || fall_mm_min.is_some();
        Travel {
            lateral_mm_min,
            rise_mm_min: rise_mm_min.filter(|_| told),
            fall_mm_min,
            level_above_mm: fall_mm_min
                .map(|_| self.cut_top_mm)
                .filter(|top| lateral_mm_min.is_none() && top.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Judged, Options, Reading};

    /// mm of cut and of travel in a text of RML-1.
    fn lengths(text: &str) -> (f64, f64) {
        let extent = read(text).extent();
        (extent.cutting_mm, extent.rapid_mm)
    }

    fn read(text: &str) -> Reading {
        Reading::of(text.as_bytes(), &Options::default()).expect("a program")
    }

    fn near(found: (f64, f64), cutting: f64, rapid: f64) {
        assert!((found.0 - cutting).abs() < 1e-9 && (found.1 - rapid).abs() < 1e-9, "{found:?}");
    }

    /// Two cuts of 10 mm, 1 mm deep: the axis of Z does 15 mm/s, travels in X and Y `travel`, plunges
    /// `plunge` and cuts `cut`.
    fn two_cuts(travel: u32, plunge: u32, cut: u32) -> String {
        let pass = |x: u32| {
            format!(
                "V15.0\nZ{x},0,10\nV{plunge}.0\nZ{x},0,-100\nV{cut}.0\nZ{x},1000,-100\nV15.0\nZ{x},1000,200\n"
            )
        };
        let link = format!("V{travel}.0\nZ500,0,200\n");
        format!("^DF\n^PA\nV15.0\n!MC1\n!ZM200\nZ0,0,200\n{}{link}{}!MC0\nH\n", pass(0), pass(500))
    }

    #[test]
    fn z_slower_than_the_cuts_does_not_hide_the_travels() {
        // Twice 1.1 mm of plunge and 10 mm of cut; twice 1.9 down and 3 up, and the way between.
        let link = 5f64.hypot(10.0);
        near(lengths(&two_cuts(30, 4, 16)), 22.2, 9.8 + link);
        near(lengths(&two_cuts(30, 4, 5)), 22.2, 9.8 + link);
    }

    #[test]
    fn cuts_as_fast_as_travels_are_told_by_their_plane() {
        near(lengths(&two_cuts(30, 4, 30)), 22.2, 9.8 + 5f64.hypot(10.0));
        // And metal bears them: they are no rapids through it.
        let reading = read(&two_cuts(30, 4, 30));
        let judged = Judged::new(&reading, "flat:1".parse().expect("a cutter"), [0.0; 3]);
        let feeds = judged.feeds();
        assert_eq!(feeds.lateral.map(|fastest| fastest.feed_mm_min), Some(1800.0));
        assert_eq!(feeds.plunge.map(|fastest| fastest.feed_mm_min), Some(240.0));
    }

    #[test]
    fn plunges_as_fast_as_rises_are_cuts() {
        near(lengths(&two_cuts(30, 15, 16)), 22.2 + 3.8, 6.0 + 5f64.hypot(10.0));
    }

    /// Links of a roughing level: up and across at the feed of the cuts, which Z does not do on its own.
    #[test]
    fn rises_in_a_cut_are_cuts() {
        let text = |cut: u32| {
            format!(
                "^DF\n^PA\nV15.0\n!MC1\n!ZM200\nZ0,0,200\nZ0,0,10\nV4.0\nZ0,0,-100\nV{cut}.0\nZ1000,0,-100\nZ1000,0,0\n\
                Z1000,200,0\nV4.0\nZ1000,200,-100\nV{cut}.0\nZ0,200,-100\nV15.0\nZ0,200,200\nV30.0\nZ0,400,200\n\
                V15.0\nZ0,400,10\nV4.0\nZ0,400,-100\nV{cut}.0\nZ100,400,-100\nV15.0\nZ100,400,200\n!MC0\nH\n"
            )
        };
        for cut in [5, 16, 30] {
            near(lengths(&text(cut)), 1.1 + 10.0 + 4.0 + 10.0 + 1.1 + 1.0, 1.9 + 3.0 + 2.0 + 1.9 + 3.0);
        }
    }

    #[test]
    fn one_pass_without_a_link_has_no_travel_in_x_or_y() {
        let text = "^DF\n^PA\nV15.0\n!MC1\n!ZM200\nZ0,0,200\nZ0,0,10\nV4.0\nZ0,0,-100\nV16.0\nZ1000,0,-90\n\
            Z1000,10,-90\nZ0,10,-100\nV15.0\nZ0,10,200\n!MC0\nH\n";
        near(lengths(text), 1.1 + 2.0 * 10f64.hypot(0.1) + 0.1, 4.9);
    }

    #[test]
    fn a_ramp_slower_than_its_level_is_no_sign_of_travel() {
        let text = "^DF\n^PA\nV15.0\n!MC1\n!ZM200\nZ0,0,200\nZ0,0,10\nV4.0\nZ1000,0,-100\nV16.0\nZ0,0,-100\n\
            Z0,500,-100\nV15.0\nZ0,500,200\n!MC0\nH\n";
        // No descent is slower than the rises: only speeds in X and Y differ, and the faster ones lie below.
        near(lengths(text), 10f64.hypot(1.1) + 15.0 + 4.9, 0.0);
    }

    #[test]
    fn a_text_of_one_speed_has_cuts_only() {
        near(lengths("^DF\n^PA\nV5.0\nZ0,0,100\nZ0,0,-10\nZ100,0,-10\nZ100,0,100\nH\n"), 3.2, 0.0);
    }

    #[test]
    fn a_travel_through_the_blank_is_found_among_others() {
        let text = two_cuts(30, 4, 16);
        let worst = |text: &str| {
            let reading = read(text);
            let judged = Judged::new(&reading, "flat:1".parse().expect("a cutter"), [0.0; 3]);
            let blank = super::super::Blank { low_mm: [-5.0; 2], high_mm: [20.0; 2], top_mm: 0.0 };
            judged.lateral_rapid(&blank).map(|rapid| (rapid.line, (1e3 * rapid.below_mm).round()))
        };
        assert_eq!(worst(&text), None);
        let through = text.replace("!MC0", "V15.0\nZ500,1000,-50\nV30.0\nZ0,0,-50\n!MC0");
        assert_eq!(worst(&through), Some((28, 500.0)));
    }

    #[test]
    fn rapids_of_the_language_itself_leave_the_rest_to_be_cuts() {
        let text = "^DF\n^PA\n@-100,200\nV5\nF9\n!ZM200\nM0,0\nZ0,0,-100\nZ1000,0,-100\nM0,500\n!MC0\nH\n";
        near(lengths(text), 13.0, 3.0 + 10f64.hypot(5.0));
    }
}
