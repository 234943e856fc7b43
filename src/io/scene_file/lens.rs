//! `[[lens]]`: a table of surfaces, or a lens file, as objects of the scene.

use super::coating::Coating;
use super::document::Node;
use super::keys::{
    Build, Built, FINITE, Form, Keys, NON_NEGATIVE, POSITIVE, Spec, Table, Value, keys,
};
use super::medium::{library_index, validated};
use super::motion::Motion;
use super::object::MaterialUse;
use super::reader::Reader;
use super::transform::Steps;
use super::value::{At, FileName, GlassName, Name, items};
use crate::geometry::{Link, Transform};
use crate::io::glass::MAX_FILE_BYTES;
use crate::io::lens;
use crate::material::{Material, MaterialId};
use crate::optics::paraxial::Paraxial;
use crate::optics::prescription::{
    Break, FieldKind, Medium, Prescription, Surface, SystemAperture, Wavelength,
};
use crate::optics::{Aperture, Interaction, Outline, Profile, Stack};
use crate::scene::description::SceneDescription;
use crate::scene::{LensAssembly, LensBuildError};
use crate::spectrum::ior::LINE_D_NM;
use glam::{DAffine3, DVec2, DVec3};
use std::collections::BTreeSet;
use std::ops::Range as Span;

/// Most coefficients of an asphere.
const MAX_COEFFICIENTS: usize = 32;

keys! {
    /// A surface of a lens and what follows it, in millimeters.
    LensSurfaceKeys = "lens surface" {
        /// Radius of curvature, positive where the center lies behind; 0 is flat.
        radius: Option<f64>, in FINITE, unit "mm", or "flat";
        /// Inverse of the radius, instead.
        curvature: Option<f64>, in FINITE, unit "1/mm", or "flat";
        /// Conic constant: 0 sphere, -1 paraboloid.
        conic: f64, in FINITE, default 0.0;
        /// Coefficients of r², r⁴, r⁶, ... added to the sag, at most 32.
        even: Vec<f64>, in FINITE, unit "1/mm, 1/mm³, ...";
        /// Coefficients of r, r², r³, ..., instead.
        powers: Vec<f64>, in FINITE, unit "1, 1/mm, ...";
        /// Radius along x of a toroid or cylinder lens (0: flat), where it differs from that along
        /// y, which then has conic and `even`.
        radius_x: Option<f64>, in FINITE, unit "mm", or "as along y";
        /// Distance to the next surface along the axis, negative after a mirror.
        thickness: f64, in FINITE, unit "mm", default 0.0;
        /// A glass such as `"schott:N-BK7"` behind the surface.
        glass: Option<At<GlassName>>, or "air, which is the ambient medium";
        /// Radius of the clear aperture. A flat surface between equal media is a stop with this
        /// hole.
        semi_diameter: Option<f64>, in POSITIVE, unit "mm";
        /// With `semi_diameter`: radius within which it is black.
        obscuration: f64, in NON_NEGATIVE, unit "mm", default 0.0;
        /// Half width and half height of a rectangular aperture, instead of `semi_diameter`.
        rectangle: Option<[f64; 2]>, in POSITIVE, unit "mm";
        /// Center of the aperture.
        center: [f64; 2], in FINITE, unit "mm", default [0.0, 0.0];
        /// Layers between air and glass or two glasses, in the order in which light meets them.
        coating: Option<At<Coating>>, or "that of the lens";
        /// Whether it reflects all light, from both sides.
        mirror: bool, default false;
        /// Moves the surface, and those after it in the same glass.
        decenter: [f64; 3], in FINITE, unit "mm", default [0.0, 0.0, 0.0];
        /// Then turns them about x, the new y and the new z.
        tilt_deg: [f64; 3], in FINITE, unit "degrees", default [0.0, 0.0, 0.0];
    }
}

/// A surface, and where its group begins relative to the axis.
pub struct Row {
    surface: Surface,
    start: Break,
}

