//! Films behind lenses: detectors whose place follows from the lens and from what is to be sharp.

use super::keys::{Build, FINITE, POSITIVE, Table, keys};
use super::lens::PlacedLens;
use super::reader::Reader;
use super::value::{At, Length, Name};
use crate::camera::detector::Toward;
use crate::camera::{Camera, Resolution};
use crate::geometry::{Shutter, Transform};
use crate::optics::paraxial::Paraxial;
use crate::optics::{ExitPupil, Interaction};
use crate::spectrum::ior::{LINE_C_NM, LINE_D_NM, LINE_F_NM};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::Arc;

/// Metres per millimeter.
const MM: f64 = 1e-3;

keys! {
    /// A film behind a lens of the scene, whose picture is seen upright and the right way round. It
    /// stands on the axis, at right angles to it, where paraxial rays of 587.56 nm bring the plane
    /// at `focus_distance` into focus, and moves with the lens. Most of its camera sub-paths go to
    /// the exit pupil of each place.
    FilmKeys = "film" {
        /// Name of the lens.
        lens: At<Name>;
        /// Width.
        width: Length, in POSITIVE;
        /// Height.
        height: Length, in POSITIVE;
        /// Distance along the axis from the first surface of the lens to the plane that is sharp.
        focus_distance: Option<Length>, in POSITIVE, or "infinity";
        /// How far its middle lies from the axis, to the right and up in the picture.
        shift: [f64; 2], in FINITE, unit "length", default [0.0, 0.0];
        /// How much farther from the lens it stands than in the paraxial focus.
        defocus: Length, in FINITE, default Length(0.0);
    }
}

/// A film that looks for its lens.
#[derive(Debug)]
pub struct Film {
    pub lens: At<String>,
    width_m: f64,
    height_m: f64,
    shift_m: DVec2,
    focus_m: Option<f64>,
    defocus_m: f64,
}

impl Build for FilmKeys {
    type Output = Film;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Film> {
        table.sound(cx)?;
        Some(Film {
            lens: At {
                value: self.lens.value.0,
                at: self.lens.at,
            },
            width_m: self.width.0,
            height_m: self.height.0,
            shift_m: DVec2::from_array(self.shift) * cx.unit_m,
            focus_m: self.focus_distance.map(|distance| distance.0),
            defocus_m: self.defocus.0,
        })
    }
}

impl Film {
    /// Stands in for the camera until the lens is known.
    pub fn unplaced(&self, resolution: Resolution) -> Camera {
        let (width, height) = (self.width_m, self.height_m);
        Camera::detector(DAffine3::IDENTITY, width, height, resolution, false)
    }

    /// The camera behind its lens.
    ///
    /// # Errors
    /// Why there is none, and what is allowed.
    pub fn camera(
        &self,
        resolution: Resolution,
        lens: &PlacedLens,
        shutter: Shutter,
    ) -> Result<Camera, String> {
        let prescription = &lens.prescription;
        let last = prescription.last();
        let mut surfaces = prescription.surfaces.iter();
        if surfaces.any(|s| s.interaction == Interaction::Reflect) {
            return Err(
                "its lens has mirrors (allowed: a lens without; a detector stands \
                        anywhere)"
                    .to_owned(),
            );
        }
        let to_world = lens.to_world;
        let scale = to_world.matrix3.determinant().cbrt();
        let rotation = to_world.matrix3 * (1.0 / scale);
        let off = rotation.transpose() * rotation - DMat3::IDENTITY;
        let is_similar = off.to_cols_array().into_iter().all(|v| v.abs() < 1e-9);
        if scale <= 0.0 || !is_similar {
            return Err(
                "its lens is stretched or mirrored (allowed: moved, turned, and scaled \
                        by one factor)"
                    .to_owned(),
            );
        }
        // millimeters of the lens
        let per_m = 1.0 / (scale * MM);
        let paraxial = Paraxial::new(prescription, LINE_D_NM);
        let focus = self.focus_m.map(|distance| distance * per_m);
        let Some(image) = paraxial.image_of(focus) else {
            return Err(format!(
                "no real image of that plane behind the lens (allowed: a focus_distance above \
                 {} mm in front of the lens)",
                (-paraxial.first_order().ffl).max(0.0)
            ));
        };
        let image = image + self.defocus_m * per_m;
        let corner = self.shift_m.abs() + 0.5 * DVec2::new(self.width_m, self.height_m);
        let reach = corner.length() * per_m;
        // beyond both ends of these lines the mask's border is for the rest of the samples
        let lines = [LINE_F_NM, LINE_C_NM];
        let Some(pupil) = ExitPupil::new(prescription, image, reach, &lines) else {
            return Err(
                "it stands before the rear surface of its lens, or that has no edge".to_owned(),
            );
        };
        let frame = prescription.frames()[last + 1];
        let thickness = prescription.surfaces[last].thickness;
        let axis = frame.to_system(DVec3::new(0.0, 0.0, image - thickness));
        // upright, on the side of the lens; its columns run against u
        let axes = DMat3::from_cols(DVec3::X, -DVec3::Y, -DVec3::Z);
        let axes = rotation * frame.rotation * axes;
        let shift = DVec2::new(-self.shift_m.x, self.shift_m.y);
        let center = to_world.transform_point3(axis * MM) + axes * shift.extend(0.0);
        let pose = DAffine3::from_mat3_translation(axes, center);
        let camera = Camera::detector(pose, self.width_m, self.height_m, resolution, false);
        let pupil = pupil.scaled(scale * MM).shifted(shift);
        let pupil = Toward::Pupil(Arc::new(pupil));
        let camera = camera.flipped().aimed(pupil);
        Ok(if lens.motion.is_empty() {
            camera
        } else {
            let at_rest: Transform = camera.transform().clone();
            camera.at(at_rest.under(&lens.motion, shutter))
        })
    }
}
