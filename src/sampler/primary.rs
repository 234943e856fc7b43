//! Points of primary sample space that a Markov chain moves through: all numbers of a sample, each
//! changed only when a draw asks for it (Kelemen, Szirmay-Kalos, Antal, Csonka 2002).
//!
//! A point is its origin and the small steps accepted since, and every step is a pure function of
//! its key and the name of the draw. So a number has the same value whenever and however often it
//! is asked for: what is remembered saves time and decides nothing, and a step that is rejected
//! leaves nothing to undo.

use super::{Draw, Sampler};
use crate::math::hash::{combine, random_bits, unit_f64};
use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::mem;

/// Least lengths of small steps of a number; the largest length is 1/64 (Kelemen et al.).
const OCTAVES: [f64; 4] = [1.0 / 128.0, 1.0 / 256.0, 1.0 / 512.0, 1.0 / 1024.0];

/// Name of numbers: a draw, or what has a sequence of its own.
#[derive(Clone, Copy, Debug)]
pub(super) enum Name {
    Draw(Draw),
    Wavelength,
    Time,
}

impl Name {
    /// A number that no other name has; the last two bits are free.
    fn code(self) -> u64 {
        match self {
            Self::Draw(draw) => draw.code(),
            Self::Wavelength => 61 << 58,
            Self::Time => 62 << 58,
        }
    }
}

/// Pixels that a chain visits.
#[derive(Clone, Copy, Debug)]
pub struct Pixels {
    /// First column and row.
    pub first: [u32; 2],
    /// Numbers of columns and rows, at least 1.
    pub size: [u32; 2],
}

/// The place where a chain began, or to where its last large step has led.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// A sample of a pixel, and its wavelength number.
    Sample(Sampler<'static>, (u32, u32), f64),
    /// Numbers independent of everything before.
    Fresh(u64),
}

/// A step that is neither accepted nor rejected yet.
#[derive(Clone, Copy, Debug, Default)]
enum Trial {
    #[default]
    None,
    Small(u64),
    Large(u64),
}

/// Numbers of a name, and how many of the accepted steps are in them.
#[derive(Clone, Copy, Debug)]
struct Numbers {
    values: [f64; 4],
    steps: usize,
}

/// Hash of a place, which is one already.
#[derive(Clone, Copy, Debug, Default)]
struct PlaceHasher(u64);

impl Hasher for PlaceHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(b.into()));
    }

    fn write_u64(&mut self, place: u64) {
        self.0 = self.0.rotate_left(8) ^ place;
    }
}

/// Point of primary sample space, and a step from it that is tried.
#[derive(Debug)]
pub struct Primary {
    origin: Origin,
    pixels: Pixels,
    /// Keys of the small steps accepted since the origin.
    steps: Vec<u64>,
    trial: Trial,
    /// By the hash of light sub-path and name that their steps are made of too.
    numbers: RefCell<HashMap<u64, Numbers, BuildHasherDefault<PlaceHasher>>>,
}

impl Primary {
    /// The point whose numbers are those of a sample of a pixel, one of `pixels`; `wavelength` is
    /// the sample's primary wavelength number.
    #[must_use]
    pub fn of_sample(
        sampler: Sampler<'static>,
        pixel: (u32, u32),
        wavelength: f64,
        pixels: Pixels,
    ) -> Self {
        Self {
            origin: Origin::Sample(sampler, pixel, wavelength),
            pixels,
            steps: Vec::new(),
            trial: Trial::None,
            numbers: RefCell::default(),
        }
    }

    /// Tries a small step: every number by 1/1024 to 1/64, beyond 1 on from 0. Each step of a chain
    /// needs a key of its own.
    pub fn try_small(&mut self, key: u64) {
        self.trial = Trial::Small(key);
    }

    /// Tries a point independent of this one.
    pub fn try_large(&mut self, key: u64) {
        self.trial = Trial::Large(key);
    }

    /// Goes to where the step leads that is tried.
    pub fn accept(&mut self) {
        match mem::take(&mut self.trial) {
            Trial::None => {}
            Trial::Small(key) => self.steps.push(key),
            Trial::Large(key) => {
                self.origin = Origin::Fresh(key);
                self.steps.clear();
                self.numbers.get_mut().clear();
            }
        }
    }

    /// Stays.
    pub fn reject(&mut self) {
        self.trial = Trial::None;
    }