impl Build for LensSurfaceKeys {
    type Output = Row;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Row> {
        let profile = self.profile(table, cx);
        let outline = match (self.semi_diameter, self.rectangle) {
            (Some(_), Some(_)) => {
                let message = "an aperture is either semi_diameter or rectangle";
                cx.conflict(&table.span("rectangle"), message);
                return None;
            }
            (None, Some(half)) => Outline::Rectangle {
                half: DVec2::from_array(half),
            },
            (Some(outer), None) if self.obscuration > 0.0 => Outline::Annulus {
                inner: self.obscuration,
                outer,
            },
            (Some(radius), None) => Outline::Circle { radius },
            (None, None) => Outline::Open,
        };
        if let Outline::Annulus { inner, outer } = outline
            && inner >= outer
        {
            let message = "obscuration is not smaller than semi_diameter";
            cx.conflict(&table.span("obscuration"), message);
        } else if self.obscuration > 0.0 && self.semi_diameter.is_none() {
            let message = "obscuration is for surfaces with semi_diameter only";
            cx.conflict(&table.span("obscuration"), message);
        }
        let medium = match &self.glass {
            Some(glass) => {
                if self.mirror {
                    cx.conflict(&glass.at, "a mirror has no glass behind it");
                }
                Medium::new(library_index(&glass.value.0, &glass.at, false, cx)?)
            }
            None => Medium::air(),
        };
        let coating = self.coating.as_ref().and_then(|given| checked(given, cx));
        if let (Some(given), true) = (&self.coating, self.mirror) {
            cx.conflict(
                &given.at,
                "a mirror reflects all light (allowed: no coating)",
            );
        }
        table.sound(cx)?;
        let aperture = Aperture {
            outline,
            center: DVec2::from_array(self.center),
        };
        let mut surface = Surface::new(profile?, aperture, self.thickness, medium);
        surface.coating = coating;
        if self.mirror {
            surface.interaction = Interaction::Reflect;
        }
        Some(Row {
            surface,
            start: Break {
                decenter: DVec3::from_array(self.decenter),
                tilt_deg: DVec3::from_array(self.tilt_deg),
                reversed: false,
                thickness: 0.0,
            },
        })
    }
}

