//! Where the rays of a film leave for its lens: the parts of a plane at the rear element that rays
//! from each field reach the object through, tabulated by real rays.
//!
//! Rays run backward through every surface, apertures clip them. What the table leaves out at its
//! borders (cells that no traced ray came through) is for others to sample: it bounds waste, not
//! light. After Kolb, Mitchell and Hanrahan, A Realistic Camera Model for Computer Graphics,
//! SIGGRAPH 1995, with a mask of cells in place of a disk or box.

use super::{Interaction, Outline, Passage, Prescription, Profile, Ray, System};
use glam::{DVec2, DVec3};

/// Columns, and rows, of a mask.
const CELLS: usize = 24;
/// Rays through a cell, along each side.
const RAYS: usize = 2;
/// Intervals of the distance from the axis.
const FIELDS: usize = 24;
/// Half edge of the masks, in units of the radius of the rear element: rays to the edge of a
/// surface that bulges cross the plane of its vertex farther out.
const WIDTH: f64 = 1.1;

/// The cells that rays of one interval of fields come through.
#[derive(Clone, Debug, PartialEq)]
struct Field {
    /// Indices of the cells, row by row.
    cells: Vec<usize>,
    /// Whether each cell is one of them.
    mask: Vec<bool>,
    /// Share of the rays through them that reach the object.
    passing: f64,
}

/// A table of exit pupils over a film.
#[derive(Clone, Debug, PartialEq)]
pub struct ExitPupil {
    /// Distance from the film to the plane, > 0.
    distance: f64,
    /// Half edge of the masks.
    half: f64,
    /// Distance of the farthest corner of the film from the axis.
    reach: f64,
    /// The middle of the film, from the axis.
    shift: DVec2,
    fields: Vec<Field>,
}

/// Whether a lens looks the same from all sides of its axis, as what is tabulated here does.
#[must_use]
pub fn is_round(lens: &Prescription) -> bool {
    lens.surfaces[..=lens.last()].iter().all(|surface| {
        let aperture = &surface.shape.aperture;
        surface.before.is_empty()
            && surface.after.is_empty()
            && surface.interaction == Interaction::Refract
            && aperture.center == DVec2::ZERO
            && !matches!(aperture.outline, Outline::Rectangle { .. })
            && !matches!(surface.shape.profile, Profile::Toroid { .. })
    })
}

impl ExitPupil {
    /// The pupils of a film that stands `image` millimeters behind the last surface of a valid
    /// prescription and reaches `reach` millimeters from the axis, at these wavelengths. Of a lens
    /// that is not round it is the rear element, seen from all of the film.
    ///
    /// `None` where the rear element has no edge, or the film stands before it.
    #[must_use]
    pub fn new(lens: &Prescription, image: f64, reach: f64, lambdas_nm: &[f64]) -> Option<Self> {
        let last = lens.last();
        let radius = lens.surfaces[last].shape.aperture.extent();
        let half = WIDTH * radius;
        if !(half.is_finite() && half > 0.0 && image > 0.0 && reach > 0.0) {
            return None;
        }
        let backward = (0..=last).rev().map(|surface| Passage {
            surface,
            backward: true,
            reflects: false,
        });
        // the last of a route clips nothing
        let end = Passage {
            surface: last + 1,
            backward: false,
            reflects: false,
        };
        let route: Vec<Passage> = backward.chain([end]).collect();
        let systems: Vec<System> = lambdas_nm
            .iter()
            .map(|&nm| System::along(lens, nm, route.clone()))
            .collect();
        let vertex = lens.frames()[last].origin.z;
        let table = Self {
            distance: image,
            half,
            reach,
            shift: DVec2::ZERO,
            fields: Vec::new(),
        };
        let fields = if is_round(lens) {
            let at = |i: usize| table.passing(&systems, vertex, reach * i as f64 / FIELDS as f64);
            let each: Vec<Vec<f64>> = (0..=FIELDS).map(at).collect();
            each.windows(2).map(Field::between).collect()
        } else {
            let all = |i: usize| f64::from(u8::from(table.cell_center(i).length() < half));
            vec![Field::between(&[(0..CELLS * CELLS).map(all).collect()])]
        };
        Some(Self { fields, ..table })
    }

