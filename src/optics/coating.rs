//! Thin film coatings by the characteristic matrix.
//!
//! Each layer has the phase thickness delta = 2 pi N d cos(theta) / lambda and the matrix [cos
//! delta, -i sin delta / eta; -i eta sin delta, cos delta] for fields exp(-i omega t) and N = n + i
//! k, with the admittance eta = N cos(theta) for s and N / cos(theta) for p (Macleod, Thin-Film
//! Optical Filters, 4th ed., chapter 2; Born and Wolf, Principles of Optics, section 1.6). Layers
//! that absorb much are kept from overflow by a common factor.

use super::Polarization;
use crate::spectrum::Ior;
use num_complex::Complex64;
use std::f64::consts::TAU;

/// Thickness of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thickness {
    /// Geometric, nanometers.
    Nm(f64),
    /// Optical, in quarters of a wavelength at normal incidence.
    QuarterWaves {
        /// How many quarters.
        count: f64,
        /// The wavelength in vacuum, nanometers.
        at_nm: f64,
    },
}

/// One layer of a stack.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Material, n and k.
    pub ior: Ior,
    /// How thick it is.
    pub thickness: Thickness,
}

impl Layer {
    /// Geometric thickness, nanometers.
    #[must_use]
    pub fn thickness_nm(&self) -> f64 {
        match self.thickness {
            Thickness::Nm(nm) => nm,
            Thickness::QuarterWaves { count, at_nm } => 0.25 * count * at_nm / self.ior.n(at_nm),
        }
    }
}

/// A stack of layers, in the order in which light meets them.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// Name.
    pub name: String,
    /// The layers.
    pub layers: Vec<Layer>,
    /// Material behind the layers in place of the glass: the metal of a front surface mirror.
    pub backing: Option<Ior>,
}

/// Parts of the incident power: reflected, transmitted, absorbed in the layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Reflectance.
    pub r: f64,
    /// Transmittance, into the last medium.
    pub t: f64,
    /// Absorptance of the layers, from the power that flows in at the first interface and out at
    /// the last.
    pub a: f64,
}

impl Response {
    /// That of layers that absorb nothing, from those to s and p.
    #[must_use]
    pub fn of_clear([s, p]: [Self; 2], polarization: Polarization) -> Self {
        Self {
            r: polarization.of(s.r, p.r),
            t: polarization.of(s.t, p.t),
            a: 0.0,
        }
    }

    /// The mean of both.
    #[must_use]
    pub fn mean(self, other: Self) -> Self {
        Self {
            r: 0.5 * (self.r + other.r),
            t: 0.5 * (self.t + other.t),
            a: 0.5 * (self.a + other.a),
        }
    }
}

/// Layers between two media at one wavelength: indices and thicknesses in nanometers.
#[derive(Clone, Debug, PartialEq)]
pub struct Films {
    /// Index and thickness of each layer, in the order in which light meets them.
    pub layers: Vec<(Complex64, f64)>,
}

/// Cosine of the angle in a medium of index `n` from the conserved sine times index. Of both roots,
/// that of the wave that decays, or runs, away from the interface.
fn cosine(n: Complex64, n_sin: f64) -> Complex64 {
    let sine = Complex64::from(n_sin) / n;
    let cos = (1.0 - sine * sine).sqrt();
    let normal = n * cos;
    let outward = if normal.im.abs() > 1e-14 * normal.norm() {
        normal.im > 0.0
    } else {
        normal.re > 0.0
    };
    if outward { cos } else { -cos }
}

fn admittance(n: Complex64, cos: Complex64, is_p: bool) -> Complex64 {
    if is_p { n / cos } else { n * cos }
}

impl Films {
    /// Response to light from a medium of real index `n_in` onto a medium of index `n_out`;
    /// `cos_in` is the cosine of the angle of incidence, in 0..=1.
    #[must_use]
    pub fn response(
        &self,
        lambda_nm: f64,
        n_in: f64,
        n_out: Complex64,
        cos_in: f64,
        polarization: Polarization,
    ) -> Response {
        let layers = self.layers.iter().copied();
        response(&layers, lambda_nm, n_in, n_out, cos_in, polarization)
    }
}

