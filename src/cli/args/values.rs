//! The values that options take: names, and parsers that say what is allowed.

use super::Template;
use crate::develop::{Display, ToneCurve};
use crate::film::Crop;
use crate::job::claims::is_worker_name;
use crate::job::freeze::ChunkLength;
use crate::job::manifest::LEASES;
use crate::math::banding::Axis;
use crate::math::named::Named;
use crate::scene::Sequences;
use crate::scene::settings::{Aiming, FilterKind, Heuristic, IntegratorKind, Regularize, Sharing};
use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::ops::Range;
use std::time::Duration;

/// Name of all sequences of two reflections of the only lens.
const GHOSTS: &str = "ghosts";
/// Longest name of a worker that is given.
const LONGEST_NAME: usize = 60;

/// Makes choices with names values of options, by the same names.
macro_rules! value_enum {
    ($($type:ty),+) => {
        $(impl ValueEnum for $type {
            fn value_variants<'a>() -> &'a [Self] {
                Self::ALL
            }

            fn to_possible_value(&self) -> Option<PossibleValue> {
                Some(PossibleValue::new(self.as_str()).help(self.help()))
            }
        })+
    };
}
value_enum!(
    Template,
    Aiming,
    IntegratorKind,
    Heuristic,
    Regularize,
    Sharing,
    FilterKind,
    ToneCurve,
    Display
);

pub(super) fn key_value(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => {
            Ok((key.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err("expected KEY=VALUE".to_owned()),
    }
}

pub(super) fn passes(text: &str) -> Result<Range<u32>, String> {
    let parsed = text
        .split_once("..")
        .and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    // the last index is the pilot's
    parsed
        .filter(|r: &Range<u32>| r.start < r.end && r.end < u32::MAX)
        .ok_or_else(|| "expected A..B with 0 <= A < B: the passes A, A+1, ..., B-1".to_owned())
}

pub(super) fn crop(text: &str) -> Result<Crop, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => Ok(Crop { x0, y0, x1, y1 }),
        _ => Err(
            "expected X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1, in pixels from the top left".to_owned(),
        ),
    }
}

pub(super) fn axis(text: &str) -> Result<Axis, String> {
    let point = || {
        let (x, y) = text.split_once(',')?;
        Some(Axis::Distance([finite(x).ok()?, finite(y).ok()?]))
    };
    match text {
        "x" => Ok(Axis::X),
        "y" => Ok(Axis::Y),
        _ => point().ok_or_else(|| "expected x, y, or a pixel X,Y".to_owned()),
    }
}

pub(super) fn finite(text: &str) -> Result<f64, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|v: &f64| v.is_finite())
        .ok_or_else(|| "expected a number".to_owned())
}

/// Stops of exposure, within what powers of two can be.
pub(super) fn stops(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|v| v.abs() <= 1000.0)
        .ok_or_else(|| "expected a number of stops, -1000 to 1000".to_owned())
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|&v| v > 0.0)
        .ok_or_else(|| "expected a number above 0".to_owned())
}

/// A number of passes.
pub(super) fn count(text: &str) -> Result<u32, String> {
    let count = text.parse().ok().filter(|&n| n > 0);
    count.ok_or_else(|| format!("expected a whole number from 1 to {}", u32::MAX))
}

/// A time in seconds, or with a unit.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let number = text.trim_end_matches(['s', 'm', 'h']);
    let unit = match &text[number.len()..] {
        "" | "s" => 1.0,
        "m" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    positive(number)
        .map(|n| n * unit)
        .ok()
        .filter(|s| s.is_finite())
        .ok_or_else(|| "expected a time above 0 such as 10s, 2m or 1h".to_owned())
}

/// Length of chunks: a time, or a whole number of passes.
pub(super) fn chunk(text: &str) -> Result<ChunkLength, String> {
    let length = match text.parse() {
        Ok(passes) => (passes > 0).then_some(ChunkLength::Passes(passes)),
        Err(_) => {
            let time = seconds(text).ok();
            let time = time.and_then(|s| Duration::try_from_secs_f64(s).ok());
            time.map(ChunkLength::Time)
        }
    };
    length.ok_or_else(|| {
        "expected a time such as 90s, 10m or 1h, or a number of passes above 0".to_owned()
    })
}

/// A time within which a worker shows that it lives.
pub(super) fn lease(text: &str) -> Result<Duration, String> {
    let allowed = LEASES[0].as_secs_f64()..=LEASES[1].as_secs_f64();
    let time = seconds(text).ok().filter(|s| allowed.contains(s));
    time.map(Duration::from_secs_f64)
        .ok_or_else(|| "expected a time from 0.2s to 24h such as 60s or 5m".to_owned())
}

