//! `abbe info`: what a scene holds, what it calls for and why.

use super::args::InfoOptions;
use super::memory::guarded;
use super::usage::bytes_text;
use super::{CliError, Outcome, glass, print, summary, tell};
use crate::camera::detector::Toward;
use crate::geometry::{Shape, Shutter};
use crate::integrator::{aims, fans};
use crate::io::loaded::{Loaded, load};
use crate::render::OutputRequest;
use crate::render::memory::{
    film_bytes, geometry_bytes, object_bytes, saving_bytes, texture_bytes,
};
use crate::report::readable::{counted, percent};
use crate::scene::chains::Chains;
use crate::scene::effects::Effect;
use crate::scene::moving::Moving;
use crate::scene::regularization::decide;
use crate::scene::settings::{Aiming, IntegratorKind};
use crate::scene::{Scene, Sensor};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Most contacts listed in the text.
const MOST_CONTACTS: usize = 20;

/// Runs the command.
pub fn run(options: &InfoOptions) -> Result<Outcome, CliError> {
    let loaded = guarded(None, || load(&options.scene, &options.overrides.set))??;
    for warning in &loaded.warnings {
        tell(&format!("warning: {warning}"));
    }
    print(&if options.json {
        format!("{:#}\n", to_json(&loaded))
    } else {
        to_text(&loaded)
    })?;
    Ok(Outcome::Done)
}

/// Effects of the scene, and whether each sensor is regularized.
fn effects(loaded: &Loaded) -> Vec<Effect> {
    let decided = |sensor| decide(&loaded.scene, sensor, &loaded.settings).effect();
    let sensors = 0..loaded.scene.sensors.len();
    loaded
        .scene
        .effects
        .iter()
        .cloned()
        .chain(sensors.map(decided))
        .collect()
}

/// Kinds of chains told.
const TOLD_CHAINS: usize = 20;

/// The chains that a render with `aim` solves for: by objects and labels (T transmits, R reflects)
/// from the light to the sensor, with the number of kinds; nothing with `aim = "off"` and where
/// there are none.
fn chains(loaded: &Loaded) -> String {
    let (scene, settings) = (&loaded.scene, &loaded.settings);
    let aims = aims(settings, scene, 0);
    if settings.aim == Aiming::Off || scene.chains().kinds().is_empty() {
        return String::new();
    }
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    for kind in scene.chains().kinds() {
        *kinds.entry(Chains::name(kind, scene)).or_default() += 1;
    }
    let all: usize = kinds.values().sum();
    let why = if scene.sequences.is_some() {
        "not used: paths are held to sequences of surfaces"
    } else if !aims.any() {
        "not used: the integrator merges, or solves for none unless aim is \"all\""
    } else if settings.aim == Aiming::All {
        "used from every vertex"
    } else {
        "used for what is lit and seen through smooth surfaces, for what disperses, and for lights seen through them"
    };
    let mut text = format!(
        "chains\n  {all} kinds, {} more left out; {why}\n",
        scene.chains().left_out()
    );
    if fans(settings, scene, 0) {
        text += "  all wavelengths go on from matte surfaces and the sky behind dispersion\n";
    }
    for (name, count) in kinds.iter().take(TOLD_CHAINS) {
        _ = writeln!(text, "  {count:>5}  {name}");
    }
    if kinds.len() > TOLD_CHAINS {
        _ = writeln!(text, "  and {} more", kinds.len() - TOLD_CHAINS);
    }
    text
}

/// Casters of caustics; nothing where there are none, or where no light sub-path is traced.
fn casters(loaded: &Loaded) -> String {
    let (casters, integrator) = (&loaded.scene.casters, loaded.settings.integrator);
    if casters.count() == 0 || integrator == IntegratorKind::Path {
        return String::new();
    }
    format!(
        "casters\n  {}: {} of the light sub-paths start toward them, where these are not most of what a light sends\n",
        counted(
            casters.count() as u64,
            "place with mirrors or glass",
            "places with mirrors or glass"
        ),
        percent(casters.share())
    )
}

/// Numbers of objects by kind of shape, detectors left out.
fn shapes(loaded: &Loaded) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for (instance, object) in loaded
        .scene
        .accel
        .instances()
        .iter()
        .zip(&loaded.scene.objects)
    {
        if object.sensor.is_none() {
            *counts.entry(instance.shape.name()).or_default() += 1;
        }
    }
    counts
}

