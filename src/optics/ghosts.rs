//! Ghosts of a lens system: the light that two surfaces reflect on its way to the image, by real
//! rays with Fresnel's and the coatings' losses.

use super::analysis::{Beams, kept, pupil_rings};
use super::prescription::{Interaction, Prescription};
use super::trace::{Passage, System};
use glam::DVec2;
use std::fmt::Write;

/// Light of one field and wavelength that is reflected twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ghost {
    /// Surfaces that reflect, by index, in the order of the light: the first lies behind the
    /// second.
    pub surfaces: [usize; 2],
    /// Power at the image over the power of the rays that fill the stop, before the first surface.
    pub power: f64,
    /// Share of these rays that reach the image.
    pub rays: f64,
    /// Centroid at the image, millimeters, by power.
    pub centroid: DVec2,
    /// Root mean square radius about it, millimeters, by power.
    pub rms: f64,
}

/// Way of the light that surface `first` reflects, then `second` before it.
#[must_use]
pub fn route(prescription: &Prescription, [first, second]: [usize; 2]) -> Vec<Passage> {
    let passage = |surface: usize, backward: bool| Passage {
        surface,
        backward,
        reflects: prescription.surfaces[surface].interaction == Interaction::Reflect,
    };
    let reflected = |surface: usize, backward: bool| Passage {
        reflects: true,
        ..passage(surface, backward)
    };
    let there = (0..first).map(|i| passage(i, false));
    let back = (second + 1..first).rev().map(|i| passage(i, true));
    let again = (second + 1..prescription.surfaces.len()).map(|i| passage(i, false));
    there
        .chain([reflected(first, false)])
        .chain(back)
        .chain([reflected(second, true)])
        .chain(again)
        .collect()
}

/// The way of a ghost as the sequence of surfaces that a render is held to, and as the expression
/// over path classes that chooses it: `L T(1) R(2) R(1) T(2) E`, surfaces counted from 1. Those
/// that light passes as if they were not there are left out.
#[must_use]
pub fn expression(prescription: &Prescription, pair: [usize; 2]) -> String {
    let mut text = "L".to_owned();
    for passage in route(prescription, pair) {
        let i = passage.surface;
        let surface = &prescription.surfaces[i];
        let is_mirror = surface.interaction == Interaction::Reflect;
        let bends = prescription.medium_before(i).ior != surface.medium.ior;
        if i <= prescription.last() && (is_mirror || bends) {
            let letter = if passage.reflects { 'R' } else { 'T' };
            _ = write!(text, " {letter}({})", i + 1);
        }
    }
    text + " E"
}

