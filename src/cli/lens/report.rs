//! The numbers of a lens as a table and as JSON.

use crate::optics::analysis::{Beams, RINGS, Spot, Transmission};
use crate::optics::ghosts::{self, Ghost};
use crate::optics::paraxial::Paraxial;
use crate::optics::seidel::{self, Seidel};
use crate::optics::{FieldKind, FirstOrder, Interaction, Prescription};
use serde_json::json;
use std::fmt::Write as _;

/// Rings of the rays of ghosts: 469 rays.
const GHOST_RINGS: u32 = 12;

/// The spot of one field at one wavelength; radii in millimeters, about the centroid.
pub struct SpotData {
    /// Index of the field.
    pub field: usize,
    /// Nanometers.
    pub lambda_nm: f64,
    /// The rays.
    pub spot: Spot,
}

/// All numbers of a lens.
pub struct Report<'a> {
    lens: &'a Prescription,
    first_order: Vec<FirstOrder>,
    seidel: Vec<Seidel>,
    /// A spot per field and wavelength.
    pub spots: Vec<SpotData>,
    /// From the image surface to the paraxial image, and to the best focus of all spots,
    /// millimeters.
    pub focus: [f64; 2],
    /// Per field at the primary wavelength.
    transmission: Vec<Option<Transmission>>,
    /// Per field, where they are asked for: power of all ghosts, and the most powerful.
    ghosts: Option<Vec<(f64, Vec<Ghost>)>>,
}

impl<'a> Report<'a> {
    /// Computes them, the `ghosts` most powerful ghosts of each field among them.
    #[must_use]
    pub fn new(lens: &'a Prescription, ghosts: Option<usize>) -> Self {
        let first = |nm: f64| Paraxial::new(lens, nm).first_order();
        let first_order: Vec<FirstOrder> = lens.wavelengths.iter().map(|w| first(w.nm)).collect();
        let beams: Vec<Beams> = lens
            .wavelengths
            .iter()
            .map(|w| Beams::new(lens, w.nm))
            .collect();
        let mut spots = Vec::new();
        for (field, &value) in lens.fields.iter().enumerate() {
            for (beam, wavelength) in beams.iter().zip(&lens.wavelengths) {
                let spot = beam.spot(value, RINGS);
                let lambda_nm = wavelength.nm;
                spots.push(SpotData {
                    field,
                    lambda_nm,
                    spot,
                });
            }
        }
        let last = lens.last();
        let paraxial = first_order[lens.primary].image_distance - lens.axial_distance(last);
        let primary = &beams[lens.primary];
        let transmission = lens
            .fields
            .iter()
            .map(|&f| primary.mean_transmission(f, 6))
            .collect();
        Self {
            lens,
            first_order,
            seidel: seidel::seidel(lens),
            focus: [paraxial, best_focus(&spots, lens)],
            spots,
            transmission,
            ghosts: ghosts.map(|most| {
                let of = |&field: &[f64; 2]| {
                    let mut all = ghosts::ghosts(lens, lens.primary_nm(), field, GHOST_RINGS);
                    let power = all.iter().map(|g| g.power).sum();
                    all.truncate(most);
                    (power, all)
                };
                lens.fields.iter().map(of).collect()
            }),
        }
    }

    /// Radii of a spot at the image, the paraxial focus and the best focus.
    fn radii(&self, spot: &Spot) -> [f64; 3] {
        [0.0, self.focus[0], self.focus[1]].map(|dz| spot.measure(dz).1)
    }