fn triangles(loaded: &Loaded) -> usize {
    let count = |shape: &Shape| match shape {
        Shape::Mesh(mesh) => mesh.triangle_count(),
        Shape::Deforming(mesh) => mesh.triangle_count(),
        _ => 0,
    };
    loaded
        .scene
        .accel
        .instances()
        .iter()
        .map(|i| count(&i.shape))
        .sum()
}

/// Bytes of the XYZ films of the largest sensor, those of the pass in flight included, and what
/// saving image and part takes.
fn films_bytes(loaded: &Loaded) -> (u64, u64) {
    let films = loaded.scene.sensors.iter().map(|s| s.whole_film().pixels());
    let pixels = films.max().unwrap_or(0);
    let films = film_bytes(pixels, &OutputRequest::default());
    (films.saturating_mul(2), saving_bytes(pixels, 0, 3))
}

/// Empty where the shutter is as it is by default.
fn shutter_text(Shutter { open_s, close_s }: Shutter) -> String {
    if (open_s, close_s) == (0.0, 0.0) {
        String::new()
    } else {
        format!(", shutter {open_s}..{close_s} s")
    }
}

/// Shares of the camera sub-paths of a film toward the exit pupil of its lens that come through the
/// lens: in its middle and in its corners.
fn passing_shares(sensor: &Sensor) -> Option<[f64; 2]> {
    match &sensor.camera.as_detector()?.aim {
        Some(Toward::Pupil(pupil)) => Some(pupil.passing_shares()),
        _ => None,
    }
}

fn to_text(loaded: &Loaded) -> String {
    let scene = &loaded.scene;
    let mut text = String::from("sensors\n");
    for sensor in &scene.sensors {
        let size = sensor.camera.resolution();
        _ = writeln!(
            text,
            "  {:<13} {}, {} x {} pixels{}",
            sensor.name,
            sensor.camera.kind.name(),
            size.width,
            size.height,
            shutter_text(sensor.shutter)
        );
        if let Some([middle, corners]) = passing_shares(sensor) {
            _ = writeln!(
                text,
                "  {:<13} {:.0} % of the camera sub-paths toward its exit pupil come through the \
                 lens in the middle, {:.0} % in the corners",
                "",
                100.0 * middle,
                100.0 * corners
            );
        }
    }
    text += "objects\n";
    for (kind, count) in shapes(loaded) {
        let triangles = if kind == "mesh" {
            format!(
                ", {}",
                counted(triangles(loaded) as u64, "triangle", "triangles")
            )
        } else {
            String::new()
        };
        _ = writeln!(text, "  {kind:<13} {count}{triangles}");
    }
    text += "lights\n";
    for (light, name) in scene.lights.iter().zip(&scene.light_names) {
        let hidden = if light.is_delta() {
            ", only light paths can start there"
        } else {
            ""
        };
        _ = writeln!(text, "  {name:<13} {}{hidden}", light.kind.name());
    }
    let moving = scene.moving();
    if !moving.is_empty() {
        text += "motion\n";
    }
    for moving in moving {
        let (kind, name) = scene.name_of(moving);
        _ = write!(text, "  {name:<13} {kind}");
        if let Moving::Object(i) = moving
            && let Shape::Deforming(mesh) = &scene.accel.instances()[i].shape
        {
            _ = write!(
                text,
                ", changes its form ({} trees over the shutter)",
                mesh.segment_count()
            );
        }
        for (i, sensor) in scene.sensors.iter().enumerate() {
            if let Some(way) = scene.motion_blur_px(i, moving) {
                _ = write!(text, ", up to {way:.1} pixels in {}", sensor.name);
            }
        }
        text.push('\n');
    }
    text += &contacts_text(scene);
    text += "media\n";
    for medium in &scene.media {
        let ior = &medium.ior;
        _ = write!(
            text,
            "  {:<13} {}, n_d {}, V_d {}",
            medium.name,
            ior.name(),
            glass::index_d(ior),
            glass::abbe_number(ior)
        );
        let range = ior.fitted_range_nm().map_or_else(String::new, |[a, b]| {
            format!(", fitted over {a:.0}..{b:.0} nm")
        });
        _ = write!(text, "{range}");
        for [a, b] in extrapolated(loaded, ior) {
            _ = write!(text, ", extrapolated over {a:.0}..{b:.0} nm");
        }
        text.push('\n');
    }
    text += &sequences_text(scene);
    text += &summary::effects(&effects(loaded));
    text += &casters(loaded);
    text += &chains(loaded);
    let ((films, saving), meshes) = (films_bytes(loaded), geometry_bytes(scene));
    let images = scene.images();
    _ = writeln!(
        text,
        "memory\n  films         {}\n  saving        {}\n  objects       {}\n  meshes        {}\n  textures      {}, {}",
        bytes_text(films),
        bytes_text(saving),
        bytes_text(object_bytes(scene)),
        bytes_text(meshes),
        bytes_text(texture_bytes(scene)),
        counted(images.len() as u64, "image", "images")
    );
    text
}

