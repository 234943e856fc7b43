//! Merging parts: their sums, added exactly.

use super::{Part, PartError, PartHeader, PassRange};

/// Adds up parts of disjoint passes of the same scene, settings, sensor and crop. The order does
/// not matter. What is done of passes that are not whole is left out.
///
/// # Errors
/// Parts that differ, overlap, or whose sums overflow.
pub fn merge(parts: impl IntoIterator<Item = Part>) -> Result<Part, PartError> {
    merge_each(parts.into_iter().map(Ok))
}

/// Parts added up as [`merge`] does, each as it comes: two are in memory at a time.
///
/// # Errors
/// As [`merge`], and the first error of `parts`.
pub fn merge_each<E: From<PartError>>(
    parts: impl IntoIterator<Item = Result<Part, E>>,
) -> Result<Part, E> {
    let mut parts = parts.into_iter();
    let mut total = parts.next().ok_or(PartError::Empty)??;
    (total.header.unfinished, total.unfinished) = (None, None);
    for part in parts {
        let part = part?;
        check_same(&total.header, &part.header)?;
        for (sum, more) in total.sums.iter_mut().zip(&part.sums) {
            *sum = sum.checked_add(*more).ok_or(PartError::Overflow)?;
        }
        total.header.passes = join(&total.header.passes, &part.header.passes)?;
    }
    Ok(total)
}

/// Whether a part is the one that is expected, its passes and the program's version included.
///
/// # Errors
/// The first thing that differs, of both.
pub fn check_identical(expected: &PartHeader, found: &PartHeader) -> Result<(), PartError> {
    let differ = |what, first: String, second: String| PartError::Mismatch {
        what,
        first,
        second,
    };
    if expected.version != found.version {
        let [first, second] = [expected, found].map(|h| h.version.clone());
        return Err(differ("version of the program", first, second));
    }
    check_same(expected, found)?;
    let passes = |h: &PartHeader| {
        let range = |p: &PassRange| format!("{}..{} of seed {}", p.start, p.end, p.seed);
        h.passes.iter().map(range).collect::<Vec<_>>().join(", ")
    };
    if expected.passes != found.passes || found.unfinished.is_some() {
        let [first, second] = [expected, found].map(passes);
        return Err(differ("passes", first, second));
    }
    if expected.image != found.image || expected.companions != found.companions {
        let [first, second] = [expected, found].map(|h| format!("{:?}", h.image));
        return Err(differ("attributes", first, second));
    }
    Ok(())
}

fn check_same(a: &PartHeader, b: &PartHeader) -> Result<(), PartError> {
    let differ = |what, first: String, second: String| {
        if first == second {
            Ok(())
        } else {
            Err(PartError::Mismatch {
                what,
                first,
                second,
            })
        }
    };
    differ(
        "scene (hash)",
        format!("{:016x}", a.scene_hash),
        format!("{:016x}", b.scene_hash),
    )?;
    differ(
        "settings (hash)",
        format!("{:016x}", a.settings_hash),
        format!("{:016x}", b.settings_hash),
    )?;
    differ("sensor", a.sensor.clone(), b.sensor.clone())?;
    let names = |header: &PartHeader| {
        let films = header.companions.iter();
        let films = films.map(|f| format!("{} {} x {}", f.sensor, f.width, f.height));
        films.collect::<Vec<_>>().join(", ")
    };
    differ("detectors beside it", names(a), names(b))?;
    let hashes = |header: &PartHeader| {
        let films = header.companions.iter();
        let films = films.map(|f| format!("{:016x} {}", f.settings_hash, f.pilot));
        films.collect::<Vec<_>>().join(", ")
    };
    differ("settings of detectors beside it", hashes(a), hashes(b))?;
    differ(
        "size",
        format!("{} x {}", a.width, a.height),
        format!("{} x {}", b.width, b.height),
    )?;
    differ("crop", format!("{:?}", a.crop), format!("{:?}", b.crop))?;
    differ("channels", a.channels.to_string(), b.channels.to_string())?;
    differ("blocks", a.blocks.to_string(), b.blocks.to_string())?;
    let spectral = |header: &PartHeader| match &header.spectral {
        None => "none".to_owned(),
        Some(film) => {
            let [low, high] = &film.range_nm;
            let (bins, lines) = (film.bins, film.lines_nm.join(", "));
            format!("{bins} from {low} to {high} nm, lines {lines}")
        }
    };
    differ("spectral channels", spectral(a), spectral(b))?;
    differ("exponent", a.exponent.to_string(), b.exponent.to_string())?;
    differ(
        "passes of the pilot, by the samples per pixel of their renders",
        a.pilot.to_string(),
        b.pilot.to_string(),
    )
}

/// The union of two lists of ranges: sorted, touching ranges joined.
fn join(a: &[PassRange], b: &[PassRange]) -> Result<Vec<PassRange>, PartError> {
    let mut all: Vec<PassRange> = a.iter().chain(b).copied().collect();
    all.sort_unstable();
    let mut joined: Vec<PassRange> = Vec::new();
    for range in all {
        match joined.last_mut().filter(|last| last.seed == range.seed) {
            Some(last) if range.start < last.end => {
                return Err(PartError::Overlap(PassRange {
                    end: range.end.min(last.end),
                    ..range
                }));
            }
            Some(last) if range.start == last.end => last.end = range.end,
            _ => joined.push(range),
        }
    }
    Ok(joined)
}