    /// As JSON, lengths in millimeters, wavelengths in nanometers.
    #[must_use]
    pub fn json(&self) -> String {
        let lens = self.lens;
        let order = |f: &FirstOrder| {
            json!({
                "wavelength_nm": f.lambda_nm, "efl": f.efl, "bfl": f.bfl, "ffl": f.ffl, "f_number": f.f_number,
                "front_principal": f.principal[0], "rear_principal": f.principal[1],
                "entrance_pupil": { "position": f.entrance_pupil.position, "diameter": f.entrance_pupil.diameter },
                "exit_pupil": { "position": f.exit_pupil.position, "diameter": f.exit_pupil.diameter },
                "image_na": f.image_na, "image_distance": f.image_distance, "magnification": f.magnification,
                "image_height": f.image_height, "lagrange": f.lagrange,
            })
        };
        let sums = |s: &Seidel| json!({ "S": s.s, "C": s.c });
        let surface = |(i, s): (usize, &crate::optics::Surface)| {
            let (curvature, conic) = s.shape.profile.base();
            json!({
                "surface": i + 1, "curvature": curvature, "conic": conic, "thickness": s.thickness,
                "medium": s.medium.ior.name(), "mirror": s.interaction == Interaction::Reflect,
                "semi_diameter": s.shape.aperture.radius(), "stop": i == lens.stop, "comment": s.comment,
                "seidel": self.seidel.get(i).map(sums),
            })
        };
        let spot = |s: &SpotData| {
            let [image, paraxial, best] = self.radii(&s.spot);
            json!({
                "field": lens.fields[s.field], "wavelength_nm": s.lambda_nm, "rays": s.spot.rays.len(), "sent": s.spot.sent,
                "centroid": s.spot.measure(0.0).0.to_array(), "rms_image": image, "rms_paraxial_focus": paraxial,
                "rms_best_focus": best,
            })
        };
        let transmission = |(field, t): (&[f64; 2], &Option<Transmission>)| json!({ "field": field, "surfaces": t.map(|t| t.surfaces), "media": t.map(|t| t.media) });
        let shift = |f: &FirstOrder| json!({ "wavelength_nm": f.lambda_nm, "shift": f.bfl - self.first_order[lens.primary].bfl });
        let value = json!({
            "name": lens.name,
            "notes": lens.notes,
            "primary_nm": lens.primary_nm(),
            "surfaces": lens.surfaces.iter().enumerate().map(surface).collect::<Vec<_>>(),
            "first_order": self.first_order.iter().map(order).collect::<Vec<_>>(),
            "seidel": sums(&seidel::total(&self.seidel)),
            "chromatic_focal_shift": self.first_order.iter().map(shift).collect::<Vec<_>>(),
            "focus": { "paraxial": self.focus[0], "best": self.focus[1] },
            "spots": self.spots.iter().map(spot).collect::<Vec<_>>(),
            "ghosts": self.ghosts.as_ref().map(|fields| lens.fields.iter().zip(fields).map(|field| ghosts_json(lens, field)).collect::<Vec<_>>()),
            "transmission": lens.fields.iter().zip(&self.transmission).map(transmission).collect::<Vec<_>>(),
        });
        format!("{value:#}\n")
    }

    /// As text.
    #[must_use]
    pub fn table(&self) -> String {
        let lens = self.lens;
        let mut text = format!("{}\n", lens.name);
        for note in &lens.notes {
            _ = writeln!(text, "  note: {note}");
        }
        _ = writeln!(
            text,
            "\n  surface       radius     thickness  semi-diameter      conic  medium"
        );
        for (i, s) in lens.surfaces.iter().enumerate() {
            let (curvature, conic) = s.shape.profile.base();
            let radius = if curvature == 0.0 {
                "plane".to_owned()
            } else {
                format!("{:.5}", 1.0 / curvature)
            };
            let semi = s
                .shape
                .aperture
                .radius()
                .map_or("-".to_owned(), |r| format!("{r:.4}"));
            let mirror = s.interaction == Interaction::Reflect;
            let medium = if mirror {
                "mirror"
            } else {
                s.medium.ior.name()
            };
            let mark = if i == lens.stop { " stop" } else { "" };
            let bent = if s.before.is_empty() {
                ""
            } else {
                ", tilted or decentered"
            };
            _ = writeln!(
                text,
                "  {:>2}{mark:<5} {radius:>14} {:>12.5} {semi:>14} {conic:>10.5}  {medium}{bent}",
                i + 1,
                s.thickness
            );
        }
        _ = writeln!(
            text,
            "\nParaxial data, mm{}",
            if lens.surfaces.iter().any(|s| !s.before.is_empty()) {
                " (along the axis, tilts and decenters aside)"
            } else {
                ""
            }
        );
        let mut row = |name: &str, value: &dyn Fn(&FirstOrder) -> f64| {
            _ = write!(text, "  {name:<26}");
            for f in &self.first_order {
                _ = write!(text, " {:>13.6}", value(f));
            }
            text.push('\n');
        };
        row("wavelength, nm", &|f| f.lambda_nm);
        row("focal length", &|f| f.efl);
        row("back focal distance", &|f| f.bfl);
        row("front focal point", &|f| f.ffl);
        row("front principal plane", &|f| f.principal[0]);
        row("rear principal plane", &|f| f.principal[1]);
        row("f-number", &|f| f.f_number);
        row("image NA", &|f| f.image_na);
        row("entrance pupil, position", &|f| f.entrance_pupil.position);
        row("entrance pupil, diameter", &|f| f.entrance_pupil.diameter);
        row("exit pupil, position", &|f| f.exit_pupil.position);
        row("exit pupil, diameter", &|f| f.exit_pupil.diameter);
        row("paraxial image, distance", &|f| f.image_distance);
        row("paraxial image, height", &|f| f.image_height);
        row("chromatic focal shift", &|f| {
            f.bfl - self.first_order[lens.primary].bfl
        });
        let sum = seidel::total(&self.seidel);
        _ = writeln!(
            text,
            "\nSeidel sums, mm, at {:.4} nm; color between F and C",
            lens.primary_nm()
        );
        _ = writeln!(
            text,
            "  surface    spherical         coma  astigmatism     Petzval  distortion   axial col. lateral col."
        );
        let mut row = |name: &str, s: &Seidel| {
            _ = write!(text, "  {name:<8}");
            for value in s.s.iter().chain(&s.c) {
                _ = write!(text, " {value:>12.6}");
            }
            text.push('\n');
        };
        for (i, s) in self.seidel.iter().enumerate() {
            row(&(i + 1).to_string(), s);
        }
        row("sum", &sum);
        let unit = if lens.field_kind == FieldKind::AngleDeg {
            "degrees"
        } else {
            "mm"
        };
        _ = writeln!(
            text,
            "\nSpots, rms radius about the centroid, um: at the image, the paraxial focus ({:+.4} mm), the best focus ({:+.4} mm)",
            self.focus[0], self.focus[1]
        );
        _ = writeln!(
            text,
            "  field, {unit:<10} wavelength, nm      image   paraxial       best       rays"
        );
        for s in &self.spots {
            let [x, y] = lens.fields[s.field];
            let field = format!("{x} {y}");
            _ = write!(text, "  {field:<17} {:>14.4}", s.lambda_nm);
            for radius in self.radii(&s.spot) {
                _ = write!(text, " {:>10.4}", radius * 1e3);
            }
            _ = writeln!(text, " {:>5}/{}", s.spot.rays.len(), s.spot.sent);
        }
        let coated = lens.surfaces.iter().find_map(|s| s.coating.as_ref());
        let coating = coated.map_or("uncoated", |c| c.name.as_str());
        _ = writeln!(text, "\nTransmission, unpolarized, {coating}");
        for ([x, y], t) in lens.fields.iter().zip(&self.transmission) {
            let field = format!("{x} {y}");
            _ = match t {
                Some(t) => writeln!(
                    text,
                    "  {field:<17} surfaces {:.5}  media {:.5}  together {:.5}",
                    t.surfaces,
                    t.media,
                    t.surfaces * t.media
                ),
                None => writeln!(text, "  {field:<17} no ray arrives"),
            };
        }
        for (field, (power, ghosts)) in lens.fields.iter().zip(self.ghosts.iter().flatten()) {
            text += &ghosts_table(lens, *field, *power, ghosts);
        }
        text
    }
}