impl LensSurfaceKeys {
    fn profile(&self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Profile> {
        let inverse = |radius: f64| if radius == 0.0 { 0.0 } else { 1.0 / radius };
        if self.radius.is_some() && self.curvature.is_some() {
            let message = "a surface has either radius or curvature";
            cx.conflict(&table.span("curvature"), message);
            return None;
        }
        for key in ["even", "powers"] {
            let count = if key == "even" {
                self.even.len()
            } else {
                self.powers.len()
            };
            if count > MAX_COEFFICIENTS {
                let message = format!("{count} coefficients (allowed: at most 32)");
                cx.conflict(&table.span(key), message);
                return None;
            }
        }
        let curvature = self
            .curvature
            .or(self.radius.map(inverse))
            .unwrap_or_default();
        let (conic, even) = (self.conic, self.even.clone());
        let profile = match (self.radius_x, even.is_empty(), self.powers.is_empty()) {
            (_, false, false) | (Some(_), _, false) => {
                let message = "powers stand alone (allowed: without even and radius_x)";
                cx.conflict(&table.span("powers"), message);
                return None;
            }
            (Some(radius), _, true) => Profile::Toroid {
                curvature_x: inverse(radius),
                curvature_y: curvature,
                conic_y: conic,
                even_y: even,
            },
            (None, true, false) => Profile::OddAsphere {
                curvature,
                conic,
                powers: self.powers.clone(),
            },
            (None, false, true) => Profile::EvenAsphere {
                curvature,
                conic,
                even,
            },
            (None, true, true) => Profile::Conic { curvature, conic },
        };
        Some(profile)
    }
}

keys! {
    /// A lens by exactly one of `file` and `surface`. Light enters along +z at the origin, in
    /// millimeters whatever the unit of the scene; `transform` and `motion` place it.
    LensKeys = "lens" {
        /// Name for messages, unique among lenses.
        name: Option<At<Name>>, or "`lens 0`, ...";
        /// A lens file: Zemax `.zmx`, CODE V `.seq`, optiland `.json`.
        file: Option<At<FileName>>;
        /// The surfaces, at most 999, in the order in which light meets them, without an image.
        surface: Vec<At<Built<LensSurfaceKeys>>>;
        /// Coating of every surface between air and glass that has none, as light from air meets
        /// it.
        coating: Option<At<Coating>>, or "none";
        /// Focal length by diameter of the entrance pupil, to which the stop is closed.
        f_number: Option<f64>, in POSITIVE, or "what the stop lets through";
        /// Radius of a black tube around the lens that holds its elements and stops.
        barrel: Option<f64>, in POSITIVE, unit "mm", or "none";
        /// Opaque material of the edges and flanges of its glass, such as a diffuse one of ground
        /// glass.
        edge: Option<MaterialUse>, or "black";
        /// Steps that place it, applied in order.
        transform: Steps;
        /// Motion after that.
        motion: Motion<true>;
    }
}

/// A lens in its place.
#[derive(Debug)]
pub struct PlacedLens {
    name: String,
    /// Surfaces, as they are in the scene.
    pub prescription: Prescription,
    assembly: LensAssembly,
    /// Material of its edges; `None`: black.
    edge: Option<MaterialId>,
    /// From the space of the lens in meters.
    pub to_world: DAffine3,
    /// Motion after that, the outermost link first.
    pub motion: Vec<Link>,
}

impl PlacedLens {
    /// Name, unique among lenses.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Adds its parts to a scene.
    pub fn add_to(self, scene: &mut SceneDescription, cx: &Reader<'_>) {
        let shutter = cx.shutter.unwrap_or_default();
        let (to_world, motion) = (self.to_world, &self.motion);
        let place = |local: DAffine3| {
            let fixed = Transform::fixed(to_world * local);
            if motion.is_empty() {
                fixed
            } else {
                fixed.under(motion, shutter)
            }
        };
        let black = MaterialId(cx.black);
        let opaque = [black, self.edge.unwrap_or(black)];
        self.assembly.add_to(scene, &self.name, opaque, place);
    }
}

impl Build for LensKeys {
    type Output = (Option<String>, PlacedLens);

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Self::Output> {
        let chosen = table.exactly_one(&["file", "surface"], "lens", cx)?;
        let to_world = self.transform.0;
        let volume = to_world.matrix3.determinant().abs();
        if !to_world.matrix3.is_finite() || volume.is_nan() || volume < f64::MIN_POSITIVE {
            let message =
                "the lens has no volume after its transform (allowed: an invertible transform)";
            cx.conflict(&table.at, message);
            return None;
        }
        let coating = match &self.coating {
            Some(given) => Some(checked(given, cx)?),
            None => None,
        };
        let further = Further {
            coating: coating.as_ref(),
            f_number: self.f_number.map(|n| (n, table.span("f_number"))),
            barrel: self.barrel,
        };
        let (prescription, assembly) = match self.file {
            Some(file) if chosen == "file" => from_file(&file, &further, cx)?,
            _ => from_table(self.surface, &table.span("surface"), &further, cx)?,
        };
        let edge = self.edge.and_then(|e| e.facts);
        if edge.as_ref().is_some_and(|e| e.is_dielectric) {
            let message = "edge lets light through (allowed: an opaque material)";
            cx.conflict(&table.span("edge"), message);
            return None;
        }
        let name = self.name.map(|n| n.value.0);
        let placed = PlacedLens {
            name: String::new(),
            prescription,
            assembly,
            edge: edge.map(|e| e.id),
            to_world,
            motion: self.motion.0,
        };
        Some((name, placed))
    }
}

/// A coating that can be on glass at the wavelengths of the scene.
fn checked(given: &At<Coating>, cx: &mut Reader<'_>) -> Option<Stack> {
    let stack = &given.value.0;
    let checked = Material::interface(0.0).check_coating(stack, cx.range_nm?);
    match checked {
        Ok(()) => Some((**stack).clone()),
        Err(message) => {
            cx.conflict(&given.at, message);
            None
        }
    }
}

/// Further keys of a lens, besides its surfaces.
struct Further<'a> {
    /// Coating of what has none of its own.
    coating: Option<&'a Stack>,
    /// The f-number that its stop is closed to, and where that is said.
    f_number: Option<(f64, Span<usize>)>,
    /// Radius of the tube around it, millimeters.
    barrel: Option<f64>,
}