/// Response of layers, indices and thicknesses in nanometers in the order in which light meets
/// them: see [`Films::response`].
#[must_use]
pub fn response(
    layers: &(impl DoubleEndedIterator<Item = (Complex64, f64)> + ExactSizeIterator + Clone),
    lambda_nm: f64,
    n_in: f64,
    n_out: Complex64,
    cos_in: f64,
    polarization: Polarization,
) -> Response {
    let is_clear = n_out.im == 0.0 && layers.clone().all(|(n, _)| n.im == 0.0);
    if is_clear {
        let clear = layers.clone();
        let clear = clear.map(|(n, nm)| (n.re, phase(nm, lambda_nm)));
        if let Some(found) = response_of_clear(clear, n_in, n_out.re, cos_in) {
            return Response::of_clear(found, polarization);
        }
    }
    let one = |is_p| response_of(layers.clone(), lambda_nm, n_in, n_out, cos_in, is_p);
    match polarization {
        Polarization::Average => one(false).mean(one(true)),
        Polarization::S => one(false),
        Polarization::P => one(true),
    }
}

/// Phase in vacuum over a thickness, both lengths in nanometers.
#[must_use]
#[inline]
pub fn phase(thickness_nm: f64, lambda_nm: f64) -> f64 {
    TAU * thickness_nm / lambda_nm
}

/// Responses to s and p of layers that absorb nothing, between media that do not either, in real
/// numbers: the fields are b = b' + i b'' and c likewise, and a matrix has real numbers on its
/// diagonal and imaginary ones off it. Of each layer index and [`phase`] are given. `None` where
/// the wave is evanescent in a layer.
#[must_use]
pub fn response_of_clear(
    layers: impl DoubleEndedIterator<Item = (f64, f64)> + ExactSizeIterator,
    n_in: f64,
    n_out: f64,
    cos_in: f64,
) -> Option<[Response; 2]> {
    let sine_squared = n_in * n_in * (1.0 - cos_in * cos_in).max(0.0);
    let out_squared = n_out * n_out - sine_squared;
    if cos_in <= 0.0 || out_squared <= 0.0 {
        let (r, t, a) = (1.0, 0.0, 0.0);
        return Some([Response { r, t, a }; 2]);
    }
    // n cos(theta), the admittance of s; that of p is n^2 over it
    let normal_out = out_squared.sqrt();
    let eta_out = [normal_out, n_out * n_out / normal_out];
    let eta_in = [n_in * cos_in, n_in / cos_in];
    let is_single = layers.len() == 1;
    let mut fields = eta_out.map(|eta| ([1.0, 0.0], [eta, 0.0]));
    for (n, phase) in layers.rev() {
        let normal_squared = n * n - sine_squared;
        if normal_squared <= 0.0 {
            return None;
        }
        let normal = normal_squared.sqrt();
        let eta = [normal, n * n / normal];
        if is_single {
            let cos = (normal * phase).cos();
            let of = |i: usize| response_of_one([eta_in[i], eta[i], eta_out[i]], cos);
            return Some([of(0), of(1)]);
        }
        let (sin, cos) = (normal * phase).sin_cos();
        for (eta, (b, c)) in eta.into_iter().zip(&mut fields) {
            let (by_eta, over_eta) = (sin * eta, sin / eta);
            (*b, *c) = (
                [cos * b[0] + over_eta * c[1], cos * b[1] - over_eta * c[0]],
                [cos * c[0] + by_eta * b[1], cos * c[1] - by_eta * b[0]],
            );
        }
    }
    let of = |is_p: usize| {
        let (eta, (b, c)) = (eta_in[is_p], fields[is_p]);
        let square = |x: f64, y: f64| x * x + y * y;
        let incident = square(eta * b[0] + c[0], eta * b[1] + c[1]);
        Response {
            r: square(eta * b[0] - c[0], eta * b[1] - c[1]) / incident,
            t: 4.0 * eta * eta_out[is_p] / incident,
            a: 0.0,
        }
    };
    Some([of(0), of(1)])
}

/// Response of one layer that absorbs nothing, by the admittances before it, in it and behind it
/// and the cosine of its phase: most lenses have no other, and its sine is not called for.
#[inline]
fn response_of_one([before, within, behind]: [f64; 3], cos: f64) -> Response {
    let (cos_squared, sin_squared) = (cos * cos, 1.0 - cos * cos);
    let coupled = before * behind / within;
    let square = |x: f64, y: f64| cos_squared * x * x + sin_squared * y * y;
    let incident = square(before + behind, coupled + within);
    Response {
        r: square(before - behind, coupled - within) / incident,
        t: 4.0 * before * behind / incident,
        a: 0.0,
    }
}

