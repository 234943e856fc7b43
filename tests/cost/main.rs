//! `abbe cost`: its tables, its page and its numbers agree; it goes on where it was stopped; the
//! page asks for nothing.
//!
//! One small report is made and looked at from all sides. An independent Python script (numpy and
//! the reference OpenEXR library) recomputes its errors; a Chromium, where there is one
//! (`ABBE_CHROMIUM` or a known name), shows the page.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

#[path = "../colour/python.rs"]
#[allow(dead_code, reason = "only the environment is used here")]
mod python;

use regex::Regex;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;
use tempfile::TempDir;

/// Dispersion, motion, a smooth ball: every effect that a report leaves out in turn. Cones are
/// wide, so that a few passes join paths at the ball.
const SCENE: &str = r#"
[render]
max_depth = 4
epsilon = 0.6
[[sensor]]
name = "camera"
resolution = [16, 12]
shutter = [0, 1]
perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40 }
[medium.flint]
glass = "schott:N-SF11"
[material.white]
diffuse = { reflectance = 0.7 }
[material.clear]
dielectric = {}
[[object]]
quad = { center = [0, 0, -1], u = [2, 0, 0], v = [0, 2, 0] }
material = "white"
[[object]]
sphere = { radius = 0.6 }
material = "clear"
interior = "flint"
motion = [{ keys = [{ time = 0, translate = [-0.3, 0, 0] }, { time = 1, translate = [0.3, 0, 0] }] }]
[[object]]
quad = { center = [0, 2.5, 0], u = [0, 0, 0.5], v = [0.5, 0, 0] }
emission = 5.0
two_sided = true
"#;
const COMMAND: &str = "cost scene.toml --spp 4 --seeds 2 --probe 8,6 --threads 1 -o report";

struct Report {
    folder: TempDir,
    page: String,
    json: Value,
    rows: Vec<BTreeMap<String, String>>,
}