impl Further<'_> {
    /// Coats what has no coating of its own.
    fn coat(&self, lens: &mut Prescription) {
        let Some(coating) = self.coating else { return };
        let own: Vec<Option<Stack>> = lens.surfaces.iter().map(|s| s.coating.clone()).collect();
        lens.coat(coating);
        for (surface, own) in lens.surfaces.iter_mut().zip(own) {
            surface.coating = own.or(surface.coating.take());
        }
    }

    /// Closes the stop of a valid lens.
    fn close_stop(&self, lens: &mut Prescription, cx: &mut Reader<'_>) -> Option<()> {
        let Some((f_number, at)) = &self.f_number else {
            return Some(());
        };
        let is_stop = |i: &usize| {
            let surface = &lens.surfaces[*i];
            let is_circle = matches!(surface.shape.aperture.outline, Outline::Circle { .. });
            is_circle && lens.medium_before(*i).ior == surface.medium.ior
        };
        let stop = (0..=lens.last()).find(|i| *i == lens.stop && is_stop(i));
        let Some(stop) = stop.or_else(|| (0..=lens.last()).find(is_stop)) else {
            let message = "the lens has no stop to close (allowed with a flat surface between \
                           equal media that has a semi_diameter)";
            cx.conflict(at, message);
            return None;
        };
        lens.stop = stop;
        let radius = Paraxial::new(lens, LINE_D_NM).stop_radius(*f_number);
        let outline = &mut lens.surfaces[stop].shape.aperture.outline;
        match outline {
            Outline::Circle { radius: open } if radius <= *open * (1.0 + 1e-9) => {
                *open = radius.min(*open);
                Some(())
            }
            Outline::Circle { radius: open } => {
                let widest = f_number * radius / *open;
                let message = format!(
                    "the stop of this lens does not open as far (allowed: {widest:.4} or more)"
                );
                cx.conflict(at, message);
                None
            }
            _ => unreachable!("invariant: the stop is a circle"),
        }
    }
}

fn from_file(
    file: &At<FileName>,
    further: &Further,
    cx: &mut Reader<'_>,
) -> Option<(Prescription, LensAssembly)> {
    let path = cx.find(file, MAX_FILE_BYTES)?;
    let bytes = cx.bytes(file, &path)?;
    let mut prescription = match lens::parse_named(&bytes, &path, cx.library) {
        Ok(prescription) => prescription,
        Err(message) => {
            cx.bad_file(file, message);
            return None;
        }
    };
    further.coat(&mut prescription);
    further.close_stop(&mut prescription, cx)?;
    match LensAssembly::new(&prescription, further.barrel) {
        Ok(assembly) => {
            cx.file_notes(file, prescription.notes.clone());
            for ior in assembly.glasses().to_vec() {
                validated(ior, false, &file.at, cx);
            }
            Some((prescription, assembly))
        }
        Err(error) => {
            let line = prescription.surfaces[error.surface - 1].line;
            cx.bad_file(file, format!("line {line}: {error}"));
            None
        }
    }
}

fn from_table(
    rows: Vec<At<Built<LensSurfaceKeys>>>,
    at: &Span<usize>,
    further: &Further,
    cx: &mut Reader<'_>,
) -> Option<(Prescription, LensAssembly)> {
    let places: Vec<Span<usize>> = rows.iter().map(|row| row.at.clone()).collect();
    let rows = rows.into_iter().map(|row| row.value.0).collect();
    let [low, high] = cx.range_nm?;
    let mut prescription = prescription(rows, (low + high) / 2.0);
    further.coat(&mut prescription);
    let is_valid = prescription
        .validate()
        .map_err(|e| (e.surface, e.to_string()));
    if is_valid.is_ok() {
        further.close_stop(&mut prescription, cx)?;
    }
    let made = is_valid.and_then(|()| {
        let error = |e: LensBuildError| (Some(e.surface), e.to_string());
        LensAssembly::new(&prescription, further.barrel).map_err(error)
    });
    match made {
        Ok(assembly) => Some((prescription, assembly)),
        Err((surface, message)) => {
            let place = surface.and_then(|i| places.get(i - 1));
            cx.conflict(place.unwrap_or(at), message);
            None
        }
    }
}

