//! Paraxial rays and the data of first order.
//!
//! Refraction n' u' = n u - y c (n' - n), transfer y' = y + t u; a mirror is a refraction into -n
//! (Welford, Aberrations of Optical Systems, 1986, chapter 3). Tilts and decenters are left out:
//! this is the system along its own axis.

use super::prescription::{FieldKind, Interaction, Prescription, SystemAperture};

/// A paraxial ray at a surface: height, and slope times index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParaxialRay {
    /// Height, millimeters.
    pub y: f64,
    /// Signed index times slope.
    pub nu: f64,
}

/// A pupil on the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pupil {
    /// Position along z: of the entrance pupil from the first surface, of the exit pupil from the
    /// last one before the image.
    pub position: f64,
    /// Diameter, millimeters.
    pub diameter: f64,
}

/// Data of first order at one wavelength. Lengths in millimeters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrder {
    /// The wavelength, nanometers.
    pub lambda_nm: f64,
    /// Effective focal length: one over the power of the system.
    pub efl: f64,
    /// Back focal distance from the last surface before the image, along z.
    pub bfl: f64,
    /// Front focal point from the first surface, along z.
    pub ffl: f64,
    /// Front and rear principal plane, from the first and from the last surface before the image,
    /// along z.
    pub principal: [f64; 2],
    /// Entrance pupil.
    pub entrance_pupil: Pupil,
    /// Exit pupil.
    pub exit_pupil: Pupil,
    /// |efl| over the diameter of the entrance pupil.
    pub f_number: f64,
    /// Paraxial numerical aperture in image space, n' |u'|.
    pub image_na: f64,
    /// Paraxial image from the last surface before the image, along z.
    pub image_distance: f64,
    /// Height of the image over that of the object; `None` for an object at infinity.
    pub magnification: Option<f64>,
    /// Height of the paraxial chief ray of the largest field at the paraxial image.
    pub image_height: f64,
    /// Lagrange invariant n (u y_chief - u_chief y) of the largest field.
    pub lagrange: f64,
}

/// A prescription as paraxial rays see it at one wavelength.
#[derive(Clone, Debug)]
pub struct Paraxial<'a> {
    prescription: &'a Prescription,
    lambda_nm: f64,
    /// Index of the object space, then after each surface; negative after an odd number of mirrors.
    pub n: Vec<f64>,
    /// Curvature of each surface.
    pub c: Vec<f64>,
}

impl<'a> Paraxial<'a> {
    /// A valid prescription at a wavelength in nanometers.
    #[must_use]
    pub fn new(prescription: &'a Prescription, lambda_nm: f64) -> Self {
        let mut n = vec![prescription.object_medium.ior.n(lambda_nm)];
        let mut sense = 1.0;
        for (i, surface) in prescription.surfaces.iter().enumerate() {
            let next = match surface.interaction {
                Interaction::Refract => sense * surface.medium.ior.n(lambda_nm),
                Interaction::Reflect => {
                    sense = -sense;
                    -n[i]
                }
            };
            n.push(next);
        }
        let curvature = |s: &super::Surface| s.shape.profile.vertex_curvature();
        let c = prescription.surfaces.iter().map(curvature).collect();
        Self {
            prescription,
            lambda_nm,
            n,
            c,
        }
    }

    /// Follows a ray that is given at surface 0 before it acts, up to surface `to`: heights there,
    /// and what leaves each.
    #[must_use]
    pub fn trace(&self, start: ParaxialRay, to: usize) -> Vec<ParaxialRay> {
        let mut ray = start;
        let mut out = Vec::with_capacity(to + 1);
        for i in 0..=to {
            ray.nu -= ray.y * self.c[i] * (self.n[i + 1] - self.n[i]);
            out.push(ray);
            if i < to {
                ray.y += self.prescription.axial_distance(i) * ray.nu / self.n[i + 1];
            }
        }
        out
    }

    /// Heights at the stop of the rays (1, 0) and (0, 1) of (y, nu) at the first surface.
    fn stop_heights(&self) -> [f64; 2] {
        let stop = self.prescription.stop;
        [(1.0, 0.0), (0.0, 1.0)].map(|(y, nu)| self.trace(ParaxialRay { y, nu }, stop)[stop].y)
    }

    fn ray_to_pupil(
        &self,
        pupil_z: f64,
        height: f64,
        object_height: f64,
        slope: f64,
    ) -> ParaxialRay {
        let n = self.n[0];
        match self.prescription.object_distance {
            None => ParaxialRay {
                y: height - slope * pupil_z,
                nu: n * slope,
            },
            Some(distance) => {
                let u = (height - object_height) / (distance + pupil_z);
                ParaxialRay {
                    y: object_height + u * distance,
                    nu: n * u,
                }
            }
        }
    }

    /// Position of the entrance pupil from the first surface.
    #[must_use]
    pub fn entrance_position(&self) -> f64 {
        let [a, b] = self.stop_heights();
        self.n[0] * b / a
    }

    /// One over the power of the system.
    #[must_use]
    pub fn efl(&self) -> f64 {
        let last = self.prescription.last();
        let out = self.trace(ParaxialRay { y: 1.0, nu: 0.0 }, last)[last];
        -1.0 / out.nu
    }

