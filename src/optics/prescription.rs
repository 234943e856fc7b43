//! Prescriptions of lens systems: a table of surfaces with media between them, a stop, fields and
//! wavelengths.

use super::aperture::Aperture;
use super::coating::Stack;
use super::profile::Profile;
use super::surface::LensSurface;
use super::trace::Passage;
use crate::spectrum::Ior;
use crate::spectrum::ior::{LINE_C_NM, LINE_D_NM, LINE_F_NM};
use glam::{DMat3, DVec3};

/// Medium between two surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// Refractive index, with the qualified name of the glass.
    pub ior: Ior,
}

impl Medium {
    /// Air: index 1, what catalog indices are relative to.
    #[must_use]
    pub fn air() -> Self {
        Self {
            ior: Ior::constant(1.0).named("air", ""),
        }
    }

    /// A glass.
    #[must_use]
    pub fn new(ior: Ior) -> Self {
        Self { ior }
    }

    /// Whether it is air.
    #[must_use]
    pub fn is_air(&self) -> bool {
        self.ior.name() == "air"
    }
}

/// Role of a surface: refraction or reflection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interaction {
    /// The ray goes on into the next medium.
    Refract,
    /// The ray is reflected; the medium stays.
    Reflect,
}

/// A change of the coordinates between surfaces: decenter and tilt, then a step along the new z.
///
/// Tilts are right-handed. In order: decenter along x and y, tilt about x, about the new y, about
/// the new z; `reversed`: tilt about z, y, x, then decenter along the new axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Break {
    /// Decenter, millimeters.
    pub decenter: DVec3,
    /// Tilt about x, y and z, degrees.
    pub tilt_deg: DVec3,
    /// Tilts before decenters.
    pub reversed: bool,
    /// Step along z afterwards, millimeters.
    pub thickness: f64,
}

impl Break {
    /// The frame after the break, seen from the frame before it.
    #[must_use]
    pub fn frame(&self) -> Frame {
        let [x, y, z] = self.tilt_deg.to_array().map(f64::to_radians);
        let axes = [
            DMat3::from_rotation_x(x),
            DMat3::from_rotation_y(y),
            DMat3::from_rotation_z(z),
        ];
        let (rotation, origin) = if self.reversed {
            let rotation = axes[2] * axes[1] * axes[0];
            (rotation, rotation * self.decenter)
        } else {
            (axes[0] * axes[1] * axes[2], self.decenter)
        };
        let step = rotation * DVec3::new(0.0, 0.0, self.thickness);
        Frame {
            rotation,
            origin: origin + step,
        }
    }

    /// The break that undoes this one without its step.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            decenter: -self.decenter,
            tilt_deg: -self.tilt_deg,
            reversed: !self.reversed,
            thickness: 0.0,
        }
    }
}

/// A position and an orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Takes local directions to those of the system.
    pub rotation: DMat3,
    /// The local origin in the system.
    pub origin: DVec3,
}

impl Frame {
    /// The frame of the system itself.
    pub const SYSTEM: Self = Self {
        rotation: DMat3::IDENTITY,
        origin: DVec3::ZERO,
    };

    /// A frame given within this one, seen from the system.
    #[must_use]
    pub fn then(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            origin: self.to_system(inner.origin),
        }
    }

    /// A step along local z.
    #[must_use]
    pub fn advanced(&self, thickness: f64) -> Self {
        Self {
            origin: self.to_system(DVec3::new(0.0, 0.0, thickness)),
            ..*self
        }
    }

    /// A local point in the system.
    #[must_use]
    pub fn to_system(&self, local: DVec3) -> DVec3 {
        self.origin + self.rotation * local
    }

    /// A point of the system in the frame.
    #[must_use]
    pub fn to_local(&self, point: DVec3) -> DVec3 {
        self.rotation.transpose() * (point - self.origin)
    }
}