/// The prescription of a table, with an image behind it.
fn prescription(rows: Vec<Row>, nm: f64) -> Prescription {
    let mut surfaces: Vec<Surface> = Vec::with_capacity(rows.len() + 1);
    let mut start = None;
    let mut length = 0.0;
    for Row {
        mut surface,
        start: own,
    } in rows
    {
        let moves = own.decenter != DVec3::ZERO || own.tilt_deg != DVec3::ZERO;
        if moves {
            surface.before.push(own);
            (start, length) = (Some(own), 0.0);
        }
        if surface.medium.is_air()
            && let Some(moved) = start.take()
        {
            // back to the axis, as far along it as the group is long
            surface.after.push(Break {
                decenter: DVec3::ZERO,
                tilt_deg: DVec3::ZERO,
                reversed: false,
                thickness: -length,
            });
            surface.after.push(Break {
                thickness: length,
                ..moved.inverse()
            });
        } else {
            length += surface.thickness;
        }
        surfaces.push(surface);
    }
    surfaces.push(Surface::new(
        Profile::PLANE,
        Aperture::OPEN,
        0.0,
        Medium::air(),
    ));
    Prescription {
        name: String::new(),
        notes: Vec::new(),
        wavelengths: vec![Wavelength { nm, weight: 1.0 }],
        primary: 0,
        // of what light there is, the scene decides
        aperture: SystemAperture::EntrancePupil(1.0),
        field_kind: FieldKind::AngleDeg,
        fields: vec![[0.0, 0.0]],
        object_distance: None,
        object_medium: Medium::air(),
        surfaces,
        stop: 0,
    }
}

/// `[[lens]]`, each with its place.
#[derive(Debug, Default)]
pub struct Lenses(pub Vec<At<PlacedLens>>);

impl Lenses {
    /// The lens of a name.
    ///
    /// # Errors
    /// There is none, in words.
    pub fn find(&self, name: &str) -> Result<&PlacedLens, String> {
        let found = self.0.iter().find(|lens| lens.value.name == name);
        found.map(|lens| &lens.value).ok_or_else(|| {
            let names: Vec<String> = self
                .0
                .iter()
                .map(|lens| format!("\"{}\"", lens.value.name))
                .collect();
            format!(
                "lens \"{name}\" is not defined (allowed: {})",
                if names.is_empty() {
                    "the scene has no [[lens]]".to_owned()
                } else {
                    names.join(", ")
                }
            )
        })
    }
}

impl Value for Lenses {
    fn form() -> Form {
        Form::List(Box::new(Form::Table(LensKeys::KIND)))
    }

    fn read(node: Node<'_>, spec: Spec, cx: &mut Reader<'_>) -> Option<Self> {
        let mut lenses = Vec::new();
        let mut names = BTreeSet::new();
        for (i, item) in items(node, "an array", cx)?.into_iter().enumerate() {
            let Some(Built((name, mut lens))) = Built::<LensKeys>::read(item, spec, cx) else {
                continue;
            };
            lens.name = name.unwrap_or_else(|| format!("lens {i}"));
            if !names.insert(lens.name.clone()) {
                let at = item.get_ref().get("name").map_or(item.span(), |n| n.span());
                cx.conflict(&at, format!("lens \"{}\" is defined twice", lens.name));
            }
            lenses.push(At {
                value: lens,
                at: item.span(),
            });
        }
        Some(Self(lenses))
    }

    fn absent(_: &Table<'_>, _: Spec, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self::default())
    }

    fn default_text() -> Option<String> {
        Some("none".to_owned())
    }
}