    fn cell_corner(&self, i: usize) -> DVec2 {
        let at = DVec2::new((i % CELLS) as f64, (i / CELLS) as f64);
        at * self.cell() - self.half
    }

    fn cell_center(&self, i: usize) -> DVec2 {
        self.cell_corner(i) + 0.5 * self.cell()
    }

    fn cell(&self) -> f64 {
        2.0 * self.half / CELLS as f64
    }

    /// Share of the rays through each cell that reach the object, from a point of the film at a
    /// distance from the axis along +x.
    fn passing(&self, systems: &[System], vertex: f64, off_axis: f64) -> Vec<f64> {
        let from = DVec3::new(off_axis, 0.0, vertex + self.distance);
        let step = self.cell() / RAYS as f64;
        let passes = |cell: usize, ray: usize, system: &System| {
            let within = DVec2::new((ray % RAYS) as f64, (ray / RAYS) as f64) + 0.5;
            let to = (self.cell_corner(cell) + within * step).extend(vertex);
            let ray = Ray {
                o: from,
                d: (to - from).normalize(),
            };
            system.trace(ray, true, |_| ()).is_ok()
        };
        let rays = RAYS * RAYS * systems.len();
        let share = |cell: usize| {
            let of = |system| {
                (0..RAYS * RAYS)
                    .filter(|&ray| passes(cell, ray, system))
                    .count()
            };
            systems.iter().map(of).sum::<usize>() as f64 / rays as f64
        };
        (0..CELLS * CELLS).map(share).collect()
    }

    /// Distance from the film to the plane of the masks.
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.distance
    }

    /// Radius of a disk in that plane, about the axis, that holds the rear element.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.half
    }

    /// Share of the rays drawn in the middle of the film, and in its corners, that reach the
    /// object.
    #[must_use]
    pub fn passing_shares(&self) -> [f64; 2] {
        [0, self.fields.len() - 1].map(|i| self.fields[i].passing)
    }

    /// The same table in other units of length, each `factor` times as many.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            distance: self.distance * factor,
            half: self.half * factor,
            reach: self.reach * factor,
            shift: self.shift * factor,
            fields: self.fields,
        }
    }

    /// The same table for a film whose middle lies so far from the axis.
    #[must_use]
    pub fn shifted(self, shift: DVec2) -> Self {
        Self { shift, ..self }
    }

    /// The middle of the film, from the axis.
    #[must_use]
    pub fn shift(&self) -> DVec2 {
        self.shift
    }

    /// The interval of a point, given from the axis, and its direction from there.
    fn field(&self, film: DVec2) -> (&Field, DVec2) {
        let off_axis = film.length();
        let count = self.fields.len();
        let i = (off_axis / self.reach * count as f64) as usize;
        let along = film.try_normalize().unwrap_or(DVec2::X);
        (&self.fields[i.min(count - 1)], along)
    }

    /// A direction from a point of the film, by `u` in [0,1)²: the film lies in z = 0 about its
    /// middle, the lens on the side of +z. `None` where no ray comes through.
    #[must_use]
    pub fn draw(&self, film: DVec2, u: DVec2) -> Option<DVec3> {
        let film = film + self.shift;
        let (field, along) = self.field(film);
        let choice = u.x * field.cells.len() as f64;
        let i = (choice as usize).min(field.cells.len().checked_sub(1)?);
        let within = DVec2::new(choice - i as f64, u.y);
        let at = along.rotate(self.cell_corner(field.cells[i]) + within * self.cell());
        Some((at - film).extend(self.distance).normalize())
    }

    /// Density of that per solid angle, of a unit direction with z > 0.
    #[must_use]
    pub fn density(&self, film: DVec2, direction: DVec3) -> f64 {
        let film = film + self.shift;
        let (field, along) = self.field(film);
        let length = self.distance / direction.z;
        let at = film + direction.truncate() * length;
        // turned back, in cells from the corner
        let back = DVec2::new(along.x, -along.y);
        let at = (back.rotate(at) + self.half) / self.cell();
        let is_inside = at.min_element() >= 0.0 && at.max_element() < CELLS as f64;
        if !is_inside || !field.mask[at.y as usize * CELLS + at.x as usize] {
            return 0.0;
        }
        let area = field.cells.len() as f64 * self.cell() * self.cell();
        length * length / (area * direction.z)
    }
}