    /// Distance from the last surface to the image of a plane so far before the first one (`None`:
    /// infinitely far), millimeters; `None` where there is no real image behind the lens.
    #[must_use]
    pub fn image_of(&self, object: Option<f64>) -> Option<f64> {
        let last = self.prescription.last();
        let (y, nu) = object.map_or((1.0, 0.0), |distance| (distance, self.n[0]));
        let out = self.trace(ParaxialRay { y, nu }, last)[last];
        let distance = -out.y / out.nu * self.n[last + 1];
        (distance.is_finite() && distance > 0.0).then_some(distance)
    }

    /// Radius of the stop that the entrance pupil of an f-number (of an object at infinity) is the
    /// image of.
    #[must_use]
    pub fn stop_radius(&self, f_number: f64) -> f64 {
        let [per_height, _] = self.stop_heights();
        0.5 * (self.efl() / f_number * per_height).abs()
    }

    /// Diameter of the entrance pupil.
    #[must_use]
    pub fn entrance_diameter(&self) -> f64 {
        let p = self.prescription;
        let position = self.entrance_position();
        match p.aperture {
            SystemAperture::EntrancePupil(diameter) => diameter,
            SystemAperture::FNumber(f) => (self.efl() / f).abs(),
            SystemAperture::ObjectNa(na) => {
                let sine = na / self.n[0];
                let slope = sine / (1.0 - sine * sine).sqrt();
                let distance = p.object_distance.unwrap_or(0.0);
                2.0 * (slope * (distance + position)).abs()
            }
            SystemAperture::StopSize => {
                let radius = p.surfaces[p.stop].shape.aperture.radius().unwrap_or(0.0);
                let unit = self.trace(self.ray_to_pupil(position, 1.0, 0.0, 0.0), p.stop);
                2.0 * (radius / unit[p.stop].y).abs()
            }
        }
    }

    /// The ray from the axial point of the object to the rim of the pupil.
    #[must_use]
    pub fn marginal(&self) -> ParaxialRay {
        self.ray_to_pupil(
            self.entrance_position(),
            0.5 * self.entrance_diameter(),
            0.0,
            0.0,
        )
    }

    /// Height of the object and slope in object space of a field value along one axis.
    #[must_use]
    pub fn field(&self, value: f64) -> (f64, f64) {
        let reach = |distance: f64| distance + self.entrance_position();
        match (
            self.prescription.field_kind,
            self.prescription.object_distance,
        ) {
            (FieldKind::AngleDeg, None) => (0.0, value.to_radians().tan()),
            (FieldKind::AngleDeg, Some(d)) => (-value.to_radians().tan() * reach(d), 0.0),
            (FieldKind::ObjectHeight, Some(_)) => (value, 0.0),
            // a height at infinity is an angle, as files write it
            (FieldKind::ObjectHeight, None) => (0.0, value.to_radians().tan()),
            (FieldKind::ImageHeight, None) => (0.0, value / (self.efl() * self.n[0])),
            (FieldKind::ImageHeight, Some(_)) => (value / self.magnification(), 0.0),
        }
    }

    /// The ray from the edge of a field to the center of the pupil.
    #[must_use]
    pub fn chief(&self, field: f64) -> ParaxialRay {
        let (height, slope) = self.field(field);
        self.ray_to_pupil(self.entrance_position(), 0.0, height, slope)
    }

    fn magnification(&self) -> f64 {
        let last = self.prescription.last();
        let start = self.marginal();
        start.nu / self.trace(start, last)[last].nu
    }

    /// Largest field as a single number.
    #[must_use]
    pub fn largest_field(&self) -> f64 {
        let size = |f: &[f64; 2]| f[0].hypot(f[1]);
        self.prescription
            .fields
            .iter()
            .map(size)
            .fold(0.0, f64::max)
    }

    /// All data of first order.
    #[must_use]
    pub fn first_order(&self) -> FirstOrder {
        let p = self.prescription;
        let last = p.last();
        let (n_front, n_rear) = (self.n[0], self.n[last + 1]);
        let out = |y: f64, nu: f64| self.trace(ParaxialRay { y, nu }, last)[last];
        let (a, b) = (out(1.0, 0.0), out(0.0, 1.0));
        let efl = -1.0 / a.nu;
        let bfl = -a.y / a.nu * n_rear;
        let ffl = b.nu / a.nu * n_front;
        let entrance_pupil = Pupil {
            position: self.entrance_position(),
            diameter: self.entrance_diameter(),
        };
        let start = self.marginal();
        let marginal = self.trace(start, last)[last];
        let field = self.largest_field();
        let start_chief = self.chief(field);
        let chief = self.trace(start_chief, last)[last];
        // the ray through the center of the stop leaves through that of the exit pupil, also with
        // no field at all
        let through = self.ray_to_pupil(entrance_pupil.position, 0.0, 1.0, 1.0);
        let through = self.trace(through, last)[last];
        let exit_position = -through.y / through.nu * n_rear;
        let exit_radius = marginal.y + exit_position * marginal.nu / n_rear;
        let image_distance = -marginal.y / marginal.nu * n_rear;
        FirstOrder {
            lambda_nm: self.lambda_nm,
            efl,
            bfl,
            ffl,
            principal: [ffl + efl * n_front, bfl - efl * n_rear],
            entrance_pupil,
            exit_pupil: Pupil {
                position: exit_position,
                diameter: 2.0 * exit_radius.abs(),
            },
            f_number: (efl / entrance_pupil.diameter).abs(),
            image_na: marginal.nu.abs(),
            image_distance,
            magnification: p.object_distance.map(|_| start.nu / marginal.nu),
            image_height: chief.y + image_distance * chief.nu / n_rear,
            lagrange: start.nu * start_chief.y - start_chief.nu * start.y,
        }
    }
}
