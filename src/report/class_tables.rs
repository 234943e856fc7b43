//! Two tables of path classes and strategies, side by side.
//!
//! Light that a method misses shows here and not in its noise: a class that one table holds and the
//! other has never hit, or means of one class that differ although both were hit often.

use super::readable::percent;
use super::{ReportError, json};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

/// Share of the light below which a class is not printed.
const TOLD_SHARE: f64 = 1e-3;

/// The part of `--stats` that is compared.
#[derive(Deserialize)]
struct Stats {
    sensors: Vec<Sensor>,
}

#[derive(Deserialize)]
struct Sensor {
    name: String,
    classes: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    class: String,
    s: u32,
    t: u32,
    #[serde(flatten)]
    row: Row,
}

/// Contributions of one strategy to one class, or of all to it.
#[derive(Clone, Copy, Default, Deserialize)]
struct Row {
    hits: u64,
    /// Unweighted mean of Y over pixels and passes; of all strategies it has no meaning.
    raw_mean: f64,
    /// Weighted mean of Y.
    weighted_mean: f64,
}

/// Class, then strategies (s, t): of each table its row, if it has one.
type Strategies = BTreeMap<(u32, u32), [Option<Row>; 2]>;

/// One class in both tables.
struct Class {
    name: String,
    strategies: Strategies,
}

impl Class {
    fn hits(&self, table: usize) -> u64 {
        self.rows(table).map(|r| r.hits).sum()
    }

    fn mean(&self, table: usize) -> f64 {
        // not a sum: that of nothing is -0
        self.rows(table).fold(0.0, |sum, r| sum + r.weighted_mean)
    }

    fn rows(&self, table: usize) -> impl Iterator<Item = &Row> {
        self.strategies
            .values()
            .filter_map(move |rows| rows[table].as_ref())
    }
}

/// Whether a path is compared as a table and not as an image.
#[must_use]
pub fn is_table(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("json"))
}

/// The sensors that both tables have, as text or JSON.
///
/// # Errors
/// Where a file cannot be read or is no statistics of a render, or no sensor is in both.
pub fn compare(first: &Path, second: &Path, as_json: bool) -> Result<String, ReportError> {
    let read = |path| json::read::<Stats>(path, "what `abbe render --stats` writes");
    let tables = [read(first)?, read(second)?];
    let names: BTreeSet<&str> = tables[0].sensors.iter().map(|s| s.name.as_str()).collect();
    let mut text = String::new();
    let mut values = serde_json::Map::new();
    for b in &tables[1].sensors {
        let Some(a) = tables[0].sensors.iter().find(|a| a.name == b.name) else {
            continue;
        };
        let classes = side_by_side([&a.classes, &b.classes]);
        values.insert(b.name.clone(), classes_json(&classes));
        if names.len() > 1 {
            _ = writeln!(text, "sensor {}", b.name);
        }
        text += &classes_text(&classes);
    }
    if values.is_empty() {
        return Err(ReportError::file(
            second,
            format!(
                "has none of the sensors of {} ({})",
                first.display(),
                names.into_iter().collect::<Vec<_>>().join(", ")
            ),
        ));
    }
    if as_json {
        text = format!("{:#}\n", serde_json::Value::Object(values));
    }
    Ok(text)
}

/// The classes of both, the brightest first.
fn side_by_side(tables: [&[Entry]; 2]) -> Vec<Class> {
    let mut classes: BTreeMap<&str, Strategies> = BTreeMap::new();
    for (i, table) in tables.into_iter().enumerate() {
        for entry in table {
            let strategies = classes.entry(&entry.class).or_default();
            strategies.entry((entry.s, entry.t)).or_default()[i] = Some(entry.row);
        }
    }
    let mut classes: Vec<Class> = classes
        .into_iter()
        .map(|(name, strategies)| Class {
            name: name.to_owned(),
            strategies,
        })
        .collect();
    let brightness = |class: &Class| class.mean(0).max(class.mean(1));
    classes.sort_by(|a, b| brightness(b).total_cmp(&brightness(a)));
    classes
}

