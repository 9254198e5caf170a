use super::judged::Judged;
use super::reading::Language;

/// The fastest motion of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fastest {
    pub feed_mm_min: f64,
    pub line: u32,
}

/// How fast a program feeds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feeds {
    /// Of feed motions that move in X or Y.
    pub lateral: Option<Fastest>,
    /// Of feed motions straight down.
    pub plunge: Option<Fastest>,
}

impl Judged<'_> {
    /// The fastest feed motions between known places, each the first of equals; rapids, and travels in
    /// RML-1, are none. Descents of an RML-1 text whose speeds do not tell plunges apart are left out.
    pub fn feeds(&self) -> Feeds {
        let mut feeds = Feeds::default();
        let mut last = [f64::NAN; 3];
        let gcode = self.reading.summary.language == Language::GCode;
        for (index, motion) in self.reading.motions.iter().enumerate() {
            let (from, to) = (std::mem::replace(&mut last, motion.to_mm), motion.to_mm);
            if !motion.known() || from.iter().any(|mm| mm.is_nan()) {
                continue;
            }
            let lateral = to[0] != from[0] || to[1] != from[1];
            let kind = match (lateral, to[2] < from[2]) {
                (true, _) => Some(&mut feeds.lateral),
                (false, true) if gcode || self.travel.tells_plunges() => Some(&mut feeds.plunge),
                _ => None,
            };
            let feed_mm_min = f64::from(motion.feed_mm_min);
            if let Some(kind) = kind
                && !self.rapid(index)
                && kind.is_none_or(|fastest| feed_mm_min > fastest.feed_mm_min)
            {
                *kind = Some(Fastest { feed_mm_min, line: motion.line });
            }
        }
        feeds
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Judged, Options, Reading};
    use super::*;

    #[test]
    fn the_fastest_feeds_are_found_with_their_lines() {
        let text = "G21 G90 G17\nM3 S9000\nG0 Z5\nG0 X0 Y0\nG1 Z-1 F80\nG1 X5 F400\nG1 Y5 F300\nG1 Z2 F900\nG1 Z-2 F90\nG0 Z5\nM2\n";
        let reading = Reading::of(text.as_bytes(), &Options::default()).expect("a program");
        let feeds = Judged::new(&reading, "ball:1".parse().expect("a cutter"), [0.0; 3]).feeds();
        assert_eq!(feeds.lateral, Some(Fastest { feed_mm_min: 400.0, line: 6 }));
        assert_eq!(feeds.plunge, Some(Fastest { feed_mm_min: 90.0, line: 9 }));
    }
}