/// One surface, and what follows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Remark of the file.
    pub comment: String,
    /// Shape and clear aperture.
    pub shape: LensSurface,
    /// Distance to the next surface along the axis, millimeters; negative after an odd number of
    /// mirrors.
    pub thickness: f64,
    /// The medium after it (before it, for a mirror too).
    pub medium: Medium,
    /// Role: refraction or reflection.
    pub interaction: Interaction,
    /// Coating, from the side light comes from; `None`: bare.
    pub coating: Option<Stack>,
    /// Changes of coordinates before it.
    pub before: Vec<Break>,
    /// Changes of coordinates after it, before the thickness.
    pub after: Vec<Break>,
    /// Line of the file it begins at, 0 if it is from none.
    pub line: usize,
}

impl Surface {
    /// A surface into a medium.
    #[must_use]
    pub fn new(profile: Profile, aperture: Aperture, thickness: f64, medium: Medium) -> Self {
        Self {
            comment: String::new(),
            shape: LensSurface::new(profile, aperture),
            thickness,
            medium,
            interaction: Interaction::Refract,
            coating: None,
            before: Vec::new(),
            after: Vec::new(),
            line: 0,
        }
    }
}

/// One wavelength a system is judged at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wavelength {
    /// Nanometers.
    pub nm: f64,
    /// Weight among the others.
    pub weight: f64,
}

/// How wide the beam is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SystemAperture {
    /// Diameter of the entrance pupil, millimeters.
    EntrancePupil(f64),
    /// Focal length over entrance pupil diameter.
    FNumber(f64),
    /// Numerical aperture in object space.
    ObjectNa(f64),
    /// Aperture of the system: what the stop lets through.
    StopSize,
}

/// Kind of the field values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// Degrees in object space.
    AngleDeg,
    /// Height of the object, millimeters.
    ObjectHeight,
    /// Paraxial height of the image, millimeters.
    ImageHeight,
}

/// A lens system. The last surface is the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Prescription {
    /// Title.
    pub name: String,
    /// Decisions of the reader: model glasses, things passed over.
    pub notes: Vec<String>,
    /// Wavelengths, at least one.
    pub wavelengths: Vec<Wavelength>,
    /// Index of the wavelength that pupils and distances are given for.
    pub primary: usize,
    /// How wide the beam is.
    pub aperture: SystemAperture,
    /// Kind of the field values.
    pub field_kind: FieldKind,
    /// Fields, x and y.
    pub fields: Vec<[f64; 2]>,
    /// Distance of the object before the first surface; `None`: at infinity.
    pub object_distance: Option<f64>,
    /// Medium of the object.
    pub object_medium: Medium,
    /// The surfaces; the last is the image.
    pub surfaces: Vec<Surface>,
    /// Index of the stop among them.
    pub stop: usize,
}

impl Prescription {
    /// F, d and C, d the primary.
    #[must_use]
    pub fn default_wavelengths() -> Vec<Wavelength> {
        [LINE_F_NM, LINE_D_NM, LINE_C_NM]
            .map(|nm| Wavelength { nm, weight: 1.0 })
            .to_vec()
    }

    /// The wavelength that pupils and distances are given for, nanometers.
    #[must_use]
    pub fn primary_nm(&self) -> f64 {
        self.wavelengths[self.primary].nm
    }

    /// The frame of each surface; the system is the frame the first is placed in.
    #[must_use]
    pub fn frames(&self) -> Vec<Frame> {
        let mut at = Frame::SYSTEM;
        let mut out = Vec::with_capacity(self.surfaces.len());
        for surface in &self.surfaces {
            for step in &surface.before {
                at = at.then(&step.frame());
            }
            out.push(at);
            for step in &surface.after {
                at = at.then(&step.frame());
            }
            at = at.advanced(surface.thickness);
        }
        out
    }

    /// Medium before surface `i`.
    #[must_use]
    pub fn medium_before(&self, i: usize) -> &Medium {
        match i {
            0 => &self.object_medium,
            i => &self.surfaces[i - 1].medium,
        }
    }

