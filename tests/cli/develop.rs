//! `abbe develop`: pictures of images, layers and parts, and the preview, which is one.

use super::{assert_same, bytes, fail, folder, succeed};

#[test]
fn images_parts_and_previews_give_the_same_picture() {
    let dir = folder();
    let said = succeed(
        dir.path(),
        "render scene.toml --spp 4 -o a.exr --part a.part",
    );
    assert!(said.contains("a.png, exposure "), "{said}");
    succeed(dir.path(), "develop a.exr -o b.png -q");
    assert_same(&dir, "a.png", "b.png");
    let said = succeed(dir.path(), "develop a.part -o c.png");
    assert!(said.contains("filmic curve"), "{said}");
    assert_same(&dir, "a.png", "c.png");
    // what is asked for changes the picture
    for options in [
        "--exposure -3",
        "--tone linear",
        "--tone agx",
        "--white scene",
        "--white 3200K",
        "--white A",
        "--white 1,0.9,0.7",
        "--display p3",
        "--depth 16",
    ] {
        succeed(dir.path(), &format!("develop a.exr -o d.png -q {options}"));
        assert_ne!(bytes(&dir, "a.png"), bytes(&dir, "d.png"), "{options}");
    }
    let dim = succeed(dir.path(), "develop a.exr --exposure 9 -o d.png");
    assert!(dim.contains("of the pixels are clipped"), "{dim}");
}

#[test]
fn a_figure_has_scale_sections_and_flux() {
    let dir = folder();
    let detector = "detector = { center = [0, 0, 2], u = [0.5, 0, 0], v = [0, 0.25, 0] }";
    let camera = "perspective = { eye = [0, 0, 4], target = [0, 0, 0], fov_deg = 40 }";
    let scene = super::SCENE.replace(camera, detector);
    assert_ne!(scene, super::SCENE);
    std::fs::write(dir.path().join("detector.toml"), scene).expect("writes");
    succeed(dir.path(), "render detector.toml --spp 2 -q -o a.exr");
    succeed(dir.path(), "develop a.exr -o a.svg -q --at 3,4");
    let svg = String::from_utf8(bytes(&dir, "a.svg")).expect("text");
    for part in [
        ">lx<",
        ">200 mm<",
        "mm from the middle",
        "row 4,",
        "column 3,",
        ">flux: ",
        "standard error",
        "data:image/png;base64,",
    ] {
        assert!(svg.contains(part), "{part}: {svg}");
    }
    assert_eq!(svg.matches("<polyline").count(), 2);
    for (options, code, said) in [
        (
            "-o a.svg --at 24,0",
            1,
            "has no pixel 24,0 (allowed: 0,0 to 23,15)",
        ),
        ("-o b.png --at 1,1", 2, "with --output NAME.svg"),
    ] {
        let message = fail(dir.path(), &format!("develop a.exr {options}"), code);
        assert!(message.contains(said), "{message}");
    }
}

#[test]
fn layers_are_developed_by_name() {
    let dir = folder();
    succeed(
        dir.path(),
        "render scene.toml --spp 2 -q -o a.exr --aov regularized,unbiased,depth",
    );
    succeed(dir.path(), "develop a.exr --layer unbiased -o b.png -q");
    succeed(dir.path(), "develop a.exr --layer depth -o c.png -q");
    let message = fail(dir.path(), "develop a.exr --layer albedo -o d.png", 1);
    assert!(
        message.contains("has no layer \"albedo\" (layers: depth, regularized, unbiased)"),
        "{message}"
    );
}

#[test]
#[cfg(target_os = "linux")]
fn what_is_no_file_is_refused_without_waiting_for_it() {
    let dir = folder();
    let made = std::process::Command::new("mkfifo")
        .arg(dir.path().join("pipe"))
        .status();
    assert!(made.expect("runs").success());
    for name in ["pipe", "/dev/zero"] {
        let message = fail(dir.path(), &format!("develop {name} -o a.png"), 1);
        assert!(message.contains("not a file"), "{name}: {message}");
    }
}

#[test]
fn wrong_requests_say_what_is_allowed() {
    let dir = folder();
    succeed(dir.path(), "render scene.toml --spp 1 -q -o a.exr");
    std::fs::create_dir(dir.path().join("other")).expect("a folder");
    std::fs::copy(dir.path().join("a.exr"), dir.path().join("other/a.exr")).expect("copies");
    for (arguments, code, expected) in [
        (
            "develop a.exr other/a.exr -o b.png",
            2,
            "there are several images",
        ),
        (
            "develop a.exr other/a.exr",
            2,
            "a.png would be written twice",
        ),
        ("develop a.exr -o a.exr", 2, "is read by this command"),
        (
            "develop a.exr -o b.exr",
            2,
            "a name that ends in .png or .svg",
        ),
        (
            "develop a.exr other/a.exr -o a.exr",
            2,
            "there are several images",
        ),
        ("develop a.exr --white 20K", 2, "1000K to 100000K"),
        ("develop a.exr --white D5O", 2, "did you mean"),
        ("develop a.exr --white 1,2", 2, "R,G,B"),
        ("develop a.exr --depth 12", 2, "8, 16"),
        ("develop a.exr --exposure 1e9", 2, "-1000 to 1000"),
        ("develop scene.toml", 1, "scene.toml"),
        ("develop nothing.exr", 1, "nothing.exr"),
    ] {
        let message = fail(dir.path(), arguments, code);
        assert!(message.contains(expected), "{arguments}: {message}");
    }
}
