use super::judged::Judged;

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
    /// The fastest feed motions, each the first of equals; rapids, and travel in RML-1, are none.
    pub fn feeds(&self) -> Feeds {
        let mut feeds = Feeds::default();
        let mut last = [f64::NAN; 3];
        for motion in &self.reading.motions {
            let to = motion.to_mm;
            // The first motion from an unknown place counts as lateral.
            let lateral = to[0] != last[0] || to[1] != last[1];
            let kind = match (lateral, to[2] < last[2]) {
                (true, _) => Some(&mut feeds.lateral),
                (false, true) => Some(&mut feeds.plunge),
                (false, false) => None,
            };
            let feed_mm_min = f64::from(motion.feed_mm_min);
            if let Some(kind) = kind
                && !self.rapid(motion)
                && kind.is_none_or(|fastest| feed_mm_min > fastest.feed_mm_min)
            {
                *kind = Some(Fastest { feed_mm_min, line: motion.line });
            }
            last = to;
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