/// All ghosts of two reflections of a field, the most powerful first; the rays are those of
/// [`Beams::spot`] with so many rings. Mirrors reflect as they do on the way of the image; ghosts
/// that no ray reaches the image by are left out.
#[must_use]
pub fn ghosts(
    prescription: &Prescription,
    lambda_nm: f64,
    field: [f64; 2],
    rings: u32,
) -> Vec<Ghost> {
    let beams = Beams::new(prescription, lambda_nm);
    let shares = pupil_rings(rings);
    let rays: Vec<_> = shares
        .iter()
        .filter_map(|&share| beams.aimed(field, share))
        .collect();
    let n = beams.system.indices();
    let reflects = |i: &usize| {
        let surface = &prescription.surfaces[*i];
        surface.interaction == Interaction::Refract
            && (n[*i] != n[i + 1] || surface.coating.is_some())
    };
    let surfaces: Vec<usize> = (0..=prescription.last()).filter(reflects).collect();
    let pairs = surfaces
        .iter()
        .enumerate()
        .flat_map(|(k, &first)| surfaces[..k].iter().map(move |&second| [first, second]));
    let one = |pair: [usize; 2]| {
        let system = System::along(prescription, lambda_nm, route(prescription, pair));
        let image = system.route().len() - 1;
        let points: Vec<(f64, DVec2)> = rays
            .iter()
            .filter_map(|&ray| {
                // where surfaces cross beyond their apertures, a line may meet the next one behind
                let mut goes_on = true;
                _ = system.trace(ray, true, |e| {
                    goes_on &= e.surface == 0 || e.surface == image || e.distance >= 0.0;
                });
                let (kept, end) = kept(prescription, &system, lambda_nm, ray).ok()?;
                goes_on.then(|| (kept.surfaces * kept.media, end.o.truncate()))
            })
            .collect();
        let power: f64 = points.iter().map(|p| p.0).sum();
        let centroid = points.iter().map(|p| p.0 * p.1).sum::<DVec2>() / power;
        let off = |p: &(f64, DVec2)| p.0 * p.1.distance_squared(centroid);
        let square = points.iter().map(off).sum::<f64>() / power;
        (power > 0.0).then(|| Ghost {
            surfaces: pair,
            power: power / shares.len() as f64,
            rays: points.len() as f64 / shares.len() as f64,
            centroid,
            rms: square.sqrt(),
        })
    };
    let mut all: Vec<Ghost> = pairs.filter_map(one).collect();
    all.sort_by(|a, b| b.power.total_cmp(&a.power));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::coating::interface;
    use crate::optics::{Aperture, FieldKind, Medium, Profile, Surface, SystemAperture};
    use crate::spectrum::Ior;

    const NM: f64 = 550.0;

    /// A slab of index 1.8 in air, `gap` mm before the image.
    fn slab() -> Prescription {
        let glass = Medium::new(Ior::constant(1.8).named("1.8", ""));
        let flat = |thickness, medium| {
            Surface::new(Profile::PLANE, Aperture::circle(10.0), thickness, medium)
        };
        Prescription {
            name: String::new(),
            notes: Vec::new(),
            wavelengths: Prescription::default_wavelengths(),
            primary: 1,
            aperture: SystemAperture::EntrancePupil(4.0),
            field_kind: FieldKind::AngleDeg,
            fields: vec![[0.0; 2]],
            object_distance: None,
            object_medium: Medium::air(),
            surfaces: vec![
                flat(3.0, glass),
                flat(20.0, Medium::air()),
                flat(0.0, Medium::air()),
            ],
            stop: 0,
        }
    }

    /// The one ghost of a slab: R² T² of the power, displaced by twice the slab's own displacement
    /// 2 t tan θ' more than the direct light.
    #[test]
    fn slab_has_one_ghost() {
        let lens = slab();
        let degrees = 12.0;
        let all = ghosts(&lens, NM, [0.0, degrees], 4);
        assert_eq!(all.len(), 1);
        let ghost = all[0];
        assert_eq!(ghost.surfaces, [1, 0]);
        assert_eq!(expression(&lens, ghost.surfaces), "L T(1) R(2) R(1) T(2) E");
        assert!(ghost.rays == 1.0);
        let sin = degrees.to_radians().sin();
        let (cos, cos_inside) = ((1.0 - sin * sin).sqrt(), (1.0 - (sin / 1.8).powi(2)).sqrt());
        let outside = interface(None, NM, 1.0, 1.8, cos);
        let inside = interface(None, NM, 1.8, 1.0, cos_inside);
        let power = outside.t * inside.r * inside.r * inside.t;
        assert!(
            (ghost.power / power - 1.0).abs() < 1e-12,
            "{ghost:?} {power}"
        );
        let beams = Beams::new(&lens, NM);
        let direct = beams.spot([0.0, degrees], 4).measure(0.0);
        let displaced = 2.0 * 3.0 * (sin / 1.8) / cos_inside;
        let displaced = displaced.copysign(direct.0.y);
        let off = ghost.centroid - direct.0 - DVec2::new(0.0, displaced);
        assert!(off.length() < 1e-12, "{ghost:?} {direct:?}");
        assert!((ghost.rms - direct.1).abs() < 1e-12);
    }
}