impl Field {
    /// Of the shares that pass at the ends of the interval.
    fn between(ends: &[Vec<f64>]) -> Self {
        let mean = |i: usize| ends.iter().map(|e| e[i]).sum::<f64>() / ends.len() as f64;
        let shares: Vec<f64> = (0..CELLS * CELLS).map(mean).collect();
        let cells: Vec<usize> = (0..shares.len()).filter(|&i| shares[i] > 0.0).collect();
        let passing = cells.iter().map(|&i| shares[i]).sum::<f64>() / cells.len().max(1) as f64;
        Self {
            mask: shares.iter().map(|s| *s > 0.0).collect(),
            cells,
            passing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};
    use crate::spectrum::Library;
    use std::path::Path;

    const REACH: f64 = 21.6;
    const D_NM: f64 = 587.5618;

    fn double_gauss() -> (Prescription, f64) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/lenses/double_gauss.zmx");
        let lens = crate::io::lens::read(&path, Library::embedded()).expect("a lens");
        let image = super::super::paraxial::Paraxial::new(&lens, D_NM).image_of(None);
        (lens, image.expect("real"))
    }

    /// Directions are drawn with their density, which integrates to 1, and what is drawn passes
    /// as often as the table says: far more often than what is drawn toward the rear element.
    #[test]
    fn directions_pass_as_often_as_told() {
        let (lens, image) = double_gauss();
        let pupil = ExitPupil::new(&lens, image, REACH, &[D_NM]).expect("a pupil");
        let last = lens.last();
        let backward = (0..=last).rev().chain([last + 1]).map(|surface| Passage {
            surface,
            backward: surface <= last,
            reflects: false,
        });
        let system = System::along(&lens, D_NM, backward.collect());
        let vertex = lens.frames()[last].origin.z;
        let count = 4000u64;
        for (off_axis, index) in [(0.0, 0), (0.9999 * REACH, 1)] {
            let film = DVec2::from_angle(0.7) * off_axis;
            let mut passed = 0;
            for i in 0..count {
                let u = |k: u64| unit_f64(random_bits(i, k));
                let d = pupil.draw(film, DVec2::new(u(0), u(1))).expect("open");
                assert!(pupil.density(film, d) > 0.0);
                let ray = Ray {
                    o: film.extend(vertex + image),
                    d: DVec3::new(d.x, d.y, -d.z),
                };
                passed += u64::from(system.trace(ray, true, |_| ()).is_ok());
            }
            let (share, told) = (passed as f64 / count as f64, pupil.passing_shares()[index]);
            println!("{off_axis} mm: {share:.3} pass, told {told:.3}");
            // four rays a cell, two fields: a cell of the border is known to a quarter of it
            assert!((share - told).abs() < 0.05 && share > 0.7, "{share} {told}");
            // over the square of the masks, as area of the film's hemisphere
            let n = 1000;
            let sum: f64 = (0..n * n)
                .map(|i| {
                    let at = DVec2::new(f64::from(i % n), f64::from(i / n)) + 0.5;
                    let at =
                        DVec2::from_angle(0.7).rotate((at / f64::from(n) * 2.0 - 1.0) * pupil.half);
                    let way = (at - film).extend(image);
                    let (cos, squared) = (image / way.length(), way.length_squared());
                    pupil.density(film, way.normalize()) * cos / squared
                })
                .sum();
            let integral = sum * (2.0 * pupil.half / f64::from(n)).powi(2);
            assert!((integral - 1.0).abs() < 1e-2, "{integral}");
        }
    }

    #[test]
    fn a_lens_that_is_not_round_has_its_rear_element() {
        let (mut lens, image) = double_gauss();
        lens.surfaces[3].shape.aperture.center = DVec2::new(0.1, 0.0);
        let pupil = ExitPupil::new(&lens, image, REACH, &[D_NM]).expect("a pupil");
        assert_eq!(pupil.fields.len(), 1);
        let toward = |at: DVec2| pupil.density(DVec2::ZERO, at.extend(image).normalize());
        assert!(toward(DVec2::new(0.0, 0.9 * pupil.half)) > 0.0);
        assert!(toward(DVec2::splat(0.9 * pupil.half)) == 0.0);
    }
}