/// The name of a worker.
pub(super) fn worker(text: &str) -> Result<String, String> {
    let is_name = text.len() <= LONGEST_NAME && is_worker_name(text);
    is_name.then(|| text.to_owned()).ok_or_else(|| {
        format!("expected 1 to {LONGEST_NAME} letters, digits, \"-\", \"_\" and \".\"")
    })
}

/// Chunks A..B.
pub(super) fn chunks(text: &str) -> Result<Range<u32>, String> {
    let parsed = text
        .split_once("..")
        .and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    parsed
        .filter(|r: &Range<u32>| r.start < r.end)
        .ok_or_else(|| "expected A..B with 0 <= A < B: the chunks A, A+1, ..., B-1".to_owned())
}

/// A host and a port, which are looked for later.
pub(super) fn host_and_port(text: &str) -> Result<String, String> {
    let parts = text.rsplit_once(':');
    let sound = parts.is_some_and(|(host, port)| {
        !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0)
    });
    let wrong = || "expected HOST:PORT such as 127.0.0.1:14158".to_owned();
    sound.then(|| text.to_owned()).ok_or_else(wrong)
}

pub(super) fn pixel(text: &str) -> Result<[u32; 2], String> {
    text.split_once(',')
        .and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]))
        .ok_or_else(|| "expected X,Y: a pixel, from the top left".to_owned())
}

/// The value of `render.epsilon` that says the same.
pub(super) fn epsilon(text: &str) -> Result<String, String> {
    if text == "auto" {
        return Ok(text.to_owned());
    }
    positive(text)
        .map(|v| format!("{v:?}"))
        .map_err(|_| "expected an angle in radians above 0, or auto".to_owned())
}

/// A number of bytes with an optional suffix K, M, G or T (powers of 1024).
pub(super) fn size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(['K', 'M', 'G', 'T']);
    let shift = match &text[digits.len()..] {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => 64,
    };
    let bytes = digits
        .parse::<u64>()
        .ok()
        .and_then(|n| n.checked_mul(1_u64.checked_shl(shift)?));
    bytes
        .filter(|&b| b > 0)
        .ok_or_else(|| "expected a number of bytes such as 500M or 2G".to_owned())
}

/// The value of `render.wavelengths` that says the same.
pub(super) fn wavelengths(text: &str) -> Result<String, String> {
    if ["scene", "uniform", "visible", "even"].contains(&text) {
        return Ok(text.to_owned());
    }
    if let Some((a, b)) = text.split_once("..")
        && let (Ok(a), Ok(b)) = (finite(a), finite(b))
    {
        return Ok(format!("{{ range_nm = [{a:?}, {b:?}] }}"));
    }
    let lines: Result<Vec<f64>, String> = text.split(',').map(finite).collect();
    let wrong = |_| {
        "expected scene, uniform, visible, even, A..B or a list of wavelengths in nm".to_owned()
    };
    lines
        .map(|lines| format!("{{ lines_nm = {lines:?} }}"))
        .map_err(wrong)
}

/// One sequence of surfaces, or the name of several.
pub(super) fn sequence(text: &str) -> Result<String, String> {
    if text != GHOSTS {
        Sequences::check(text)?;
    }
    Ok(text.to_owned())
}

/// The value of the key for sequences that are given one by one; `None` without any.
pub(super) fn sequences(all: &[String]) -> Option<String> {
    match all {
        [] => None,
        [one] if one == GHOSTS => Some(format!("\"{GHOSTS}\"")),
        all => Some(format!("{all:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_crops_are_checked() {
        assert_eq!(passes("3..8"), Ok(3..8));
        for wrong in ["3", "3..3", "8..3", "-1..3", "a..b", "0..4294967295"] {
            assert!(passes(wrong).is_err(), "{wrong}");
        }
        assert_eq!(
            crop("1,2,3,4"),
            Ok(Crop {
                x0: 1,
                y0: 2,
                x1: 3,
                y1: 4
            })
        );
        for wrong in ["1,2,3", "1,2,1,4", "1,2,3,2", "1,2,3,4,5", "a,b,c,d", ""] {
            assert!(crop(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn times_are_seconds_or_have_a_unit() {
        for (text, value) in [("7.5", 7.5), ("90s", 90.0), ("2m", 120.0), ("0.5h", 1800.0)] {
            assert_eq!(seconds(text), Ok(value), "{text}");
        }
        for wrong in ["0", "-1", "m", "2ms", "1d", "nan", "inf", "1e308h", ""] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_have_suffixes() {
        assert_eq!(size("500"), Ok(500));
        assert_eq!(size("2G"), Ok(2 << 30));
        for wrong in ["0", "G", "2GM", "2g", "-1", "99999999999T"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}
