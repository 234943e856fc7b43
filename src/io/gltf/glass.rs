//! Glass in glTF files: by name, or from index and dispersion; where it fills a mesh, and what it
//! absorbs.

use super::material::finite;
use super::{Fault, Reader};
use crate::medium::{Medium, absorption_of};
use crate::spectrum::{Ior, Library, upsample};
use gltf::json::Extras;
use gltf::json::material::Material as Source;

/// Range in which a Cauchy formula is taken to hold.
const RANGE_NM: [f64; 2] = [100.0, 20_000.0];

/// Whether the material fills the inside of a closed mesh: it transmits and has a thickness, or
/// says nothing of one, as Blender writes glass.
pub fn has_volume(source: &Source) -> bool {
    let extensions = source.extensions.as_ref();
    let transmits = extensions
        .and_then(|e| e.transmission.as_ref())
        .is_some_and(|t| t.transmission_factor.0 > 0.0);
    let volume = extensions.and_then(|e| e.volume.as_ref());
    transmits && volume.is_none_or(|v| v.thickness_factor.0 > 0.0)
}

/// The glass that extras name.
fn named_glass(extras: &Extras) -> Option<serde_json::Value> {
    let extras: serde_json::Value = serde_json::from_str(extras.as_ref()?.get()).ok()?;
    extras.get("glass").cloned()
}

impl Reader<'_> {
    /// Says that a glass stands where none is read.
    pub fn misplaced_glass(&mut self, extras: &Extras, what: &str) {
        if named_glass(extras).is_some() {
            self.note(format!(
                "{what}: extras.glass is ignored (it is read from materials that transmit)"
            ));
        }
    }

    /// The glass: a real one by name, else the file's index with the dispersion it gives.
    pub fn glass(&mut self, source: &Source, name: &str, index: f64) -> Result<Ior, Fault> {
        if let Some(glass) = named_glass(&source.extras) {
            let glass = glass.as_str().ok_or_else(|| {
                Fault::new(format!("material \"{name}\", extras.glass is no text"))
            })?;
            return Library::embedded()
                .ior(glass)
                .map_err(|e| Fault::new(format!("material \"{name}\", extras.glass: {e}")));
        }
        let dispersion = source
            .extensions
            .as_ref()
            .and_then(|e| {
                e.others
                    .get("KHR_materials_dispersion")?
                    .get("dispersion")?
                    .as_f64()
            })
            .unwrap_or(0.0);
        if dispersion <= 0.0 || index == 1.0 {
            return Ok(Ior::constant(index));
        }
        let abbe = 20.0 / dispersion;
        let coefficients = cauchy(index, abbe);
        // the file's own digits
        let shown = index as f32;
        self.note(format!(
            "material \"{name}\": a Cauchy glass with n_d {shown} and V_d {abbe:.1}, all that the file gives (extras.glass names a real one)"
        ));
        let ior = Ior::formula(5, vec![coefficients[0], coefficients[1], -2.0], RANGE_NM)
            .map_err(|e| Fault::new(format!("material \"{name}\": {e}")))?;
        ior.validate([360.0, 830.0])
            .map_err(|e| Fault::new(format!("material \"{name}\": {e}")))?;
        Ok(ior.named(format!("n_d {shown}, V_d {abbe:.1}"), "the model"))
    }

    pub fn interior(&mut self, source: &Source, name: &str, ior: Ior) -> Result<Medium, Fault> {
        let mut absorption = None;
        if let Some(volume) = source.extensions.as_ref().and_then(|e| e.volume.as_ref()) {
            let distance = f64::from(volume.attenuation_distance.0);
            let color = volume.attenuation_color.0;
            for value in color {
                finite(value, "attenuationColor")?;
            }
            if distance.is_finite() && distance > 0.0 && color != [1.0; 3] {
                let transmittance = upsample::reflectance(color.map(f64::from));
                absorption = Some(absorption_of(&transmittance, distance, [360.0, 830.0]));
            }
        }
        Ok(Medium {
            name: name.to_owned(),
            ior,
            absorption,
            use_k: true,
        })
    }
}

/// n = A + B/λ² (µm) with index `n_d` at 587.56 nm and Abbe number `v_d`.
fn cauchy(n_d: f64, v_d: f64) -> [f64; 2] {
    const D: f64 = 0.587_561_8;
    const F: f64 = 0.486_132_7;
    const C: f64 = 0.656_272_5;
    let b = (n_d - 1.0) / v_d / (F.powi(-2) - C.powi(-2));
    [n_d - b * D.powi(-2), b]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cauchy_has_the_index_and_abbe_number_asked_for() {
        let [a, b] = cauchy(1.6, 30.0);
        let n = |um: f64| a + b / (um * um);
        assert!((n(0.587_561_8) - 1.6).abs() < 1e-12);
        let v = (n(0.587_561_8) - 1.0) / (n(0.486_132_7) - n(0.656_272_5));
        assert!((v - 30.0).abs() < 1e-9);
    }
}