/// Most sequences listed in the text.
const MOST_SEQUENCES: usize = 20;

/// Sequences that paths are held to, the first few of them.
fn sequences_text(scene: &Scene) -> String {
    let Some(sequences) = &scene.sequences else {
        return String::new();
    };
    let all = sequences.all();
    let mut text = format!(
        "sequences\n  {}, each with the same share of the samples\n",
        counted(all.len() as u64, "sequence", "sequences")
    );
    for sequence in all.iter().take(MOST_SEQUENCES) {
        _ = writeln!(text, "  {}", sequence.expression());
    }
    if all.len() > MOST_SEQUENCES {
        _ = writeln!(text, "  and {} more", all.len() - MOST_SEQUENCES);
    }
    text
}

/// Pairs of surfaces that touch, the first few of them.
fn contacts_text(scene: &Scene) -> String {
    let pairs: Vec<[&str; 2]> = contacts(scene).collect();
    let mut text = String::new();
    if !pairs.is_empty() {
        text += "contacts\n";
    }
    for [a, b] in pairs.iter().take(MOST_CONTACTS) {
        _ = writeln!(text, "  {a:<13} {b}");
    }
    if pairs.len() > MOST_CONTACTS {
        _ = writeln!(text, "  and {} more", pairs.len() - MOST_CONTACTS);
    }
    text
}

/// Names of the surfaces that are known to touch.
fn contacts(scene: &Scene) -> impl Iterator<Item = [&str; 2]> {
    let certain = scene.contacts.iter().filter(|contact| contact.certain);
    certain.map(|contact| contact.pair.map(|id| scene.object(id).name.as_str()))
}

/// Where the scene's wavelengths leave the data of an index.
fn extrapolated(loaded: &Loaded, ior: &crate::spectrum::Ior) -> Vec<[f64; 2]> {
    ior.validate(loaded.scene.wavelength_settings.range_nm)
        .unwrap_or_default()
}

fn to_json(loaded: &Loaded) -> Value {
    let scene = &loaded.scene;
    let sensors = scene.sensors.iter().map(|sensor| {
        let size = sensor.camera.resolution();
        json!({
            "name": sensor.name,
            "kind": sensor.camera.kind.name(),
            "width": size.width,
            "height": size.height,
            "shutter_s": [sensor.shutter.open_s, sensor.shutter.close_s],
            "pupil_passing": passing_shares(sensor),
        })
    });
    let lights = scene.lights.iter().zip(&scene.light_names).map(|(light, name)| {
        json!({ "name": name, "kind": light.kind.name(), "only_light_paths": light.is_delta() })
    });
    let media = scene.media.iter().map(|medium| {
        let mut value = glass::summary(&medium.ior);
        value["extrapolated_nm"] = json!(extrapolated(loaded, &medium.ior));
        json!({ "name": medium.name, "index": value })
    });
    let motion = scene.moving().into_iter().map(|moving| {
        let (kind, name) = scene.name_of(moving);
        let ways = scene.sensors.iter().enumerate();
        let ways = ways
            .filter_map(|(i, s)| Some((s.name.clone(), json!(scene.motion_blur_px(i, moving)?))));
        json!({ "name": name, "kind": kind, "way_px": Value::Object(ways.collect()) })
    });
    let (films, saving) = films_bytes(loaded);
    json!({
        "scene_hash": format!("{:016x}", scene.hash),
        "sensors": sensors.collect::<Vec<_>>(),
        "objects": shapes(loaded),
        "triangles": triangles(loaded),
        "lights": lights.collect::<Vec<_>>(),
        "motion": motion.collect::<Vec<_>>(),
        "contacts": contacts(scene).collect::<Vec<_>>(),
        "media": media.collect::<Vec<_>>(),
        "casters": json!({ "places": scene.casters.count(), "share": scene.casters.share() }),
        "sequences": scene.sequences.as_ref().map(|sequences| {
            sequences.all().iter().map(|s| s.expression()).collect::<Vec<_>>()
        }),
        "effects": effects(loaded),
        "memory_bytes": {
            "films": films,
            "saving": saving,
            "objects": object_bytes(scene),
            "meshes": geometry_bytes(scene),
            "textures": texture_bytes(scene),
        },
    })
}
