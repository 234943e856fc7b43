//! Checks of prescriptions: what no lens can be is named with its surface before the first ray.

use super::prescription::{Interaction, Prescription, SystemAperture};
use thiserror::Error;

/// Most surfaces of a prescription.
pub const MAX_SURFACES: usize = 1000;

/// Problem of a prescription.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}{message}", place(*surface, *line))]
pub struct PrescriptionError {
    /// The surface, counted from 1; `None`: the system as a whole.
    pub surface: Option<usize>,
    /// Line of the file the surface begins at; 0: none.
    pub line: usize,
    /// Problem, and the values allowed.
    pub message: String,
}

fn place(surface: Option<usize>, line: usize) -> String {
    match (surface, line) {
        (None, _) => String::new(),
        (Some(i), 0) => format!("surface {i}: "),
        (Some(i), line) => format!("line {line}: surface {i}: "),
    }
}

impl Prescription {
    /// Checks that the system can be traced: counts, numbers, apertures within their surfaces,
    /// surfaces that do not cross within their apertures, indices at its wavelengths.
    ///
    /// # Errors
    /// The first thing that is wrong, with its surface.
    pub fn validate(&self) -> Result<(), PrescriptionError> {
        let whole = |message: String| PrescriptionError {
            surface: None,
            line: 0,
            message,
        };
        let count = self.surfaces.len();
        if !(2..=MAX_SURFACES).contains(&count) {
            return Err(whole(format!(
                "{count} surfaces (2 to {MAX_SURFACES}, the image included)"
            )));
        }
        if self.stop + 1 >= count {
            return Err(whole(format!(
                "the stop is surface {} (1 to {})",
                self.stop + 1,
                count - 1
            )));
        }
        if self.wavelengths.is_empty() || self.primary >= self.wavelengths.len() {
            return Err(whole("no primary wavelength".to_owned()));
        }
        if let Some(w) = self
            .wavelengths
            .iter()
            .find(|w| !(w.nm > 0.0 && w.nm.is_finite()))
        {
            return Err(whole(format!("wavelength {} nm (greater than 0)", w.nm)));
        }
        let total: f64 = self.wavelengths.iter().map(|w| w.weight).sum();
        if !(total > 0.0 && total.is_finite()) || self.wavelengths.iter().any(|w| w.weight < 0.0) {
            return Err(whole(
                "weights of wavelengths must be at least 0, not all 0".to_owned(),
            ));
        }
        if self.fields.is_empty() || self.fields.iter().flatten().any(|f| !f.is_finite()) {
            return Err(whole(
                "fields must be finite numbers, at least one".to_owned(),
            ));
        }
        let (what, size) = match self.aperture {
            SystemAperture::EntrancePupil(d) => ("entrance pupil diameter", d),
            SystemAperture::FNumber(f) => ("f-number", f),
            SystemAperture::ObjectNa(na) => ("numerical aperture", na),
            SystemAperture::StopSize => ("stop", 1.0),
        };
        if !(size > 0.0 && size.is_finite()) {
            return Err(whole(format!("{what} {size} (greater than 0)")));
        }
        if matches!(self.aperture, SystemAperture::ObjectNa(_)) && self.object_distance.is_none() {
            return Err(whole(
                "a numerical aperture of the object needs an object at a finite distance"
                    .to_owned(),
            ));
        }
        if matches!(self.aperture, SystemAperture::StopSize)
            && self.surfaces[self.stop].shape.aperture.radius().is_none()
        {
            return Err(whole(format!(
                "the beam is as wide as the stop, and surface {} has no semi-diameter",
                self.stop + 1
            )));
        }
        if self
            .object_distance
            .is_some_and(|d| !(d.is_finite() && d != 0.0))
        {
            return Err(whole(
                "the distance of the object must be finite and not 0".to_owned(),
            ));
        }
        for i in 0..count {
            self.check_surface(i)?;
        }
        for i in 0..count - 1 {
            self.check_gap(i)?;
        }
        Ok(())
    }

    fn error_at(&self, i: usize, message: String) -> PrescriptionError {
        PrescriptionError {
            surface: Some(i + 1),
            line: self.surfaces[i].line,
            message,
        }
    }

    fn check_surface(&self, i: usize) -> Result<(), PrescriptionError> {
        let surface = &self.surfaces[i];
        let bad = |message: String| Err(self.error_at(i, message));
        let shape = &surface.shape;
        if !shape.profile.is_finite() {
            return bad(
                "radius, conic constant and coefficients must be finite numbers".to_owned(),
            );
        }
        if !shape.aperture.is_valid() {
            return bad("an aperture needs finite sizes greater than 0".to_owned());
        }
        if !surface.thickness.is_finite() {
            return bad(format!("thickness {} (a finite number)", surface.thickness));
        }
        let breaks = surface.before.iter().chain(&surface.after);
        if breaks
            .into_iter()
            .any(|b| !(b.decenter.is_finite() && b.tilt_deg.is_finite() && b.thickness.is_finite()))
        {
            return bad("decenters and tilts must be finite numbers".to_owned());
        }
        let (extent, domain) = (shape.aperture.extent(), shape.profile.domain_radius());
        if extent.is_finite() && extent > domain {
            return bad(format!(
                "the aperture reaches {extent} mm from the vertex, the surface only {domain:.6} mm"
            ));
        }
        for wavelength in &self.wavelengths {
            let ior = &surface.medium.ior;
            if let Err(error) = ior.validate([wavelength.nm; 2]) {
                return bad(error.to_string());
            }
        }
        Ok(())
    }

    /// Surface `i` and the next one must not cross where both have an aperture.
    fn check_gap(&self, i: usize) -> Result<(), PrescriptionError> {
        let (one, two) = (&self.surfaces[i], &self.surfaces[i + 1]);
        let acts = |i: usize| {
            let s = &self.surfaces[i];
            s.interaction == Interaction::Reflect || self.medium_before(i).ior != s.medium.ior
        };
        let straight = one.after.is_empty() && two.before.is_empty();
        if !straight || !acts(i) || !acts(i + 1) || i + 2 == self.surfaces.len() {
            return Ok(());
        }
        let mirrors = self.surfaces[..=i]
            .iter()
            .filter(|s| s.interaction == Interaction::Reflect)
            .count();
        let sense = if mirrors % 2 == 0 { 1.0 } else { -1.0 };
        let reach = one.shape.aperture.extent().min(two.shape.aperture.extent());
        // without apertures only the vertices are known
        let reach = if reach.is_finite() { reach } else { 0.0 };
        let rings = 64;
        for ring in 0..=rings {
            let r = reach * f64::from(ring) / f64::from(rings);
            for direction in 0..8 {
                let angle = f64::from(direction) * std::f64::consts::FRAC_PI_4;
                let (x, y) = (r * angle.cos(), r * angle.sin());
                let gap = one.thickness + two.shape.profile.sag(x, y) - one.shape.profile.sag(x, y);
                if gap * sense < -1e-9 {
                    return Err(self.error_at(
                        i,
                        format!("crosses surface {}: at {r:.4} mm from the axis the next surface lies {:.6} mm before it", i + 2, gap.abs()),
                    ));
                }
            }
        }
        Ok(())
    }
}
