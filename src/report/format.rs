//! Figures in words a reader takes in at a glance.

/// A length in micrometres with as many decimals as matter; in millimetres past 1 mm.
pub fn micrometres(mm: f64) -> String {
    let um = mm * 1000.0;
    let text = match um.abs() {
        size if size >= 1000.0 => format!("{mm:.3} mm"),
        size if size >= 100.0 => format!("{um:.0} µm"),
        size if size >= 10.0 => format!("{um:.1} µm"),
        size if size >= 1.0 || size == 0.0 => format!("{um:.2} µm"),
        _ => format!("{um:.3} µm"),
    };
    text.replace('-', "\u{2212}")
}

/// A fraction in percent; never 100 or 0 unless it is.
pub fn percent(fraction: f64) -> String {
    let percent = fraction * 100.0;
    let decimals = (1..=6)
        .find(|&digits| (0.5 / 10f64.powi(digits)) < percent.min(100.0 - percent))
        .unwrap_or(6) as usize;
    if percent <= 0.0 || percent >= 100.0 {
        format!("{percent:.0} %")
    } else {
        format!("{percent:.decimals$} %")
    }
}

/// Degrees.
pub fn degrees(degrees: f64) -> String {
    if degrees < 0.1 { format!("{degrees:.4}°") } else { format!("{degrees:.2}°") }
}

/// Hours, minutes and seconds as far as they matter.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round().max(0.0) as u64;
    let (hours, minutes) = (whole / 3600, whole / 60 % 60);
    match whole {
        0..60 => format!("{seconds:.1} s"),
        60..3600 => format!("{minutes} min {} s", whole % 60),
        _ => format!("{hours} h {minutes:02} min"),
    }
}

/// A number with this many decimals and thin spaces between thousands.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let mut grouped = String::new();
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            grouped.push('\u{2009}');
        }
        grouped.push(digit);
    }
    let sign =
        if value < 0.0 && text.chars().any(|digit| ('1'..='9').contains(&digit)) { "\u{2212}" } else { "" };
    format!("{sign}{grouped}{rest}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_read_as_a_person_would_write_them() {
        assert_eq!(micrometres(0.0015), "1.50 µm");
        assert_eq!(micrometres(0.00004), "0.040 µm");
        assert_eq!(micrometres(-0.0123), "\u{2212}12.3 µm");
        assert_eq!(micrometres(1.25), "1.250 mm");
        assert_eq!(percent(0.9999), "99.99 %");
        assert_eq!(percent(0.984), "98.4 %");
        assert_eq!(percent(1.0), "100 %");
        assert_eq!(duration(3661.0), "1 h 01 min");
        assert_eq!(duration(59.97), "1 min 0 s");
        assert_eq!(fixed(-1234567.5, 1), "\u{2212}1\u{2009}234\u{2009}567.5");
        assert_eq!(fixed(-0.0001, 2), "0.00");
    }
}
