//! Which images are kept besides XYZ: spectral bins, one image per strategy, one per path class,
//! the share of regularized strategies.

use super::expression::{PathExpression, PathText};
use crate::film::{Crop, Film, Filter, Sources};
use crate::spectrum::{LaneResponse, SensorResponse, SpectralChannels};
use crate::transport::subpath::Event;
use crate::transport::{Contribution, Target};
use std::collections::BTreeMap;
use std::sync::{PoisonError, RwLock};

/// Outputs that a render is asked to keep.
#[derive(Clone, Debug)]
pub struct OutputRequest {
    /// Response of the main image (XYZ, relative or photometric).
    pub response: SensorResponse,
    /// Channels of the spectral image, if one is kept.
    pub spectral: Option<SpectralChannels>,
    /// Keep one image per strategy.
    pub strategies: bool,
    /// Keep one image per expression over path classes.
    pub classes: Vec<PathExpression>,
    /// Keep the image of strategies that join at specular vertices, and the rest.
    pub shares: bool,
    /// Keep the table of classes and strategies.
    pub class_table: bool,
}

impl Default for OutputRequest {
    fn default() -> Self {
        Self {
            response: SensorResponse::Xyz,
            spectral: None,
            strategies: false,
            classes: Vec::new(),
            shares: false,
            class_table: false,
        }
    }
}

/// Images by (s, t, whether it is a merge).
pub type StrategyFilms = BTreeMap<(u32, u32, &'static str), Film>;

/// The images a render keeps.
#[derive(Debug)]
pub struct Outputs {
    /// Response of the main image.
    pub response: SensorResponse,
    /// XYZ.
    pub image: Film,
    /// Spectral bins and lines.
    pub spectral: Option<(SpectralChannels, Film)>,
    /// XYZ per strategy (s, t) and merge (whether it is one comes last), as they are met.
    pub strategies: Option<RwLock<StrategyFilms>>,
    /// XYZ per class expression.
    pub classes: Vec<(PathExpression, Film)>,
    /// XYZ of strategies that join at no specular vertex, and of those that do.
    pub shares: Option<[Film; 2]>,
    crop: Crop,
    filter: Filter,
    exponent: i32,
}

impl Outputs {
    /// Empty images whose sums have this exponent ([`Film::with_exponent`]). Those of all light, of
    /// spectra and of classes are summed up by `sources` too, where there are some.
    #[must_use]
    pub fn new(
        request: &OutputRequest,
        crop: Crop,
        filter: Filter,
        exponent: i32,
        sources: Option<&Sources>,
    ) -> Self {
        let film = |channels| Film::new(crop, filter, channels).with_exponent(exponent);
        let summed = |channels| match sources {
            Some(sources) => film(channels).with_sources(sources.clone()),
            None => film(channels),
        };
        Self {
            response: request.response,
            image: summed(3),
            spectral: request
                .spectral
                .clone()
                .map(|channels| (channels.clone(), summed(channels.count()))),
            strategies: request.strategies.then(RwLock::default),
            classes: request
                .classes
                .iter()
                .map(|r| (r.clone(), summed(3)))
                .collect(),
            shares: request.shares.then(|| [film(3), film(3)]),
            crop,
            filter,
            exponent,
        }
    }

    /// Adds a sample's contributions, of paths with these vertices, to everything but the main
    /// image.
    pub fn add_extras(
        &self,
        (contributions, events): (&[Contribution], &[Event]),
        response: &LaneResponse,
        pixel: (u32, u32),
        half: usize,
        values: &mut Vec<f64>,
    ) {
        let of_paths =
            self.strategies.is_some() || !self.classes.is_empty() || self.shares.is_some();
        if self.spectral.is_none() && !of_paths {
            return;
        }
        for contribution in contributions {
            if let Some((channels, film)) = &self.spectral {
                values.clear();
                values.resize(channels.count(), 0.0);
                channels.add(&response.wavelengths, &contribution.lanes, values);
                add(film, contribution.target, pixel, half, values);
            }
            if !of_paths {
                continue;
            }
            let xyz = response.xyz(&contribution.lanes);
            self.add_strategy(contribution, pixel, half, &xyz);
            if let Some(shares) = &self.shares {
                let film = &shares[usize::from(contribution.regularized > 0)];
                add(film, contribution.target, pixel, half, &xyz);
            }
            if !self.classes.is_empty() {
                let [first, end] = contribution.events.map(|i| i as usize);
                let mut path = PathText::new(contribution.class, &events[first..end]);
                for (expression, film) in &self.classes {
                    if path.matches(expression) {
                        add(film, contribution.target, pixel, half, &xyz);
                    }
                }
            }
        }
    }

    /// The films whose sums parts hold: the image, then the spectral one, if it is kept.
    pub fn part_films(&self) -> impl Iterator<Item = &Film> {
        let spectral = self.spectral.as_ref().map(|(_, film)| film);
        std::iter::once(&self.image).chain(spectral)
    }

    /// The same, to be added to.
    pub fn part_films_mut(&mut self) -> impl Iterator<Item = &mut Film> {
        let spectral = self.spectral.as_mut().map(|(_, film)| film);
        std::iter::once(&mut self.image).chain(spectral)
    }

    /// Moves everything of other images of the same request into these, and leaves those empty.
    pub fn take(&mut self, other: &mut Self) {
        self.image.take(&mut other.image);
        if let (Some((_, ours)), Some((_, theirs))) = (&mut self.spectral, &mut other.spectral) {
            ours.take(theirs);
        }
        let (crop, filter, exponent) = (self.crop, self.filter, self.exponent);
        if let (Some(ours), Some(theirs)) = (&mut self.strategies, &mut other.strategies) {
            let ours = ours.get_mut().unwrap_or_else(PoisonError::into_inner);
            let theirs = theirs.get_mut().unwrap_or_else(PoisonError::into_inner);
            for (key, film) in theirs {
                let empty = || Film::new(crop, filter, 3).with_exponent(exponent);
                ours.entry(*key).or_insert_with(empty).take(film);
            }
        }
        for ((_, ours), (_, theirs)) in self.classes.iter_mut().zip(&mut other.classes) {
            ours.take(theirs);
        }
        if let (Some(ours), Some(theirs)) = (&mut self.shares, &mut other.shares) {
            for (ours, theirs) in ours.iter_mut().zip(theirs) {
                ours.take(theirs);
            }
        }
    }

    fn add_strategy(
        &self,
        contribution: &Contribution,
        pixel: (u32, u32),
        half: usize,
        xyz: &[f64; 3],
    ) {
        let Some(strategies) = &self.strategies else {
            return;
        };
        let key = (contribution.s, contribution.t, contribution.mark());
        {
            // a poisoned lock means another thread is already unwinding; the sums stay consistent
            let films = strategies.read().unwrap_or_else(PoisonError::into_inner);
            if let Some(film) = films.get(&key) {
                add(film, contribution.target, pixel, half, xyz);
                return;
            }
        }
        let mut films = strategies.write().unwrap_or_else(PoisonError::into_inner);
        let film = films
            .entry(key)
            .or_insert_with(|| Film::new(self.crop, self.filter, 3).with_exponent(self.exponent));
        add(film, contribution.target, pixel, half, xyz);
    }
}

fn add(film: &Film, target: Target, pixel: (u32, u32), half: usize, values: &[f64]) {
    match target {
        Target::OwnPixel => film.add_pixel(pixel.0, pixel.1, half, values),
        Target::Splat(raster) => film.add_splat(raster, pixel, half, values),
    }
}
