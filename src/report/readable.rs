//! Times and shares for reading.

/// A time: `48 s`, `3 min 10 s`, `2 h 5 min`.
#[must_use]
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match seconds {
        s if s < 0.0995 => format!("{:.0} ms", 1000.0 * s),
        s if s < 9.95 => format!("{s:.1} s"),
        _ if whole < 60 => format!("{whole} s"),
        _ if whole < 3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ if whole < 360_000 => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
        s => format!("{:.0} days", s / 86_400.0),
    }
}

/// A share with two digits or so.
#[must_use]
pub fn percent(share: f64) -> String {
    match 100.0 * share {
        p if p < 0.1 => format!("{p:.2} %"),
        p if p < 9.95 => format!("{p:.1} %"),
        p => format!("{p:.0} %"),
    }
}

/// Number of things: `1 pass`, `2 passes`.
#[must_use]
pub fn counted(count: u64, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_one_would_say_it() {
        for (seconds, text) in [
            (0.03, "30 ms"),
            (4.25, "4.2 s"),
            (48.0, "48 s"),
            (59.7, "1 min 0 s"),
            (190.0, "3 min 10 s"),
            (7500.0, "2 h 5 min"),
            (1e6, "12 days"),
        ] {
            assert_eq!(duration(seconds), text);
        }
        for (share, text) in [
            (0.0004, "0.04 %"),
            (0.008, "0.8 %"),
            (0.12, "12 %"),
            (3.0, "300 %"),
        ] {
            assert_eq!(percent(share), text);
        }
    }
}