fn run(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_abbe"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

fn succeed(folder: &Path, arguments: &str) -> String {
    let output = run(folder, arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

/// The report that all tests look at.
static REPORT: LazyLock<Report> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    succeed(folder.path(), COMMAND);
    let text =
        |name: &str| std::fs::read_to_string(folder.path().join("report").join(name)).unwrap();
    let csv = text("cost.csv");
    let mut lines = csv.lines().map(|l| l.split(',').map(str::to_owned));
    let names: Vec<String> = lines.next().unwrap().collect();
    let rows = lines
        .map(|row| names.iter().cloned().zip(row).collect())
        .collect();
    Report {
        page: text("report.html"),
        json: serde_json::from_str(&text("cost.json")).unwrap(),
        rows,
        folder,
    }
});

/// The JSON of a script element.
fn embedded(page: &str, id: &str) -> Value {
    let start = format!("<script type=\"application/json\" id=\"{id}\">");
    let rest = page.split_once(&start).unwrap().1;
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn page_and_tables_hold_the_same_numbers() {
    let report = &*REPORT;
    assert!(
        embedded(&report.page, "data") == report.json,
        "page and cost.json differ"
    );
    let mut points = 0;
    for variant in report.json["variants"].as_array().unwrap() {
        for point in variant["points"].as_array().unwrap() {
            let row = &report.rows[points];
            assert_eq!(row["variant"], variant["id"].as_str().unwrap());
            assert_eq!(row["image"], point["image"].as_str().unwrap());
            for name in [
                "seed",
                "passes",
                "cpu_seconds",
                "wall_seconds",
                "rel_mse",
                "trimmed_rel_mse",
                "log_rmse",
                "rel_variance",
                "mean_ratio",
                "probe",
            ] {
                let number: f64 = row[name].parse().unwrap();
                let theirs = point[name].as_f64().unwrap();
                // readers of JSON may err in the last digit
                assert!(
                    (number - theirs).abs() <= 1e-15 * theirs.abs(),
                    "{name} in row {points}: {number} and {theirs}"
                );
            }
            points += 1;
        }
    }
    assert_eq!(points, report.rows.len());
    let ids: BTreeSet<&str> = report.rows.iter().map(|r| r["variant"].as_str()).collect();
    for id in [
        "scene",
        "path",
        "light",
        "bdpt",
        "bdpt-single",
        "vcm",
        "merging",
        "no-dispersion",
        "no-motion",
        "no-regularization",
        "no-casters",
        "half-depth",
        "lanes-1",
        "lanes-8",
    ] {
        assert!(ids.contains(id), "no {id} in {ids:?}");
    }
}

#[test]
fn cells_are_counted_in_passes() {
    let report = &*REPORT;
    let mut passes: BTreeMap<(&str, &str), Vec<&str>> = BTreeMap::new();
    for row in &report.rows {
        let cell = (row["variant"].as_str(), row["seed"].as_str());
        passes.entry(cell).or_default().push(&row["passes"]);
    }
    assert!(passes.len() > 20, "{passes:?}");
    assert!(passes.values().all(|p| *p == ["2", "4"]), "{passes:?}");
    // eight times as many
    assert_eq!(
        report.json["reference"]["image"],
        "reference-1000003-32.exr"
    );
    assert_eq!(report.json["spp"], 4);
    assert!(report.json.get("budget_seconds").is_none());
    assert!(report.page.contains("<dt>passes per cell</dt><dd>4</dd>"));
}

#[test]
fn the_data_is_read_as_it_was_written() {
    let report = &*REPORT;
    let path = report.folder.path().join("report/cost.json");
    let read = abbe::report::cost::Report::read(&path).unwrap();
    assert_eq!(read.extent, abbe::report::cost::Extent::Passes(4));
    assert_eq!(serde_json::to_value(&read).unwrap(), report.json);
    assert_eq!(read.csv().lines().count(), report.rows.len() + 1);
    let wrong = abbe::report::cost::Report::read(&report.folder.path().join("scene.toml"));
    let message = wrong.unwrap_err().to_string();
    assert!(
        message.contains("scene.toml: is not what `abbe cost` writes: "),
        "{message}"
    );
}

#[test]
fn the_page_asks_for_nothing() {
    let page = &REPORT.page;
    for word in [
        "http:",
        "https:",
        "src=\"/",
        "@import",
        "fetch(",
        "XMLHttpRequest",
        "<link rel=\"stylesheet",
    ] {
        assert!(!page.contains(word), "{word}");
    }
    let source = Regex::new(r#"(?:src|href)="([^"]{0,5})"#).unwrap();
    for found in source.captures_iter(page) {
        assert_eq!(&found[1], "data:");
    }
}

#[test]
fn every_plot_has_its_curves() {
    let report = &*REPORT;
    let plot = Regex::new(r#"(?s)<svg id="([a-z-]+)" class="plot".*?</svg>"#).unwrap();
    let curve =
        Regex::new(r#"data-id="([a-z0-9-]+)"[^>]*><title>[^<]*</title><polyline points="([^"]+)""#)
            .unwrap();
    let mut plots = BTreeSet::new();
    for found in plot.captures_iter(&report.page) {
        let group = found[1].split('-').next().unwrap().to_owned();
        plots.insert(found[1].to_owned());
        let drawn: BTreeSet<&str> = curve
            .captures_iter(&found[0])
            .map(|c| c.get(1).unwrap().as_str())
            .collect();
        let expected: BTreeSet<&str> = report.json["variants"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|v| {
                let groups = v["groups"].as_array().unwrap();
                groups.is_empty() || groups.iter().any(|g| *g == group.as_str())
            })
            .map(|v| v["id"].as_str().unwrap())
            .collect();
        assert_eq!(drawn, expected, "{}", &found[1]);
    }
    let all: BTreeSet<String> = ["effects", "methods", "settings"]
        .iter()
        .flat_map(|group| {
            ["log", "noise", "probe", "samples", "time", "trimmed"]
                .map(|plot| format!("{group}-{plot}"))
        })
        .collect();
    assert_eq!(plots, all);
    for plot in &plots {
        let file = report
            .folder
            .path()
            .join("report")
            .join(format!("{plot}.svg"));
        let text = std::fs::read_to_string(file).unwrap();
        assert!(text.starts_with("<svg ") && text.matches("<polyline").count() > 1);
    }
    let pictures = embedded(&report.page, "pictures");
    let variants = report.json["variants"].as_array().unwrap().len();
    assert_eq!(pictures.as_array().unwrap().len(), variants + 1);
}

#[test]
fn strategies_are_shown_one_by_one() {
    let page = &REPORT.page;
    let caption = Regex::new(r"<figcaption>s (\d+), t (\d+)</figcaption>").unwrap();
    let (_, pyramid) = page
        .split_once("<div class=\"scroll\" id=\"pyramid\">")
        .unwrap();
    let strategies: BTreeSet<(u32, u32)> = caption
        .captures_iter(pyramid)
        .map(|c| (c[1].parse().unwrap(), c[2].parse().unwrap()))
        .collect();
    // light on the wall by each of three ways, and no walk that would have to hit the pinhole
    for made in [(0, 3), (1, 2), (2, 1)] {
        assert!(strategies.contains(&made), "{made:?} in {strategies:?}");
    }
    assert!(strategies.iter().all(|s| s.1 > 0), "{strategies:?}");
    assert!(
        page.contains("<figure id=\"share\">"),
        "the ball is regularized"
    );
}

/// No light path ends at a pinhole behind a smooth ball, and such light is what is told first.
#[test]
fn light_that_a_method_misses_comes_first() {
    let report = &*REPORT;
    let variants = report.json["variants"].as_array().unwrap();
    let missed = |id: &str| {
        let of = variants.iter().find(|v| v["id"] == id).unwrap();
        of["missed"]["classes"].as_array().cloned()
    };
    let by_light = missed("light").unwrap();
    let [never, rarely]: [Vec<&Value>; 2] = [true, false].map(|never| {
        by_light
            .iter()
            .filter(|c| (c["hits"] == 0) == never)
            .collect()
    });
    let share: f64 = never.iter().map(|c| c["share"].as_f64().unwrap()).sum();
    assert!((0.01..0.5).contains(&share), "{by_light:?}");
    let seen_through_the_ball = |c: &&Value| c["class"].as_str().unwrap().ends_with("SE");
    assert!(never.iter().all(seen_through_the_ball), "{by_light:?}");
    assert!(!rarely.iter().any(seen_through_the_ball), "{by_light:?}");
    assert_eq!(missed("lanes-1"), None, "of methods alone");
    let sentences = report.json["sentences"].as_array().unwrap();
    let first = sentences[0].as_str().unwrap();
    assert!(first.contains("of the light (L"), "{sentences:?}");
    let of_light = sentences
        .iter()
        .position(|s| s.as_str().unwrap().starts_with("light misses "));
    let others = sentences
        .iter()
        .position(|s| s.as_str().unwrap().contains("time per sample"));
    assert!(of_light.unwrap() < others.unwrap(), "{sentences:?}");
}

#[test]
fn effects_are_told_with_the_error_of_leaving_them_out() {
    let report = &*REPORT;
    let table = report.page.split_once("<table id=\"effects\">").unwrap().1;
    let table = table.split_once("</table>").unwrap().0;
    let variants = report.json["variants"].as_array().unwrap();
    let of_effects = |v: &&Value| {
        let groups = v["groups"].as_array().unwrap();
        groups.iter().any(|g| *g == "effects")
    };
    let labels: Vec<&str> = variants
        .iter()
        .filter(of_effects)
        .map(|v| v["label"].as_str().unwrap())
        .collect();
    assert_eq!(table.matches("<tr>").count(), labels.len() + 1);
    for (row, label) in table.split("<tr>").skip(2).zip(labels) {
        let cells: Vec<&str> = row.split("<td>").collect();
        assert!(cells[0].contains(label) && cells.len() == 5, "{row}");
        assert!(cells.iter().all(|c| !c.starts_with("</td>")), "{row}");
    }
}

#[test]
fn finished_cells_are_not_rendered_again() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let command = "cost scene.toml --spp 2 --seeds 1 --vary methods --threads 1 -o report";
    let first = succeed(folder.path(), command);
    assert!(!first.contains("as rendered before"), "{first}");
    let csv = || std::fs::read(folder.path().join("report/cost.csv")).unwrap();
    let before = csv();
    // one cell is lost, as if the run had been stopped before its end
    std::fs::remove_file(folder.path().join("report/path-1.json")).unwrap();
    let again = succeed(folder.path(), command);
    let fresh: Vec<&str> = again
        .lines()
        .filter(|l| l.contains("seed 1") && !l.contains("as rendered before"))
        .collect();
    assert_eq!(fresh, ["  seed 1: path"]);
    // what was kept is the same, byte for byte
    let rest = |csv: &[u8]| -> Vec<String> {
        let text = String::from_utf8(csv.to_vec()).unwrap();
        text.lines()
            .filter(|l| !l.starts_with("path,"))
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(rest(&before), rest(&csv()));
    // another scene is another report
    let brighter = succeed(
        folder.path(),
        &format!("{command} --set object.2.emission=6"),
    );
    assert!(!brighter.contains("as rendered before"), "{brighter}");
}

#[test]
fn wrong_options_are_refused() {
    let folder = REPORT.folder.path();
    for (options, said) in [
        ("--probe 16,0", "beyond sensor \"camera\" of 16 x 12 pixels"),
        (
            "--sensor lens",
            "unknown sensor \"lens\" (the scene has: camera)",
        ),
        ("--budget 0s", "expected a time above 0"),
        ("--spp 1", "1 is not in 2..=131072"),
        (
            "--spp 2 --budget 1s",
            "'--spp <N>' cannot be used with '--budget <TIME>'",
        ),
        ("--seeds 0", "0 is not in 1..=64"),
    ] {
        let output = run(folder, &format!("cost scene.toml {options} -o refused"));
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code() == Some(2) && error.contains(said),
            "{options}: {error}"
        );
    }
}

#[test]
fn an_independent_script_finds_the_same_errors() {
    let Some(python) = python::python() else {
        println!("not run: no Python");
        return;
    };
    let report = &*REPORT;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cost/check.py");
    let output = Command::new(python)
        .args(["-I".as_ref(), script.as_os_str()])
        .arg(report.folder.path().join("report"))
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let text = String::from_utf8(output.stdout).unwrap();
    let answers: Vec<Value> = text
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    assert_eq!(answers.len(), report.rows.len());
    for (row, answer) in report.rows.iter().zip(&answers) {
        for name in [
            "rel_mse",
            "trimmed_rel_mse",
            "log_rmse",
            "rel_variance",
            "mean_ratio",
        ] {
            let (ours, theirs): (f64, f64) =
                (row[name].parse().unwrap(), answer[name].as_f64().unwrap());
            // sums in another order
            assert!(
                (ours - theirs).abs() <= 1e-9 * theirs.abs() + 1e-15,
                "{name} of {}: {ours} and {theirs}",
                row["image"]
            );
        }
    }
}

/// A Chromium to look at the page with.
fn chromium() -> Option<PathBuf> {
    if let Ok(path) = std::env::var("ABBE_CHROMIUM") {
        return Some(path.into());
    }
    let names = [
        "chromium",
        "chromium-browser",
        "google-chrome",
        "google-chrome-stable",
        "chrome",
    ];
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|file| file.is_file())
}

#[test]
fn a_browser_shows_and_flips_the_pictures() {
    let Some(browser) = chromium() else {
        println!("not run: no browser");
        return;
    };
    let report = &*REPORT;
    // the page, and a script that clicks and types and writes down what it saw
    let steps = r#"<script>
    const log = [];
    addEventListener("error", e => log.push("error: " + e.message));
    const shown = () => document.getElementById("shown").textContent;
    const key = k => document.body.dispatchEvent(new KeyboardEvent("keydown", { key: k, bubbles: true }));
    // as long as it takes: pictures are decoded in the background
    const until = async test => { while (!test()) await new Promise(done => setTimeout(done, 20)); };
    const change = async act => { const before = shown(); act(); await until(() => shown() !== before); log.push(shown()); };
    addEventListener("load", async () => {
      const view = document.getElementById("view");
      await until(() => view.width === 16); log.push(shown());
      await change(() => view.click());
      await change(() => key("ArrowLeft"));
      const small = view.clientWidth;
      key("+"); key("+"); await until(() => view.clientWidth === 2 * small); log.push(view.clientWidth / small);
      await change(() => key("e"));
      log.push(performance.getEntriesByType("resource").filter(r => !r.name.startsWith("data:")).length);
      const out = document.createElement("pre");
      out.id = "log"; out.textContent = JSON.stringify(log);
      document.body.append(out);
    });
    </script></body>"#;
    let page = report.folder.path().join("driven.html");
    std::fs::write(&page, report.page.replace("</body>", steps)).unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--virtual-time-budget=8000",
            "--dump-dom",
        ])
        .arg(format!(
            "--user-data-dir={}",
            report.folder.path().join("profile").display()
        ))
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let log = dom
        .split_once("<pre id=\"log\">")
        .expect("the script ran to its end")
        .1;
    let log: Vec<Value> =
        serde_json::from_str(&log.split_once("</pre>").unwrap().0.replace("&amp;", "&")).unwrap();
    let labels: Vec<&str> = report.json["variants"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v["label"].as_str().unwrap())
        .collect();
    let expected = serde_json::json!([
        labels[0],
        labels[1],
        labels[0],
        2,
        format!("{}: error", labels[0]),
        0
    ]);
    assert_eq!(Value::Array(log), expected);
}
