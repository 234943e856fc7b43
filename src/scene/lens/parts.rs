//! Parts of a lens: caps, edges, flanges, diaphragms, mirrors and the barrel.

use super::rims::ALIGNED;
use super::{LensAssembly, LensBuildError, Part, Role};
use crate::geometry::{LensShape, Shape};
use crate::optics::prescription::Frame;
use crate::optics::{Aperture, Interaction, LensSurface, Outline, Prescription};
use crate::spectrum::Ior;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Outer radius of a diaphragm, in units of the widest aperture.
const DIAPHRAGM: f64 = 1.25;

/// A lens on its way to parts.
pub(super) struct Builder<'a> {
    lens: &'a Prescription,
    pub(super) barrel: Option<f64>,
    frames: Vec<Frame>,
    /// Medium after each surface, by index; `None`: air.
    after: Vec<Option<usize>>,
    /// Whether light goes along +z after each surface.
    pub(super) forward: Vec<bool>,
    widest: f64,
    out: LensAssembly,
}

pub(super) fn bad<T>(i: usize, message: impl Into<String>) -> Result<T, LensBuildError> {
    Err(LensBuildError {
        surface: i + 1,
        message: message.into(),
    })
}

impl<'a> Builder<'a> {
    pub(super) fn new(lens: &'a Prescription, barrel: Option<f64>) -> Result<Self, LensBuildError> {
        let mut glasses: Vec<Ior> = Vec::new();
        let mut after: Vec<Option<usize>> = Vec::new();
        let (mut forward, mut sense) = (Vec::new(), true);
        let mut widest = 0.0f64;
        if !lens.object_medium.is_air() {
            return bad(0, "the lens begins in glass (allowed: air)");
        }
        for (i, surface) in lens.surfaces[..=lens.last()].iter().enumerate() {
            let is_mirror = surface.interaction == Interaction::Reflect;
            if is_mirror && i > 0 && after[i - 1].is_some() {
                return bad(i, "a mirror behind glass (allowed: a mirror in air)");
            }
            let ior = (!is_mirror && !surface.medium.is_air()).then_some(&surface.medium.ior);
            after.push(ior.map(|ior| {
                let known = glasses.iter().position(|g| g == ior);
                known.unwrap_or_else(|| {
                    glasses.push(ior.clone());
                    glasses.len() - 1
                })
            }));
            sense ^= is_mirror;
            forward.push(sense);
            let extent = surface.shape.aperture.extent();
            if extent.is_finite() {
                widest = widest.max(extent);
            }
        }
        if after.last().is_some_and(Option::is_some) {
            return bad(lens.last(), "the lens ends in glass (allowed: air)");
        }
        let parts = Vec::new();
        Ok(Self {
            lens,
            barrel,
            frames: lens.frames(),
            after,
            forward,
            widest,
            out: LensAssembly {
                parts,
                glasses,
                coatings: Vec::new(),
            },
        })
    }

    pub(super) fn build(mut self) -> Result<LensAssembly, LensBuildError> {
        if let Some(radius) = self.barrel {
            self.check_barrel(radius)?;
        }
        let mut first = 0;
        while first < self.after.len() {
            let glass = self.after[first..].iter().take_while(|m| m.is_some());
            let last = first + glass.count();
            if last == first {
                self.alone(first)?;
            } else {
                self.group(first..=last)?;
            }
            first = last + 1;
        }
        if let Some(radius) = self.barrel {
            self.tube(radius)?;
        }
        Ok(self.out)
    }

