//! Prescriptions as objects of scenes: what becomes of their surfaces, and what cannot stand there.

use abbe::io::lens;
use abbe::io::scene_file::parse_str;
use abbe::medium::{Boundary, MediumId};
use abbe::optics::{Aperture, Interaction, Outline, Prescription};
use abbe::scene::description::SceneDescription;
use abbe::scene::{LensAssembly, Scene};
use abbe::spectrum::Library;
use glam::DVec2;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/lenses")
}

fn read(file: &str) -> Prescription {
    lens::read(&folder().join(file), Library::embedded()).unwrap_or_else(|e| panic!("{e}"))
}

fn scene(lens: &str) -> SceneDescription {
    let text = format!(
        "unit = \"mm\"\n[[sensor]]\ndetector = {{ center = [0, 0, 400], u = [-9, 0, 0], v = [0, 9, \
         0] }}\n[[light]]\nbeam = {{ position = [0, 0, -50], direction = [0, 0, 1], radius = 5, \
         irradiance = 1 }}\n[[lens]]\n{lens}\n"
    );
    parse_str(&text, &folder())
        .unwrap_or_else(|e| panic!("{lens}: {e}"))
        .description
}

#[test]
fn every_lens_of_the_repository_stands_in_a_scene() {
    let mut count = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let file = entry.unwrap().file_name().into_string().unwrap();
        if file.ends_with(".md") {
            continue;
        }
        count += 1;
        let prescription = read(&file);
        let bends = (0..=prescription.last()).filter(|&i| {
            let surface = &prescription.surfaces[i];
            surface.interaction == Interaction::Refract
                && prescription.medium_before(i).ior != surface.medium.ior
        });
        let description = scene(&format!("file = \"{file}\""));
        let is_interface = |b: &Boundary| matches!(b, Boundary::Interface { .. });
        let interfaces = description
            .objects
            .iter()
            .filter(|o| is_interface(&o.boundary));
        assert_eq!(interfaces.count(), bends.count(), "{file}");
        Scene::build(description).unwrap_or_else(|e| panic!("{file}: {e}"));
    }
    assert!(count >= 8, "{count} lenses");
}

/// Edges of lenses are seen from outside by who stands beside their barrel, and their surfaces
/// behind them from inside.
#[test]
fn a_film_wider_than_the_lens_before_it_is_in_air() {
    for half in [24, 60, 200] {
        let text = format!(
            "unit = \"mm\"\n[[sensor]]\ndetector = {{ center = [0, 0, 114.455], u = [-{half}, 0, 0], v = \
             [0, {half}, 0] }}\n[[light]]\nbeam = {{ position = [0, 0, -60], direction = [0, 0, 1], \
             radius = 29, irradiance = 1 }}\n[[lens]]\nfile = \"double_gauss.zmx\"\nbarrel = 31\n"
        );
        let loaded = parse_str(&text, &folder()).unwrap_or_else(|e| panic!("{e}"));
        let scene = Scene::build(loaded.description).unwrap_or_else(|e| panic!("{half} mm: {e}"));
        assert_eq!(scene.sensors[0].stack.medium(), MediumId(0), "{half} mm");
    }
}

#[test]
fn edges_of_glass_are_black_or_as_told() {
    let ground = "edge = \"ground\"\n[material.ground]\ndiffuse = { reflectance = 0.6 }";
    for (file, edge) in [("achromat.zmx", ""), ("achromat.zmx", ground)] {
        let description = scene(&format!("file = \"{file}\"\nbarrel = 14\n{edge}"));
        let materials = |word: &str| -> Vec<bool> {
            let objects = description.objects.iter();
            let named = objects.filter(|o| o.name.contains(word));
            let black = description
                .objects
                .iter()
                .find(|o| o.name.contains("barrel"));
            let black = black.expect("a barrel").material;
            named.map(|o| o.material != black).collect()
        };
        let told = !edge.is_empty();
        assert_eq!(materials("edge of"), [told]);
        // the first surface holds the group in its barrel
        assert_eq!(materials("flange of"), [told]);
    }
    let clear = "file = \"achromat.zmx\"\nedge = \"clear\"\n[material.clear]\ndielectric = {}";
    let text = format!(
        "[[sensor]]\ndetector = {{ center = [0, 0, 1], u = [-1, 0, 0], v = [0, 1, 0] }}\n[[lens]]\n{clear}\n"
    );
    let fault = parse_str(&text, &folder()).unwrap_err().to_string();
    assert!(
        fault.contains("edge lets light through (allowed: an opaque material)"),
        "{fault}"
    );
}

#[test]
fn coatings_lie_between_air_and_glass_with_their_first_layer_in_air() {
    let description = scene(
        "file = \"achromat.zmx\"\ncoating = [{ eta = 1.38, thickness_nm = 100 }, { eta = 2, \
         thickness_nm = 50 }]",
    );
    let mut coated = 0;
    for object in &description.objects {
        let Boundary::Interface { above, below } = object.boundary else {
            continue;
        };
        let coating = &description.materials[object.material.0 as usize].coating;
        let has_air = [above, below].contains(&MediumId::AMBIENT);
        assert_eq!(coating.is_some(), has_air, "{}", object.name);
        if let Some(stack) = coating {
            // a material names them from above
            let from_air = if above == MediumId::AMBIENT { 0 } else { 1 };
            assert_eq!(stack.layers[from_air].ior.n(500.0), 1.38, "{}", object.name);
            coated += 1;
        }
    }
    assert_eq!(coated, 2);
}

#[test]
fn cemented_surfaces_name_both_glasses() {
    let objects = scene("file = \"achromat.zmx\"").objects;
    let sides: Vec<[u32; 2]> = objects
        .iter()
        .filter_map(|o| match o.boundary {
            Boundary::Interface { above, below } => Some([below.0, above.0]),
            _ => None,
        })
        .collect();
    // along the light: air is the ambient medium
    assert_eq!(sides.len(), 3);
    assert_eq!((sides[0][0], sides[2][1]), (0, 0));
    assert_eq!((sides[0][1], sides[1][1]), (sides[1][0], sides[2][0]));
    assert_ne!(sides[1][0], sides[1][1]);
}

#[test]
fn what_cannot_be_closed_is_refused_by_surface() {
    let error = |change: &dyn Fn(&mut Prescription), barrel| {
        let mut lens = read("achromat.zmx");
        change(&mut lens);
        LensAssembly::new(&lens, barrel).unwrap_err()
    };
    let radius = |lens: &Prescription| lens.surfaces[1].shape.aperture.radius().unwrap();
    let widest = radius(&read("achromat.zmx"));
    let e = error(&|l| l.surfaces[1].shape.aperture = Aperture::OPEN, None);
    assert_eq!(e.surface, 2);
    let e = error(&|l| l.surfaces[1].shape.aperture.center = DVec2::X, None);
    assert_eq!(e.surface, 2);
    let half = DVec2::splat(3.0);
    let e = error(
        &|l| l.surfaces[2].shape.aperture.outline = Outline::Rectangle { half },
        None,
    );
    assert!(e.message.contains("rectangle"), "{e}");
    let e = error(&|_| (), Some(widest * 0.9));
    assert!(e.message.contains("barrel"), "{e}");
    assert!(LensAssembly::new(&read("achromat.zmx"), Some(widest * 1.1)).is_ok());
}