    /// The medium on the side of a surface that light of a passage comes from.
    #[must_use]
    pub fn in_front(&self, passage: &Passage) -> &Medium {
        let i = passage.surface;
        if passage.backward {
            &self.surfaces[i].medium
        } else {
            self.medium_before(i)
        }
    }

    /// The medium on the other side.
    #[must_use]
    pub fn behind(&self, passage: &Passage) -> &Medium {
        let i = passage.surface;
        if passage.backward {
            self.medium_before(i)
        } else {
            &self.surfaces[i].medium
        }
    }

    /// Distance along the axis from surface `i` to the next, steps of breaks included.
    #[must_use]
    pub fn axial_distance(&self, i: usize) -> f64 {
        let steps = |list: &[Break]| list.iter().map(|b| b.thickness).sum::<f64>();
        let next = self.surfaces.get(i + 1).map_or(0.0, |s| steps(&s.before));
        self.surfaces[i].thickness + steps(&self.surfaces[i].after) + next
    }

    /// Index of the last surface before the image.
    #[must_use]
    pub fn last(&self) -> usize {
        self.surfaces.len() - 2
    }

    /// Gives `coating` to every surface between air and glass; mirrors keep theirs. A stack is
    /// given as light comes from air.
    pub fn coat(&mut self, coating: &Stack) {
        for i in 0..self.surfaces.len() {
            let enters = self.medium_before(i).is_air();
            let leaves = self.surfaces[i].medium.is_air();
            if self.surfaces[i].interaction == Interaction::Refract && enters != leaves {
                let stack = if enters {
                    coating.clone()
                } else {
                    coating.reversed()
                };
                self.surfaces[i].coating = Some(stack);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_break_and_its_inverse_are_nothing() {
        let there = Break {
            decenter: DVec3::new(1.0, -2.0, 0.5),
            tilt_deg: DVec3::new(10.0, -20.0, 30.0),
            reversed: false,
            thickness: 0.0,
        };
        let back = there.frame().then(&there.inverse().frame());
        assert!(back.origin.length() < 1e-15);
        assert!((back.rotation - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, 1e-15));
    }

    #[test]
    fn a_break_is_one_per_axis_in_turn() {
        let (decenter, tilt) = (DVec3::new(1.0, -2.0, 0.0), DVec3::new(10.0, -20.0, 30.0));
        let at = |decenter, tilt_deg, reversed| {
            let thickness = 0.0;
            Break {
                decenter,
                tilt_deg,
                reversed,
                thickness,
            }
            .frame()
        };
        let one = |axis: DVec3| at(DVec3::ZERO, axis * tilt, false);
        let chain = at(decenter, DVec3::ZERO, false)
            .then(&one(DVec3::X))
            .then(&one(DVec3::Y))
            .then(&one(DVec3::Z));
        let whole = at(decenter, tilt, false);
        assert!((chain.origin - whole.origin).length() < 1e-15);
        assert!((chain.rotation - whole.rotation).abs_diff_eq(DMat3::ZERO, 1e-15));
        let chain = one(DVec3::Z)
            .then(&one(DVec3::Y))
            .then(&one(DVec3::X))
            .then(&at(decenter, DVec3::ZERO, false));
        let whole = at(decenter, tilt, true);
        assert!((chain.origin - whole.origin).length() < 1e-15);
        assert!((chain.rotation - whole.rotation).abs_diff_eq(DMat3::ZERO, 1e-15));
    }

    #[test]
    fn tilts_are_right_handed() {
        let tilt = Break {
            decenter: DVec3::ZERO,
            tilt_deg: DVec3::new(90.0, 0.0, 0.0),
            reversed: false,
            thickness: 2.0,
        };
        // y turns to z, z to -y
        assert!((tilt.frame().origin - DVec3::new(0.0, -2.0, 0.0)).length() < 1e-15);
    }
}