    pub(super) fn surface(&self, i: usize) -> &'a LensSurface {
        &self.lens.surfaces[i].shape
    }

    fn frame(&self, i: usize) -> DAffine3 {
        DAffine3::from_mat3_translation(self.frames[i].rotation, self.frames[i].origin)
    }

    fn before(&self, i: usize) -> Option<usize> {
        i.checked_sub(1).and_then(|i| self.after[i])
    }

    fn add(&mut self, name: String, shape: Shape, to_lens: DAffine3, role: Role) {
        self.out.parts.push(Part {
            name,
            shape,
            to_lens,
            role,
        });
    }

    /// The surface `i` within an outline, as a part of a role.
    fn cap(&mut self, i: usize, outline: Outline, role: Role) -> Result<(), LensBuildError> {
        let LensSurface {
            profile, aperture, ..
        } = self.surface(i);
        let aperture = Aperture {
            outline,
            ..*aperture
        };
        let Some(shape) = LensShape::new(LensSurface::new(profile.clone(), aperture)) else {
            return bad(
                i,
                "no semi-diameter (needed of every surface between different media)",
            );
        };
        let name = match role {
            Role::Black => format!("obscuration of surface {}", i + 1),
            _ => format!("surface {}", i + 1),
        };
        self.add(name, Shape::Lens(Arc::new(shape)), self.frame(i), role);
        Ok(())
    }

    /// The clear part of a surface, and what is black within.
    fn clear_part(&mut self, i: usize, role: Role) -> Result<(), LensBuildError> {
        let outline = self.surface(i).aperture.outline;
        self.cap(i, outline, role)?;
        match outline {
            Outline::Annulus { inner, .. } if inner > 0.0 && role != Role::Mirror => {
                self.cap(i, Outline::Circle { radius: inner }, Role::Black)
            }
            _ => Ok(()),
        }
    }

    /// A surface with air on both sides.
    fn alone(&mut self, i: usize) -> Result<(), LensBuildError> {
        if self.lens.surfaces[i].interaction == Interaction::Reflect {
            return self.clear_part(i, Role::Mirror);
        }
        let aperture = self.surface(i).aperture;
        if aperture.outline == Outline::Open {
            return Ok(());
        }
        if !self.surface(i).profile.is_plane() {
            return bad(
                i,
                "a curved diaphragm (allowed: flat surfaces between equal media)",
            );
        }
        let outer = self.barrel.unwrap_or(self.widest * DIAPHRAGM);
        self.diaphragm(i, outer)
    }

    /// A black plane with the aperture of a surface as hole.
    fn diaphragm(&mut self, i: usize, outer: f64) -> Result<(), LensBuildError> {
        let aperture = self.surface(i).aperture;
        let name = format!("diaphragm of surface {}", i + 1);
        let at = self.frame(i);
        match aperture.outline {
            Outline::Open => {}
            Outline::Circle { radius } => {
                self.ring(name, at, aperture.center, [radius, outer], Role::Black);
            }
            Outline::Annulus {
                inner,
                outer: radius,
            } => {
                self.ring(
                    name.clone(),
                    at,
                    aperture.center,
                    [radius, outer],
                    Role::Black,
                );
                if inner > 0.0 {
                    self.ring(name, at, aperture.center, [0.0, inner], Role::Black);
                }
            }
            Outline::Rectangle { half } => {
                if half.max_element() >= outer {
                    return bad(
                        i,
                        format!("the hole of the diaphragm is wider than {outer} mm"),
                    );
                }
                // beside the hole over the whole height, above and below it over its width
                let [x, y] = [half.x, half.y].map(|h| ((outer + h) / 2.0, (outer - h) / 2.0));
                for side in [-1.0, 1.0] {
                    let beside = (DVec2::new(side * x.0, 0.0), DVec2::new(x.1, outer));
                    let above = (DVec2::new(0.0, side * y.0), DVec2::new(half.x, y.1));
                    for (middle, size) in [beside, above] {
                        let map = DMat3::from_diagonal(size.extend(1.0));
                        let middle = (middle + aperture.center).extend(0.0);
                        let map = at * DAffine3::from_mat3_translation(map, middle);
                        self.add(name.clone(), Shape::Quad, map, Role::Black);
                    }
                }
            }
        }
        Ok(())
    }

    /// A flat ring about a point of the plane z = 0 of a map; nothing if it has no width.
    fn ring(
        &mut self,
        name: String,
        at: DAffine3,
        center: DVec2,
        [inner, outer]: [f64; 2],
        role: Role,
    ) {
        if inner < outer {
            let map = DMat3::from_diagonal(DVec3::splat(outer));
            let to_lens = at * DAffine3::from_mat3_translation(map, center.extend(0.0));
            let inner = inner / outer;
            self.add(name, Shape::Disk { inner }, to_lens, role);
        }
    }

    /// The coating of a surface, by index.
    fn coating(&mut self, i: usize) -> Result<Option<usize>, LensBuildError> {
        let Some(stack) = &self.lens.surfaces[i].coating else {
            return Ok(None);
        };
        if stack.backing.is_some() {
            let name = &stack.name;
            return bad(
                i,
                format!("the coating {name} is a mirror on a metal, which lets nothing through"),
            );
        }
        // it is given as light meets it, which comes from -z where it goes along +z
        let from_above = if self.forward[i] {
            stack.reversed()
        } else {
            stack.clone()
        };
        let coatings = &mut self.out.coatings;
        let known = coatings.iter().position(|c| **c == from_above);
        Ok(Some(known.unwrap_or_else(|| {
            coatings.push(Arc::new(from_above));
            coatings.len() - 1
        })))
    }

    /// Surfaces with glass between them, and the edge around them.
    fn group(&mut self, range: RangeInclusive<usize>) -> Result<(), LensBuildError> {
        let (first, last) = (*range.start(), *range.end());
        if let Some(i) = range
            .clone()
            .find(|&i| self.surface(i).aperture.outline == Outline::Open)
        {
            return bad(i, "no semi-diameter (needed of every surface of glass)");
        }
        for i in range.clone() {
            let (ahead, behind) = (self.after[i], self.before(i));
            if ahead != behind {
                let (above, below) = if self.forward[i] {
                    (ahead, behind)
                } else {
                    (behind, ahead)
                };
                let coating = self.coating(i)?;
                let role = Role::Interface {
                    above,
                    below,
                    coating,
                };
                self.clear_part(i, role)?;
            }
        }
        let to_first = self.frame(first).inverse();
        let mut rims = Vec::new();
        for i in range.clone() {
            let at = to_first * self.frame(i);
            let off = at.translation.truncate().length();
            let tilt = (at.matrix3.z_axis - DVec3::Z).length();
            if off.max(tilt) > ALIGNED {
                return bad(
                    i,
                    "glass between surfaces of different axes (allowed: decenters and tilts in air)",
                );
            }
            rims.push(self.rim(i, at.translation.z));
        }
        let center = self.surface(first).aperture.center;
        if let Some(i) = range
            .clone()
            .find(|&i| self.surface(i).aperture.center != center)
        {
            return bad(
                i,
                "the aperture has another center than that of the surface before it in the same \
                 glass (allowed: the same)",
            );
        }
        let low = rims.iter().map(|r| r.low).fold(f64::INFINITY, f64::min);
        let high = rims
            .iter()
            .map(|r| r.high)
            .fold(f64::NEG_INFINITY, f64::max);
        let at = self.frame(first);
        let name = format!("edge of surfaces {} to {}", first + 1, last + 1);
        if let Outline::Rectangle { half } = self.surface(first).aperture.outline {
            let same = Outline::Rectangle { half };
            if let Some(i) = range
                .clone()
                .find(|&i| self.surface(i).aperture.outline != same)
            {
                return bad(i, "a rectangle and another aperture on the same glass");
            }
            let (middle, height) = ((low + high) / 2.0, (high - low) / 2.0);
            for axis in 0..2 {
                for side in [-1.0, 1.0] {
                    let mut normal = DVec3::ZERO;
                    normal[axis] = side;
                    let mut along = DVec3::ZERO;
                    along[1 - axis] = half[1 - axis];
                    let map = DMat3::from_cols(along, DVec3::Z * height, normal);
                    let place = center.extend(middle) + normal * half[axis];
                    let map = at * DAffine3::from_mat3_translation(map, place);
                    self.add(name.clone(), Shape::Quad, map, Role::Edge);
                }
            }
            return Ok(());
        }
        let radius = rims.iter().map(|r| r.radius).fold(0.0, f64::max);
        if radius == 0.0 || rims.iter().any(|r| r.radius == 0.0) {
            return bad(first, "a rectangle and another aperture on the same glass");
        }
        for (k, i) in range.enumerate() {
            self.check_flange(&rims, k, i, first, radius)?;
            let z = rims[k].low;
            // in a barrel, the first surface is also what holds the group
            let outer = match self.barrel {
                Some(barrel) if k == 0 => barrel,
                _ => radius,
            };
            if outer > rims[k].radius {
                let at = at * DAffine3::from_translation(DVec3::Z * z);
                let name = format!("flange of surface {}", i + 1);
                self.ring(name, at, center, [rims[k].radius, outer], Role::Edge);
            }
        }
        if high > low {
            let size = DVec3::new(radius, radius, (high - low) / 2.0);
            let place = center.extend((low + high) / 2.0);
            let map = DAffine3::from_mat3_translation(DMat3::from_diagonal(size), place);
            self.add(name, Shape::Cylinder, at * map, Role::Edge);
        }
        Ok(())
    }

    fn check_barrel(&self, radius: f64) -> Result<(), LensBuildError> {
        for i in 0..self.after.len() {
            let frame = &self.frames[i];
            let tilt = (frame.rotation.z_axis - DVec3::Z).length();
            let off = frame.origin.truncate().length();
            let is_round = self.surface(i).aperture.radius().is_some()
                || self.surface(i).aperture.outline == Outline::Open;
            if off.max(tilt) > ALIGNED
                || self.surface(i).aperture.center != DVec2::ZERO
                || !is_round
            {
                return bad(
                    i,
                    "not about the axis (allowed with a barrel: round and centered)",
                );
            }
            if self.lens.surfaces[i].interaction == Interaction::Reflect {
                return bad(i, "a mirror in a barrel (allowed: refraction)");
            }
        }
        if radius < self.widest {
            return bad(
                0,
                format!(
                    "a barrel of radius {radius} mm around apertures of {} mm (allowed: at least \
                     that)",
                    self.widest
                ),
            );
        }
        Ok(())
    }

    /// The barrel itself, from the first to the last rim.
    fn tube(&mut self, radius: f64) -> Result<(), LensBuildError> {
        let rims = (0..self.after.len()).map(|i| self.rim(i, self.frames[i].origin.z));
        let ends = rims
            .filter(|r| r.radius > 0.0)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| {
                (low.min(r.low), high.max(r.high))
            });
        if ends.1 > ends.0 {
            let size = DVec3::new(radius, radius, (ends.1 - ends.0) / 2.0);
            let middle = DVec3::Z * ((ends.0 + ends.1) / 2.0);
            let map = DAffine3::from_mat3_translation(DMat3::from_diagonal(size), middle);
            self.add("barrel".to_owned(), Shape::Cylinder, map, Role::Black);
        }
        Ok(())
    }
}
