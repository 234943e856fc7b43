//! Measures of images and renders:bands, bias, tables of path classes.

use super::{SCENE, bytes, fail, folder, json, succeed, text};

#[test]
fn bands_are_measured_and_shown() {
    let dir = folder();
    succeed(
        dir.path(),
        "render scene.toml --spp 4 -q -o a.exr --filter box",
    );
    succeed(
        dir.path(),
        "render scene.toml --spp 4 -q -o b.exr --filter box --seed 3",
    );
    let alone = succeed(dir.path(), "compare a.exr --banding --axis 12,8");
    assert!(alone.contains("F-ratio") && !alone.contains("participation"));
    let bands = json(&succeed(
        dir.path(),
        "compare a.exr b.exr --banding --json --region 2,2,22,14",
    ));
    assert_eq!(bands["Y"]["lines"], 20);
    let stderr = fail(
        dir.path(),
        "compare a.exr b.exr --banding --region 2,2,25,14",
        2,
    );
    assert!(stderr.contains("reaches beyond an image of 24 x 16 pixels"));
    // before anything is rendered
    let endless = "banding scene.toml --passes 4000000000 --region 2,2,25,14 -o page.html";
    let stderr = fail(dir.path(), endless, 2);
    assert!(stderr.contains("reaches beyond an image of 24 x 16 pixels"));
    let stdout = succeed(
        dir.path(),
        "banding scene.toml --passes 2,1,2 --reference-passes 4 --seeds 2 -o page.html",
    );
    // the scene has a smooth ball
    for method in ["bdpt, as much time", "bdpt regularized, as much time"] {
        assert_eq!(stdout.matches(method).count(), 2, "{stdout}");
    }
    let page = String::from_utf8_lossy(&bytes(&dir, "page.html")).into_owned();
    assert!(page.contains("data:image/png;base64,") && page.contains("SmallVCM"));
    assert!(page.contains("Lines: 1, 2 passes."), "sorted, each once");
    let report = json(&String::from_utf8_lossy(&bytes(&dir, "page.json")));
    assert_eq!(report["rows"].as_array().map(Vec::len), Some(10));
    let noise = &report["rows"][0]["rel_mse"];
    let number = |name| noise[name].as_f64().expect("a number");
    assert!(
        0.0 < number("error") && number("error") < number("mean"),
        "{noise}"
    );
    assert!(page.contains("Means over 2 seeds"));
}

#[test]
fn bands_are_measured_with_the_box_filter_whatever_the_sensor_has() {
    let dir = folder();
    let filtered = SCENE.replace("resolution", "filter = \"gaussian\"\nresolution");
    std::fs::write(dir.path().join("filtered.toml"), filtered).expect("writes");
    let relative_errors = |scene: &str| {
        let options = "--passes 2 --reference-passes 2 --seeds 1 --threads 1 -q";
        succeed(
            dir.path(),
            &format!("banding {scene}.toml {options} -o {scene}.html"),
        );
        let report = json(&text(&bytes(&dir, &format!("{scene}.json"))));
        let rows = report["rows"].as_array().expect("rows");
        // the last ones depend on the time that others take
        rows[..3]
            .iter()
            .map(|r| r["rel_mse"].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(relative_errors("scene"), relative_errors("filtered"));
}

#[test]
fn the_layer_bias_needs_two_cones() {
    let dir = folder();
    let render = "render scene.toml --spp 2 -q --aov bias";
    let needs = "the layer bias needs regularization and --set render.bias_estimate=true";
    for wrong in [
        "",
        "--regularize off --set render.bias_estimate=true",
        "--regularize mis",
    ] {
        let stderr = fail(dir.path(), &format!("{render} {wrong}"), 2);
        assert!(stderr.contains(needs), "{wrong}: {stderr}");
    }
    succeed(
        dir.path(),
        &format!("{render} --set render.bias_estimate=true"),
    );
    // detectors tell the bias by themselves
    let detector = SCENE.replace(
        "perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40 }",
        "detector = { center = [0, 0, 2], u = [0.5, 0, 0], v = [0, 0.5, 0] }",
    );
    std::fs::write(dir.path().join("detector.toml"), detector).expect("writes");
    succeed(
        dir.path(),
        "render detector.toml --spp 2 -q --aov bias --regularize mis",
    );
}

#[test]
fn compare_puts_tables_of_classes_side_by_side() {
    let dir = folder();
    succeed(dir.path(), "render scene.toml -q --spp 2 --stats a.json");
    succeed(
        dir.path(),
        "render scene.toml -q --spp 2 --integrator path --stats b.json",
    );
    let text = succeed(dir.path(), "compare a.json b.json");
    assert!(text.starts_with("class "), "{text}");
    let both = json(&succeed(dir.path(), "compare a.json b.json --json"));
    let sensor = both.as_object().and_then(|s| s.values().next());
    let class = &sensor.expect("a sensor")[0];
    let mean = |table: usize| class["weighted_mean"][table].as_f64().unwrap_or(0.0);
    assert!(mean(0) > 0.0 && mean(1) > 0.0, "{class}");
    let rows = class["strategies"].as_array().expect("strategies");
    let own = |row: &&serde_json::Value| row["second"].is_null();
    assert!(
        rows.iter().any(|r| own(&r)),
        "path has fewer strategies: {class}"
    );
    std::fs::write(dir.path().join("c.json"), "{}").expect("written");
    let message = fail(dir.path(), "compare a.json c.json", 1);
    assert!(
        message.starts_with(
            "error: c.json: is not what `abbe render --stats` writes: missing field `sensors`"
        ),
        "{message}"
    );
    std::fs::write(dir.path().join("d.json"), r#"{"sensors": []}"#).expect("written");
    let message = fail(dir.path(), "compare a.json d.json", 1);
    assert!(
        message.starts_with("error: d.json: has none of the sensors of a.json ("),
        "{message}"
    );
}
