//! Spots, ray fans and transmission of a prescription by real rays.
//!
//! Beams fill the physical stop: a ray is aimed so that it meets the stop at its share of the
//! radius that the on-axis marginal ray has there. Spots are uniform in the area of the stop and
//! measured about their centroid.

use super::coating::{Response, Stack, interface};
use super::paraxial::Paraxial;
use super::prescription::{Interaction, Prescription};
use super::trace::{Event, Lost, Ray, System};
use glam::{DVec2, DVec3};

/// Rings of a spot; the number of rays is 1 + 3 r (r + 1).
pub const RINGS: u32 = 16;
/// Newton steps of aiming; the next would change nothing in practice.
const AIM_STEPS: usize = 12;

/// A prescription at one wavelength with the beams of its fields.
#[derive(Clone, Debug)]
pub struct Beams<'a> {
    prescription: &'a Prescription,
    lambda_nm: f64,
    /// The system to trace.
    pub system: System<'a>,
    /// Distance of the entrance pupil from the first surface, and radius, at the primary
    /// wavelength.
    pupil: (f64, f64),
    /// Radius of the on-axis beam at the stop.
    stop_radius: f64,
}

/// A ray at the image: where it meets it, and its slopes there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// x and y in the image, millimeters.
    pub point: DVec2,
    /// dx/dz and dy/dz.
    pub slope: DVec2,
}

/// A spot: rays of one field and wavelength at the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Spot {
    /// The rays that arrive.
    pub rays: Vec<Arrival>,
    /// How many were sent.
    pub sent: usize,
}

impl Spot {
    /// The spot `dz` behind the image surface.
    #[must_use]
    pub fn points(&self, dz: f64) -> Vec<DVec2> {
        self.rays.iter().map(|r| r.point + r.slope * dz).collect()
    }

    /// Centroid and root mean square radius about it, `dz` behind the image.
    #[must_use]
    pub fn measure(&self, dz: f64) -> (DVec2, f64) {
        let points = self.points(dz);
        let n = points.len().max(1) as f64;
        let centroid = points.iter().sum::<DVec2>() / n;
        let square: f64 = points.iter().map(|p| p.distance_squared(centroid)).sum();
        (centroid, (square / n).sqrt())
    }

    /// The distance behind the image at which the spots together are smallest, each about their
    /// common centroid.
    ///
    /// Points move along straight lines: the square of the radius is a parabola of the distance.
    #[must_use]
    pub fn best_focus(spots: &[&Self]) -> f64 {
        let all: Vec<Arrival> = spots.iter().flat_map(|s| s.rays.iter().copied()).collect();
        let n = all.len().max(1) as f64;
        let mean = |f: fn(&Arrival) -> DVec2| all.iter().map(f).sum::<DVec2>() / n;
        let (point, slope) = (mean(|r| r.point), mean(|r| r.slope));
        let (mut cross, mut square) = (0.0, 0.0);
        for ray in &all {
            cross += (ray.point - point).dot(ray.slope - slope);
            square += (ray.slope - slope).length_squared();
        }
        if square > 0.0 { -cross / square } else { 0.0 }
    }
}

/// Power of one ray after the system, and where it was lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Part that passes all surfaces.
    pub surfaces: f64,
    /// Part that passes all media.
    pub media: f64,
}

impl<'a> Beams<'a> {
    /// The beams at a wavelength in nanometers.
    #[must_use]
    pub fn new(prescription: &'a Prescription, lambda_nm: f64) -> Self {
        let primary = Paraxial::new(prescription, prescription.primary_nm());
        let position = primary.entrance_position();
        let radius = 0.5 * primary.entrance_diameter();
        let system = System::new(prescription, lambda_nm);
        let mut beams = Self {
            prescription,
            lambda_nm,
            system,
            pupil: (position, radius),
            stop_radius: 0.0,
        };
        let reference = System::new(prescription, prescription.primary_nm());
        let paraxial = primary.trace(primary.marginal(), prescription.stop)[prescription.stop]
            .y
            .abs();
        let marginal = beams.launch([0.0; 2], DVec2::Y);
        beams.stop_radius =
            at_stop(&reference, prescription.stop, marginal).map_or(paraxial, DVec2::length);
        beams
    }