/// For reading: the classes with a share of the light, their strategies below them.
fn classes_text(classes: &[Class]) -> String {
    let total: [f64; 2] = [0, 1].map(|i| classes.iter().map(|c| c.mean(i)).sum());
    let mut text = format!(
        "{:<14} {:>34}   {:>34}   {:>7}\n{:<14} {:>10} {:>12} {:>10}   {:>10} {:>12} {:>10}\n",
        "class", "first", "second", "ratio", "  (s, t)", "hits", "Y", "share", "hits", "Y", "share"
    );
    let mut untold = 0;
    for class in classes {
        let shares = [0, 1].map(|i| class.mean(i) / total[i].max(f64::MIN_POSITIVE));
        if shares[0].max(shares[1]) < TOLD_SHARE {
            untold += 1;
            continue;
        }
        _ = writeln!(
            text,
            "{:<14} {:>10} {:>12.4e} {:>10}   {:>10} {:>12.4e} {:>10}   {}",
            class.name,
            class.hits(0),
            class.mean(0),
            percent(shares[0]),
            class.hits(1),
            class.mean(1),
            percent(shares[1]),
            match class.mean(1) {
                0.0 => format!("{:>7}", "-"),
                mean => format!("{:>7.3}", class.mean(0) / mean),
            }
        );
        for (&(s, t), rows) in &class.strategies {
            let cells = rows.map(|row| match row {
                None => format!("{:>10} {:>12} {:>10}", "-", "", ""),
                Some(row) => format!(
                    "{:>10} {:>12.4e} raw {:>10.3e}",
                    row.hits, row.weighted_mean, row.raw_mean
                ),
            });
            let strategy = format!("  ({s}, {t})");
            _ = writeln!(text, "{strategy:<14} {:<38}   {}", cells[0], cells[1]);
        }
    }
    if untold > 0 {
        _ = writeln!(
            text,
            "and {untold} classes of less than {} each (--json has them)",
            percent(TOLD_SHARE)
        );
    }
    _ = writeln!(
        text,
        "{:<14} {:>10} {:>12.4e} {:>10}   {:>10} {:>12.4e}",
        "all", "", total[0], "", "", total[1]
    );
    text
}

fn classes_json(classes: &[Class]) -> serde_json::Value {
    let row = |row: &Option<Row>| {
        row.map(
            |r| serde_json::json!({ "hits": r.hits, "raw_mean": r.raw_mean, "weighted_mean": r.weighted_mean }),
        )
    };
    classes
        .iter()
        .map(|class| {
            let strategies: Vec<_> = class
                .strategies
                .iter()
                .map(|(&(s, t), rows)| serde_json::json!({ "s": s, "t": t, "first": row(&rows[0]), "second": row(&rows[1]) }))
                .collect();
            serde_json::json!({
                "class": class.name,
                "hits": [class.hits(0), class.hits(1)],
                "weighted_mean": [class.mean(0), class.mean(1)],
                "strategies": strategies,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[(&str, u32, u32, u64, f64)]) -> Vec<Entry> {
        rows.iter()
            .map(|&(class, s, t, hits, mean)| Entry {
                class: class.to_owned(),
                s,
                t,
                row: Row {
                    hits,
                    raw_mean: 2.0 * mean,
                    weighted_mean: mean,
                },
            })
            .collect()
    }

    #[test]
    fn strategies_of_a_class_add_up_and_missing_ones_stay_missing() {
        let a = table(&[("LDE", 1, 2, 10, 0.5), ("LDE", 2, 1, 4, 0.25)]);
        let b = table(&[("LSDE", 1, 3, 1, 3.0), ("LDE", 1, 2, 12, 0.75)]);
        let classes = side_by_side([&a, &b]);
        let names: Vec<&str> = classes.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["LSDE", "LDE"], "brightest first");
        assert_eq!((classes[1].hits(0), classes[1].hits(1)), (14, 12));
        assert_eq!((classes[1].mean(0), classes[1].mean(1)), (0.75, 0.75));
        assert!(classes[1].strategies[&(2, 1)][1].is_none());
        let text = classes_text(&classes);
        assert!(
            text.lines().nth(2).is_some_and(|l| l.ends_with("  0.000")),
            "{text}"
        );
        let json = classes_json(&classes);
        assert_eq!(json[1]["strategies"][1]["second"], serde_json::Value::Null);
    }
}