fn response_of(
    layers: impl DoubleEndedIterator<Item = (Complex64, f64)>,
    lambda_nm: f64,
    n_in: f64,
    n_out: Complex64,
    cos_in: f64,
    is_p: bool,
) -> Response {
    let n_sin = n_in * (1.0 - cos_in * cos_in).max(0.0).sqrt();
    // at grazing incidence everything is reflected
    if cos_in <= 0.0 {
        return Response {
            r: 1.0,
            t: 0.0,
            a: 0.0,
        };
    }
    let eta_in = admittance(n_in.into(), cos_in.into(), is_p);
    let eta_out = admittance(n_out, cosine(n_out, n_sin), is_p);
    // electric and magnetic field behind the stack, carried to its front; the power of e taken
    // out is kept apart
    let (mut b, mut c) = (Complex64::from(1.0), eta_out);
    let mut log_scale = 0.0;
    for (n, nm) in layers.rev() {
        let cos = cosine(n, n_sin);
        let eta = admittance(n, cos, is_p);
        let delta = n * cos * (TAU * nm / lambda_nm);
        // cos and sin of delta times exp(-|Im delta|)
        let damping = delta.im.abs();
        let forward = Complex64::new(0.0, delta.re).exp() * (-delta.im - damping).exp();
        let backward = Complex64::new(0.0, -delta.re).exp() * (delta.im - damping).exp();
        let cos_delta = 0.5 * (forward + backward);
        let i_sin_delta = 0.5 * (forward - backward);
        (b, c) = (
            cos_delta * b - i_sin_delta / eta * c,
            cos_delta * c - i_sin_delta * eta * b,
        );
        log_scale += damping;
    }
    let incident = eta_in * b + c;
    let norm = incident.norm_sqr();
    let power = 4.0 * eta_in.re / norm;
    let out = eta_out.re.max(0.0) * (-2.0 * log_scale).exp();
    Response {
        r: ((eta_in * b - c) / incident).norm_sqr(),
        t: power * out,
        a: power * ((b * c.conj()).re - out),
    }
}

impl Stack {
    /// The layers at a wavelength, and the index of what lies behind them: the backing if there is
    /// one, else `n_out`.
    #[must_use]
    pub fn films(&self, lambda_nm: f64, n_out: f64) -> (Films, Complex64) {
        let layers = self.layers_at(lambda_nm).collect();
        let behind = self.backing.as_ref();
        let behind = behind.map_or(n_out.into(), |ior| complex(ior, lambda_nm));
        (Films { layers }, behind)
    }

    /// Index and thickness in nanometers of each layer at a wavelength.
    pub fn layers_at(&self, lambda_nm: f64) -> impl Iterator<Item = (Complex64, f64)> {
        let layers = self.layers.iter();
        layers.map(move |l| (complex(&l.ior, lambda_nm), l.thickness_nm()))
    }

    /// The same stack for light from the other side.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self {
            layers: self.layers.iter().rev().cloned().collect(),
            ..self.clone()
        }
    }
}

fn complex(ior: &Ior, lambda_nm: f64) -> Complex64 {
    Complex64::new(ior.n(lambda_nm), ior.k(lambda_nm))
}