    /// The ray of a field through a point of the paraxial entrance pupil, in units of its radius.
    #[must_use]
    pub fn launch(&self, field: [f64; 2], pupil: DVec2) -> Ray {
        let (position, radius) = self.pupil;
        let through = DVec3::new(pupil.x * radius, pupil.y * radius, position);
        let paraxial = Paraxial::new(self.prescription, self.prescription.primary_nm());
        let [(hx, ux), (hy, uy)] = field.map(|f| paraxial.field(f));
        match self.prescription.object_distance {
            None => Ray {
                o: through,
                d: DVec3::new(ux, uy, 1.0).normalize(),
            },
            Some(distance) => {
                let o = DVec3::new(hx, hy, -distance);
                let d = (through - o).normalize();
                // always forward, also toward a pupil that lies behind the object
                let d = if d.z < 0.0 { -d } else { d };
                Ray { o, d }
            }
        }
    }

    /// The ray of a field that meets the stop at `share` of its radius.
    #[must_use]
    pub fn aimed(&self, field: [f64; 2], share: DVec2) -> Option<Ray> {
        let stop = self.prescription.stop;
        let target = share * self.stop_radius;
        let mut aim = share;
        let mut best: Option<(f64, Ray)> = None;
        for _ in 0..AIM_STEPS {
            let ray = self.launch(field, aim);
            let here = at_stop(&self.system, stop, ray)?;
            let error = target - here;
            if best.is_none_or(|(least, _)| error.length() < least) {
                best = Some((error.length(), ray));
            }
            if error.length() <= 1e-12 * self.stop_radius {
                break;
            }
            let h = 1e-6;
            let [dx, dy] = [DVec2::X, DVec2::Y].map(|axis| {
                let moved = at_stop(&self.system, stop, self.launch(field, aim + axis * h));
                moved.map(|p| (p - here) / h)
            });
            let (dx, dy) = (dx?, dy?);
            let det = dx.perp_dot(dy);
            if det == 0.0 || !det.is_finite() {
                return None;
            }
            aim += DVec2::new(error.perp_dot(dy), dx.perp_dot(error)) / det;
        }
        best.filter(|(error, _)| *error <= 1e-6 * self.stop_radius)
            .map(|b| b.1)
    }

    /// A ray at the image.
    ///
    /// # Errors
    /// Where and why it is lost.
    pub fn arrival(&self, ray: Ray) -> Result<Arrival, Lost> {
        let end = self.system.trace(ray, true, |_| ())?;
        Ok(Arrival {
            point: end.o.truncate(),
            slope: end.d.truncate() / end.d.z,
        })
    }

    /// The spot of a field: rings of rays uniform in the area of the stop.
    #[must_use]
    pub fn spot(&self, field: [f64; 2], rings: u32) -> Spot {
        let shares = pupil_rings(rings);
        let rays = shares
            .iter()
            .filter_map(|&share| self.arrival(self.aimed(field, share)?).ok())
            .collect();
        Spot {
            rays,
            sent: shares.len(),
        }
    }

    /// Where rays along one axis of the stop meet the image, against the chief ray: `None` where
    /// one is lost.
    #[must_use]
    pub fn fan(&self, field: [f64; 2], axis: DVec2, count: u32) -> Vec<(f64, Option<DVec2>)> {
        let chief = self.aimed(field, DVec2::ZERO);
        let chief = chief.and_then(|ray| self.arrival(ray).ok());
        let steps = count.max(2) - 1;
        let at = |i: u32| {
            let share = -1.0 + 2.0 * f64::from(i) / f64::from(steps);
            let ray = self.aimed(field, axis * share);
            let hit = ray.and_then(|ray| self.arrival(ray).ok());
            (share, hit.zip(chief).map(|(a, b)| a.point - b.point))
        };
        (0..=steps).map(at).collect()
    }

