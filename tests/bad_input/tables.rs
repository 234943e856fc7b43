//! Tables of spectra and indices: what is strange is right, what is wrong is refused by name.

use abbe::io::scene_file::{LoadedScene, load};
use abbe::spectrum::xyz::{N_Y, cmf, emission_to_xyz};

/// Loads a scene whose table `t.csv` holds `rows`; `item` makes use of it.
fn scene(rows: &str, item: &str) -> Result<LoadedScene, String> {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = |name: &str| folder.path().join(name);
    let text = format!(
        "[[sensor]]\northographic = {{ eye = [0, 0, 5], target = [0, 0, 0], height = 1 }}\n{item}\n"
    );
    std::fs::write(at("t.csv"), rows).expect("writes");
    std::fs::write(at("s.toml"), text).expect("writes");
    load(&at("s.toml"), &[]).map_err(|e| e.to_string())
}

const LAMP: &str = "[[light]]\nenvironment = { radiance = { file = \"t.csv\" } }";
const GLASS: &str = "[medium.g]\nfile = \"t.csv\"\n[[light]]\nenvironment = { radiance = 1 }";

#[test]
fn peaks_between_whole_nanometers_have_their_energy() {
    // triangles of 1 W: the observer is linear between whole nanometers
    for (rows, nm) in [
        ("360,0\n531.9,0\n532,10\n532.1,0\n830,0\n", 532.0),
        ("360,0\n532.1,0\n532.5,2.5\n532.9,0\n830,0\n", 532.5),
    ] {
        let y = |item: &str| {
            let scene = scene(rows, item).unwrap_or_else(|e| panic!("{e}"));
            emission_to_xyz(&scene.description.lights[0].light.emission)[1]
        };
        let expected = cmf(nm)[1] / N_Y;
        // the slope of the observer changes at 532 nm, a tenth of a nanometer from the ends
        let found = y(LAMP);
        assert!(
            (found / expected - 1.0).abs() < 1e-4,
            "{found}, expected {expected}"
        );
        let scaled = LAMP.replace("\"t.csv\"", "\"t.csv\", luminance = 1");
        assert!((y(&scaled) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn decimal_commas_are_understood() {
    let scene = scene("nm;n\n360;1,53\n830;1,51\n", GLASS).unwrap_or_else(|e| panic!("{e}"));
    let medium = scene.description.media.iter().find(|m| m.name == "g");
    let n = medium.expect("the medium").ior.n(595.0);
    assert!((n - 1.52).abs() < 1e-9, "{n}");
}

#[test]
fn tables_that_say_nothing_here_are_refused() {
    for (rows, item, expected) in [
        (
            "900,1\n1000,3\n1100,2\n",
            LAMP,
            "none within the working range of 360..830 nm",
        ),
        ("0.3,0.9\n0.5,0.8\n2.5,0.1\n", LAMP, "is it in micrometers?"),
        (
            "500,1\n600,1\n",
            LAMP,
            "allowed: at most 10 %, or extrapolate = true",
        ),
        ("400,1e308\n500,1e308\n", LAMP, "allowed: "),
        ("360,1e20\n830,1e20\n", GLASS, "n from 1 to 10"),
    ] {
        let error = scene(rows, item).expect_err(rows);
        assert!(error.contains(expected), "{rows}: {error}");
    }
    let held = LAMP.replace("\"t.csv\"", "\"t.csv\", extrapolate = true");
    assert!(scene("500,1\n600,1\n", &held).is_ok());
    // a laser: what is held is 0
    assert!(scene("500,0\n532,1\n600,0\n", LAMP).is_ok());
    let everyday = "400,0.5\n700,0.5\n";
    let wall = "[material.m]\ndiffuse = { reflectance = { file = \"t.csv\" } }\n[[light]]\nenvironment = { radiance = 1 }";
    assert!(scene(everyday, wall).is_ok());
}