    /// The numbers of the point that is tried, or of this one if none is.
    #[must_use]
    pub fn sampler(&self) -> Sampler<'_> {
        Sampler {
            key: 0,
            index: 0,
            scramble: 0,
            pass: 0,
            primary: Some(self),
        }
    }

    /// The pixel whose sample this is.
    #[must_use]
    pub fn pixel(&self) -> (u32, u32) {
        let [x, y] = self.on_film().0;
        let [x0, y0] = self.pixels.first;
        (x0 + x, y0 + y)
    }

    /// Numbers of a draw, for a light sub-path of the sample.
    pub(super) fn set(&self, path: u32, draw: Draw) -> [f64; 4] {
        match draw {
            Draw::Film => self.on_film().1,
            _ => self.numbers(path, Name::Draw(draw)),
        }
    }

    /// The one number of a name that is no draw.
    pub(super) fn number(&self, name: Name) -> f64 {
        self.numbers(0, name)[0]
    }

    /// Column and row from the first, and the numbers of [`Draw::Film`]: the film position is two
    /// numbers over all pixels, of which a sample sees its place within its pixel.
    fn on_film(&self) -> ([u32; 2], [f64; 4]) {
        let mut numbers = self.numbers(0, Name::Draw(Draw::Film));
        let mut pixel = [0; 2];
        for (i, size) in self.pixels.size.into_iter().enumerate() {
            let along = numbers[i] * f64::from(size);
            pixel[i] = (along as u32).min(size - 1);
            numbers[i] = below_one(along - f64::from(pixel[i]));
        }
        (pixel, numbers)
    }

    fn numbers(&self, path: u32, name: Name) -> [f64; 4] {
        let place = combine(u64::from(path), name.code());
        if let Trial::Large(key) = self.trial {
            return fresh(key, place);
        }
        let mut remembered = self.numbers.borrow_mut();
        let Numbers { values, steps } = remembered.entry(place).or_insert_with(|| Numbers {
            values: self.at_origin(path, name, place),
            steps: 0,
        });
        for key in &self.steps[*steps..] {
            *values = stepped(*values, *key, place);
        }
        *steps = self.steps.len();
        match self.trial {
            Trial::Small(key) => stepped(*values, key, place),
            _ => *values,
        }
    }

    fn at_origin(&self, path: u32, name: Name, place: u64) -> [f64; 4] {
        let (sampler, pixel, wavelength) = match self.origin {
            Origin::Fresh(key) => return fresh(key, place),
            Origin::Sample(sampler, pixel, wavelength) => (sampler, pixel, wavelength),
        };
        match name {
            Name::Wavelength => [wavelength; 4],
            Name::Time => [sampler.time(); 4],
            Name::Draw(Draw::Film) => {
                let Pixels { first, size } = self.pixels;
                let mut numbers = sampler.set(Draw::Film);
                for (i, pixel) in [pixel.0, pixel.1].into_iter().enumerate() {
                    let along = f64::from(pixel - first[i]) + numbers[i];
                    numbers[i] = below_one(along / f64::from(size[i]));
                }
                numbers
            }
            Name::Draw(draw) => sampler.fork(path).set(draw),
        }
    }
}

/// The largest number below 1, where rounding has led there or beyond.
fn below_one(u: f64) -> f64 {
    u.min(1.0 - 0.5 * f64::EPSILON)
}

fn fresh(key: u64, place: u64) -> [f64; 4] {
    let key = combine(key, place);
    std::array::from_fn(|i| unit_f64(random_bits(key, i as u64)))
}

