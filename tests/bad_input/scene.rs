//! `cases/NAME.toml` must give exactly the messages of `cases/NAME.txt` (one per line).
//! `UPDATE_GOLDEN=1` writes the latter.

use abbe::io::scene_file::read_str;
use std::fs;
use std::path::{Path, PathBuf};

fn cases() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad_input/cases");
    let entries = fs::read_dir(folder)
        .expect("folder of cases")
        .map(|e| e.expect("entry").path());
    let mut files: Vec<PathBuf> = entries
        .filter(|p| p.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    files
}

#[test]
fn every_bad_scene_gets_exactly_its_messages() {
    let files = cases();
    let mut wrong = Vec::new();
    for path in &files {
        let text = fs::read_to_string(path).expect("case");
        let name = path.file_name().expect("file").to_string_lossy();
        let found = match read_str(&text, &name, path.parent().expect("folder"), &[]) {
            Ok(_) => "no error".to_owned(),
            Err(errors) => errors.to_string(),
        };
        let expected_path = path.with_extension("txt");
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            fs::write(&expected_path, format!("{found}\n")).expect("writes");
        }
        let expected = fs::read_to_string(&expected_path).unwrap_or_default();
        if found != expected.trim_end() {
            wrong.push(format!(
                "{name}\n  expected:\n{expected}\n  found:\n{found}"
            ));
        }
    }
    assert!(files.len() >= 35, "only {} cases found", files.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn overrides_say_which_one_is_wrong() {
    let scene = include_str!("valid.toml");
    let message = |key: &str, value: &str| {
        let overrides = [
            ("render.spp".to_owned(), "8".to_owned()),
            (key.to_owned(), value.to_owned()),
        ];
        read_str(scene, "valid.toml", Path::new("."), &overrides)
            .map(|_| ())
            .map_err(|e| e.to_string())
    };
    for (key, value) in [
        ("render.integrator", "path"),
        ("object.0.sphere.radius", "2"),
        ("object.ball.sphere", "{ radius = 2 }"),
        ("render.wavelengths.line_nm", "550"),
    ] {
        // the last one replaces a name by a table
        let expected_ok = key != "render.wavelengths.line_nm";
        assert_eq!(
            message(key, value).is_ok(),
            expected_ok,
            "{key}={value}: {:?}",
            message(key, value)
        );
    }
    for (key, value, expected) in [
        (
            "render.spq",
            "8",
            "--set render.spq=8: unknown key \"spq\" (did you mean \"spp\"?)",
        ),
        (
            "render.lanes",
            "3",
            "--set render.lanes=3: lanes is 3 (allowed: 1, 4 or 8)",
        ),
        (
            "render.seed",
            "x",
            "--set render.seed=x: invalid type: string \"x\", expected a whole number",
        ),
        (
            "object.7.material",
            "x",
            "--set object.7.material=x: no list element \"7\" (allowed: 0..4, or an element's name)",
        ),
        (
            "model.0.resolution",
            "[8, 8]",
            "--set model.0.resolution=[8, 8]: there is no list \"model\" to index (lists there are: light, object, sensor)",
        ),
        (
            "render..spp",
            "1",
            "--set render..spp=1: the key has an empty part (allowed: names and indices joined by dots)",
        ),
        (
            &["a"; 33].join("."),
            "1",
            &format!(
                "--set {}=1: the key has 33 parts (allowed: at most 32)",
                ["a"; 33].join(".")
            ),
        ),
        (
            "unit.x",
            "1",
            "--set unit.x=1: \"x\" cannot be set inside a value of type string",
        ),
    ] {
        assert_eq!(message(key, value).expect_err(key), expected);
    }
}

#[test]
fn a_scene_file_above_the_limit_is_not_read() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("big.toml");
    fs::File::create(&path)
        .and_then(|f| f.set_len((16 << 20) + 1))
        .expect("sparse file");
    let text = abbe::io::scene_file::load(&path, &[])
        .expect_err("too large")
        .to_string();
    let p = path.display();
    assert_eq!(
        text,
        format!("{p}: 16777217 bytes (allowed: at most 16777216)")
    );
}

#[test]
fn hash_ignores_layout_and_render_but_no_value() {
    let hash = |text: &str| {
        read_str(text, "s", Path::new("."), &[])
            .expect("valid")
            .description
            .hash
    };
    let scene = include_str!("valid.toml");
    assert_eq!(
        hash(scene),
        hash(&scene.replace("spp = 16", "spp = 17 # more"))
    );
    assert_ne!(
        hash(scene),
        hash(&scene.replace("radius = 5", "radius = 6"))
    );
}