/// Response of an interface with a coating or without, to unpolarized light.
#[must_use]
pub fn interface(
    coating: Option<&Stack>,
    lambda_nm: f64,
    n_in: f64,
    n_out: f64,
    cos_in: f64,
) -> Response {
    let bare = (Films { layers: Vec::new() }, Complex64::from(n_out));
    let (films, behind) = coating.map_or(bare, |stack| stack.films(lambda_nm, n_out));
    films.response(lambda_nm, n_in, behind, cos_in, Polarization::Average)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};

    fn absorbing() -> Films {
        Films {
            layers: vec![
                (Complex64::new(1.38, 0.0), 99.6),
                (Complex64::new(0.05, 3.4), 12.0),
                (Complex64::new(2.3, 0.01), 60.0),
            ],
        }
    }

    #[test]
    fn power_is_kept_and_transmittance_is_the_same_from_both_sides() {
        let films = absorbing();
        let back = Films {
            layers: films.layers.iter().rev().copied().collect(),
        };
        let n = 1.52;
        for polarization in [Polarization::S, Polarization::P] {
            for degrees in [0.0f64, 10.0, 35.0, 60.0, 89.0] {
                let cos = degrees.to_radians().cos();
                let sin_out = degrees.to_radians().sin() / n;
                let one = films.response(550.0, 1.0, n.into(), cos, polarization);
                let cos_out = (1.0 - sin_out * sin_out).sqrt();
                let two = back.response(550.0, n, 1.0.into(), cos_out, polarization);
                assert!((one.r + one.t + one.a - 1.0).abs() < 1e-12, "{one:?}");
                assert!((two.r + two.t + two.a - 1.0).abs() < 1e-12, "{two:?}");
                assert!((one.t - two.t).abs() < 1e-13);
                assert!(
                    (one.r - two.r).abs() > 1e-6 && one.a > 1e-6,
                    "{degrees}: sides differ where a layer absorbs"
                );
            }
        }
    }

    /// Stacks that absorb nothing, in real numbers and by the complex matrices: up to 12 layers,
    /// from both sides of the critical angle.
    #[test]
    fn real_numbers_give_what_complex_ones_do() {
        let mut compared = 0;
        for case in 0..600u64 {
            let u = |k: u64| unit_f64(random_bits(case, k));
            let layer = |i: u64| {
                let n = Complex64::from(1.2 + 1.3 * u(10 + 2 * i));
                (n, 400.0 * u(11 + 2 * i))
            };
            let layers: Vec<(Complex64, f64)> = (0..case % 13).map(layer).collect();
            let (n_in, n_out, nm) = (1.0 + u(0), 1.0 + u(1), 380.0 + 400.0 * u(2));
            let cos_in = u(3).max(1e-3);
            let real = layers.iter().map(|(n, d)| (n.re, phase(*d, nm)));
            let Some(found) = response_of_clear(real, n_in, n_out, cos_in) else {
                continue;
            };
            compared += 1;
            for (is_p, found) in [false, true].into_iter().zip(found) {
                let each = layers.iter().copied();
                let want = response_of(each, nm, n_in, n_out.into(), cos_in, is_p);
                let what = format!("{case} {is_p}: {found:?} {want:?}");
                // grazing: admittances of p grow as 1/cos
                assert!((found.r - want.r).abs() < 1e-11, "{what}");
                assert!((found.t - want.t).abs() < 1e-11, "{what}");
                assert!((found.r + found.t - 1.0).abs() < 1e-12, "{what}");
            }
        }
        assert!(compared > 400, "{compared}");
    }

    #[test]
    fn closed_forms() {
        // bare glass, Brewster's angle, a quarter wave, total reflection
        let bare = Films { layers: vec![] };
        let n = 1.5f64;
        let normal = bare.response(500.0, 1.0, n.into(), 1.0, Polarization::Average);
        assert!((normal.r - 0.04).abs() < 1e-15 && normal.a.abs() < 1e-15);
        let brewster = n.atan().cos();
        let p = bare.response(500.0, 1.0, n.into(), brewster, Polarization::P);
        assert!(p.r < 1e-30 && (p.t - 1.0).abs() < 1e-14);
        let quarter = Films {
            layers: vec![(Complex64::from(1.38), 500.0 / 4.0 / 1.38)],
        };
        let r = ((n - 1.38f64.powi(2)) / (n + 1.38f64.powi(2))).powi(2);
        assert!(
            (quarter
                .response(500.0, 1.0, n.into(), 1.0, Polarization::Average)
                .r
                - r)
                .abs()
                < 1e-15
        );
        let total = quarter.response(500.0, n, 1.0.into(), 0.5, Polarization::Average);
        assert!((total.r - 1.0).abs() < 1e-14 && total.t == 0.0);
    }

    #[test]
    fn a_thick_metal_does_not_overflow() {
        let thick = Films {
            layers: vec![(Complex64::new(0.9, 6.5), 1e6)],
        };
        let bulk = Films { layers: vec![] };
        let metal = Complex64::new(0.9, 6.5);
        let one = thick.response(550.0, 1.0, 1.5.into(), 0.7, Polarization::Average);
        let two = bulk.response(550.0, 1.0, metal, 0.7, Polarization::Average);
        assert!((one.r - two.r).abs() < 1e-14 && one.t == 0.0);
        assert!((one.r + one.a - 1.0).abs() < 1e-12);
    }
}