fn ghosts_table(lens: &Prescription, [x, y]: [f64; 2], power: f64, all: &[Ghost]) -> String {
    let mut text = format!(
        "\nGhosts of field {x} {y} at {:.4} nm: {power:.3e} of the power of the beam in all\n",
        lens.primary_nm()
    );
    text += "  reflected by         power   rays, %    x, mm        y, mm        rms radius, mm\n";
    for ghost in all {
        let [first, second] = ghost.surfaces.map(|i| i + 1);
        let c = ghost.centroid;
        _ = writeln!(
            text,
            "  {:<14} {:>12.5e} {:>8.2} {:>12.5} {:>12.5} {:>12.5}",
            format!("{first}, then {second}"),
            ghost.power,
            100.0 * ghost.rays,
            c.x,
            c.y,
            ghost.rms
        );
    }
    if let Some(ghost) = all.first() {
        _ = writeln!(
            text,
            "  the first alone: abbe render SCENE --sequence '{}'",
            ghosts::expression(lens, ghost.surfaces)
        );
    }
    text
}

fn ghosts_json(
    lens: &Prescription,
    (field, (power, all)): (&[f64; 2], &(f64, Vec<Ghost>)),
) -> serde_json::Value {
    let ghost = |g: &Ghost| {
        json!({
            "surfaces": g.surfaces.map(|i| i + 1), "power": g.power, "rays": g.rays,
            "centroid": g.centroid.to_array(), "rms": g.rms,
            "sequence": ghosts::expression(lens, g.surfaces),
        })
    };
    json!({ "field": field, "power": power, "ghosts": all.iter().map(ghost).collect::<Vec<_>>() })
}

/// Where the spots of all fields, each about the centroid of its wavelengths, are smallest
/// together: the parabolas of the squared radii add up.
fn best_focus(spots: &[SpotData], lens: &Prescription) -> f64 {
    let (mut weighted, mut total) = (0.0, 0.0);
    for field in 0..lens.fields.len() {
        let these: Vec<&Spot> = spots
            .iter()
            .filter(|s| s.field == field)
            .map(|s| &s.spot)
            .collect();
        if these.iter().all(|s| s.rays.len() < 2) {
            continue;
        }
        // radius^2(z) = a (z - best)^2 + rest: a from three values
        let best = Spot::best_focus(&these);
        let square = |dz: f64| -> f64 { these.iter().map(|s| s.measure(dz).1.powi(2)).sum() };
        let curvature = 0.5 * (square(best + 1.0) + square(best - 1.0)) - square(best);
        weighted += curvature * best;
        total += curvature;
    }
    if total > 0.0 { weighted / total } else { 0.0 }
}