    /// Share of its power that a ray keeps: unpolarized at each surface (coatings as they are,
    /// mirrors without a coating perfect), Beer's law in the media.
    ///
    /// # Errors
    /// Where and why it is lost.
    pub fn transmission(&self, ray: Ray) -> Result<Transmission, Lost> {
        kept(self.prescription, &self.system, self.lambda_nm, ray).map(|(kept, _)| kept)
    }

    /// Mean transmission of the beam of a field over the rays that pass all apertures.
    #[must_use]
    pub fn mean_transmission(&self, field: [f64; 2], rings: u32) -> Option<Transmission> {
        let all: Vec<Transmission> = pupil_rings(rings)
            .into_iter()
            .filter_map(|share| self.transmission(self.aimed(field, share)?).ok())
            .collect();
        let n = all.len() as f64;
        (n > 0.0).then(|| Transmission {
            surfaces: all.iter().map(|t| t.surfaces).sum::<f64>() / n,
            media: all.iter().map(|t| t.media).sum::<f64>() / n,
        })
    }
}

/// Share of its power that a ray keeps along the route of a system, and the ray at the image.
pub(super) fn kept(
    prescription: &Prescription,
    system: &System,
    lambda_nm: f64,
    ray: Ray,
) -> Result<(Transmission, Ray), Lost> {
    let mut out = Transmission {
        surfaces: 1.0,
        media: 1.0,
    };
    let n = system.indices();
    let last = prescription.last();
    let end = system.trace(ray, true, |e: &Event| {
        let (i, passage) = (e.surface, &system.route()[e.surface]);
        if i > 0 {
            let k = prescription.in_front(passage).ior.k(lambda_nm);
            let alpha_per_mm = 4.0 * std::f64::consts::PI * k / (lambda_nm * 1e-6);
            out.media *= (-alpha_per_mm * e.distance.abs()).exp();
        }
        let surface = &prescription.surfaces[passage.surface];
        let coating = surface.coating.as_ref();
        let cos = e.incoming.dot(e.normal).abs().min(1.0);
        let response = |n_out| -> Response {
            if passage.backward {
                let reversed = coating.map(Stack::reversed);
                return interface(reversed.as_ref(), lambda_nm, n[i], n_out, cos);
            }
            interface(coating, lambda_nm, n[i], n_out, cos)
        };
        out.surfaces *= match surface.interaction {
            Interaction::Reflect if coating.is_none() => 1.0,
            Interaction::Reflect => response(1.5).r,
            Interaction::Refract if passage.reflects => {
                response(prescription.behind(passage).ior.n(lambda_nm)).r
            }
            Interaction::Refract
                if passage.surface > last || (n[i] == n[i + 1] && coating.is_none()) =>
            {
                1.0
            }
            Interaction::Refract => response(n[i + 1]).t,
        };
    })?;
    Ok((out, end))
}

fn at_stop(system: &System, stop: usize, ray: Ray) -> Option<DVec2> {
    let mut here = None;
    // what happens behind the stop does not matter
    _ = system.trace(ray, false, |e| {
        if e.surface == stop {
            here = Some(e.point.truncate());
        }
    });
    here
}

/// Points of the unit disk in rings of six, twelve, ... : each stands for the same area.
#[must_use]
pub fn pupil_rings(rings: u32) -> Vec<DVec2> {
    let mut out = vec![DVec2::ZERO];
    let total = 1.0 + 3.0 * f64::from(rings) * (f64::from(rings) + 1.0);
    for ring in 1..=rings {
        // the middle, by area, of the ring between the counts of points inside and up to it
        let inside = 1.0 + 3.0 * f64::from(ring) * (f64::from(ring) - 1.0);
        let count = 6 * ring;
        let radius = ((inside + 0.5 * f64::from(count)) / total).sqrt();
        out.extend((0..count).map(|i| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
            DVec2::from_angle(angle) * radius
        }));
    }
    out
}

#[cfg(test)]
mod tests;