/// Numbers after a small step, of any direction and as often in each of the four octaves of
/// lengths: evenly there, where Kelemen et al. have a density in proportion to 1/length.
fn stepped(mut values: [f64; 4], key: u64, place: u64) -> [f64; 4] {
    let key = combine(key, place);
    for (i, value) in values.iter_mut().enumerate() {
        let bits = random_bits(key, i as u64);
        // the lowest bits are none of those of the number
        let octave = OCTAVES[(bits & 3) as usize];
        let length = octave * (1.0 + unit_f64(bits));
        let to = if bits & 4 == 0 {
            *value + length
        } else {
            *value - length
        };
        *value = below_one(to - to.floor());
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXELS: Pixels = Pixels {
        first: [3, 5],
        size: [7, 11],
    };
    const PIXEL: (u32, u32) = (8, 6);

    fn point() -> Primary {
        Primary::of_sample(Sampler::new(1, 0, 77, 4), PIXEL, 0.625, PIXELS)
    }

    /// Every kind of number, of the sample and of a second light sub-path.
    fn all(point: &Primary) -> Vec<f64> {
        let sampler = point.sampler();
        let draws = [Draw::Film, Draw::Camera(1), Draw::Light(20), Draw::Pairs];
        let numbers = draws.into_iter().flat_map(|draw| sampler.set(draw));
        let mut all: Vec<f64> = numbers.collect();
        all.extend(sampler.fork(1).set(Draw::LightStart));
        all.push(sampler.number(Draw::Roulette(2, 3, 1)));
        all.extend([sampler.wavelength(PIXEL, (9, 9), 1), sampler.time()]);
        all
    }

    #[test]
    fn a_chain_starts_at_the_numbers_of_its_sample() {
        let (point, sample) = (point(), Sampler::new(1, 0, 77, 4));
        let sampler = point.sampler();
        assert_eq!(point.pixel(), PIXEL);
        let film = sampler.set(Draw::Film);
        for (found, expected) in film.into_iter().zip(sample.set(Draw::Film)) {
            // the place in the pixel has been through the place on the film
            assert!((found - expected).abs() < 1e-14);
        }
        assert_eq!(sampler.set(Draw::Camera(3)), sample.set(Draw::Camera(3)));
        let forked = [sampler.fork(2), sample.fork(2)].map(|s| s.set(Draw::LightStart));
        assert_eq!(forked[0], forked[1]);
        let number = Draw::Roulette(1, 4, 2);
        assert_eq!(sampler.number(number), sample.number(number));
        let own = (sampler.wavelength(PIXEL, (9, 9), 1), sampler.time());
        assert_eq!(own, (0.625, sample.time()));
    }

    #[test]
    fn numbers_do_not_depend_on_when_they_are_asked_for() {
        let (mut eager, mut lazy) = (point(), point());
        for i in 0..200 {
            for point in [&mut eager, &mut lazy] {
                // a large step now and then, and every third is rejected
                if i % 40 == 39 {
                    point.try_large(i);
                } else {
                    point.try_small(i);
                }
            }
            let tried = all(&eager);
            let before = eager.trial;
            if i % 3 == 0 {
                eager.reject();
                lazy.reject();
                assert_ne!(all(&eager), tried, "{before:?}");
            } else {
                eager.accept();
                lazy.accept();
                assert_eq!(all(&eager), tried, "{before:?}");
            }
        }
        assert_eq!(all(&eager), all(&lazy));
        assert_eq!(eager.pixel(), lazy.pixel());
    }

    #[test]
    fn a_rejected_step_leaves_nothing() {
        let mut point = point();
        let before = all(&point);
        point.try_small(1);
        assert!(all(&point).iter().zip(&before).all(|(a, b)| a != b));
        point.reject();
        assert_eq!(all(&point), before);
        point.try_large(1);
        let large = all(&point);
        assert!(large.iter().zip(&before).all(|(a, b)| a != b));
        point.reject();
        assert_eq!(all(&point), before);
        point.try_large(1);
        point.accept();
        assert_eq!(all(&point), large);
    }

    #[test]
    fn small_steps_are_small_and_go_both_ways() {
        let count = 40_000_u64;
        let (mut up, mut octaves) = (0, [0; 4]);
        for i in 0..count {
            let from = [0.0, 1.0 - 0.5 * f64::EPSILON, 0.5, 0.25];
            for (from, to) in from.into_iter().zip(stepped(from, i, 9)) {
                assert!((0.0..1.0).contains(&to));
                let step = (to - from + 0.5).rem_euclid(1.0) - 0.5;
                let length = step.abs() * (1.0 + 1e-9);
                assert!((1.0 / 1024.0..=1.0 / 63.99).contains(&length), "{step}");
                up += u32::from(step > 0.0);
                octaves[(-(length * 64.0).log2()).max(0.0) as usize] += 1;
            }
        }
        // binomial with 4 count draws: 5 standard deviations
        let all = 4.0 * count as f64;
        let is_near = |n: f64, p: f64| (n - p * all).abs() < 5.0 * (all * p * (1.0 - p)).sqrt();
        assert!(is_near(f64::from(up), 0.5), "{up}");
        assert!(
            octaves.iter().all(|&n| is_near(f64::from(n), 0.25)),
            "{octaves:?}"
        );
    }
}
