//! Tables of directional albedo for the rough surfaces of a scene.

use super::description::{SceneDescription, WavelengthChoice, WavelengthSettings};
use crate::bsdf::albedo::{AlbedoTables, Needs};
use crate::medium::{Boundary, Medium, MediumId};

/// Wavelengths at which the range of a relative index is looked for.
const STEPS: u32 = 64;

/// Tables for the materials of a scene and the media that meet at its rough interfaces; empty where
/// nothing is rough.
pub(super) fn albedo_tables(scene: &SceneDescription) -> AlbedoTables {
    let mut needs = Needs::default();
    // whichever media a solid may lie in
    let mut around = vec![scene.ambient];
    let mut rough: Vec<MediumId> = Vec::new();
    for object in &scene.objects {
        let named = match object.boundary {
            Boundary::None => continue,
            Boundary::Solid { medium, .. } => vec![medium],
            Boundary::Interface { above, below } => vec![above, below],
        };
        around.extend(&named);
        if scene.materials[object.material.0 as usize].add_needs(&mut Needs::default()) {
            rough.extend(named);
        }
    }
    for material in &scene.materials {
        material.add_needs(&mut needs);
    }
    for list in [&mut around, &mut rough] {
        list.sort_by_key(|id| id.0);
        list.dedup();
    }
    let medium = |id: MediumId| &scene.media[id.0 as usize];
    let nm = wavelengths_nm(&scene.wavelengths);
    for &a in &rough {
        for &b in around.iter().filter(|b| **b != a) {
            needs
                .ratios
                .extend(range_of_ratio(medium(a), medium(b), &nm));
        }
    }
    AlbedoTables::new(&needs)
}

fn wavelengths_nm(settings: &WavelengthSettings) -> Vec<f64> {
    match &settings.choice {
        WavelengthChoice::Lines(lines) => lines.clone(),
        _ => {
            let [low, high] = settings.range_nm;
            (0..=STEPS)
                .map(|i| low + (high - low) * f64::from(i) / f64::from(STEPS))
                .collect()
        }
    }
}

/// The range of the larger index over the smaller one.
fn range_of_ratio(a: &Medium, b: &Medium, nm: &[f64]) -> Option<[f64; 2]> {
    let ratios = nm.iter().map(|&nm| {
        let (a, b) = (a.ior.n(nm), b.ior.n(nm));
        [a.max(b) / a.min(b); 2]
    });
    ratios.reduce(|range, ratio| [range[0].min(ratio[0]), range[1].max(ratio[1])])
}
