//! An image around the scene: equirectangular, drawn from in proportion to its luminance.
//!
//! Radiance is bilinear between the centers of texels. The density is constant over each texel, in
//! proportion to the mean of that radiance over it, which is exact: a bilinear interpolant has the
//! mean (1 6 1)/8 ⊗ (1 6 1)/8 of the texels around (Pharr, Jakob, Humphreys 2016, 14.2.4, draws
//! from the texels themselves and would miss dark texels beside bright ones).

use crate::math::distribution::AliasTable;
use crate::spectrum::{SampledSpectrum, SampledWavelengths, upsample};
use crate::texture::{Filter, Image, ImageTexture, Wrap};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Luminance of linear sRGB.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// An image of factors on the radiance by direction. Row 0 is up (+y), the middle column looks
/// along -z, columns run to the right (+x follows -z).
#[derive(Clone, Debug)]
pub struct EnvironmentImage {
    texture: ImageTexture,
    /// From the world to the image's own directions.
    to_image: DMat3,
    texels: AliasTable,
    /// Mean luminance over the sphere.
    mean: f64,
}

impl EnvironmentImage {
    /// An image turned by the rotation `to_world`; `None` if it is black.
    #[must_use]
    pub fn new(image: Arc<Image>, to_world: DMat3) -> Option<Self> {
        let texture = ImageTexture {
            wrap: [Wrap::Repeat, Wrap::Clamp],
            filter: Filter::Bilinear,
            ..ImageTexture::new(image)
        };
        let (w, h) = (texture.image.width(), texture.image.height());
        let luminance = |x: usize, y: usize| {
            let rgb = texture.image.texel(0, x, y);
            (0..3)
                .map(|c| LUMINANCE[c] * f64::from(rgb[c]))
                .sum::<f64>()
        };
        // means over texels: along rows, then between rows
        let blurred: Vec<f64> = (0..h)
            .flat_map(|y| (0..w).map(move |x| (x, y)))
            .map(|(x, y)| {
                0.125 * (luminance((x + w - 1) % w, y) + luminance((x + 1) % w, y))
                    + 0.75 * luminance(x, y)
            })
            .collect();
        let mut weights = vec![0.0; w * h];
        for y in 0..h {
            let (above, below) = (y.saturating_sub(1), (y + 1).min(h - 1));
            for x in 0..w {
                let at = |row: usize| blurred[row * w + x];
                let mean = 0.125 * (at(above) + at(below)) + 0.75 * at(y);
                weights[y * w + x] = mean * row_height(y, h);
            }
        }
        let texels = AliasTable::new(&weights)?;
        // the heights of all rows add up to 2
        let mean = texels.total() / (2.0 * w as f64);
        Some(Self {
            texture,
            to_image: to_world.transpose(),
            texels,
            mean,
        })
    }

    /// The image.
    #[must_use]
    pub fn image(&self) -> &Arc<Image> {
        &self.texture.image
    }

    /// Memory held beside the image, in bytes.
    #[must_use]
    pub fn table_bytes(&self) -> usize {
        self.texels.bytes()
    }

    /// Mean luminance over the sphere.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Place on the image, (0, 0) at the upper left, of light that travels along the unit vector
    /// `direction`.
    fn place(&self, direction: DVec3) -> DVec2 {
        let d = self.to_image * -direction;
        let x = 0.5 + d.x.atan2(-d.z) / TAU;
        DVec2::new(x, d.y.clamp(-1.0, 1.0).acos() / PI)
    }

    /// The factor for light that travels along the unit vector `direction`.
    #[must_use]
    pub fn factor(&self, direction: DVec3, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        let p = self.place(direction);
        let [r, g, b, _] = self.texture.eval(DVec2::new(p.x, 1.0 - p.y));
        upsample::rgb_lanes([r, g, b], wavelengths)
    }

    /// Density per solid angle of light that travels along the unit vector `direction`.
    #[must_use]
    pub fn pdf(&self, direction: DVec3) -> f64 {
        let (w, h) = (self.image().width(), self.image().height());
        let p = self.place(direction);
        let x = ((p.x * w as f64) as usize).min(w - 1);
        let y = ((p.y * h as f64) as usize).min(h - 1);
        self.texels.pmf(y * w + x) / (row_height(y, h) * TAU / w as f64)
    }

    /// A direction in which light travels, drawn by `u_texel` (the texel) and `u` (the place in
    /// it), and its density.
    #[must_use]
    pub fn sample(&self, u_texel: f64, u: DVec2) -> (DVec3, f64) {
        let (w, h) = (self.image().width(), self.image().height());
        let texel = self.texels.sample(u_texel);
        let (x, y) = (texel.index % w, texel.index / w);
        let phi = ((x as f64 + u.x) / w as f64 - 0.5) * TAU;
        let up = row_edge(y, h) - u.y * row_height(y, h);
        let r = (1.0 - up * up).max(0.0).sqrt();
        let d = DVec3::new(r * phi.sin(), up, -r * phi.cos());
        let direction = -(self.to_image.transpose() * d).normalize();
        let pdf = texel.pmf / (row_height(y, h) * TAU / w as f64);
        (direction, pdf)
    }
}

/// Height (cosine from the pole) of the upper edge of row `y` of `h`.
fn row_edge(y: usize, h: usize) -> f64 {
    (PI * y as f64 / h as f64).cos()
}

/// Difference of height between the edges of row `y`: its solid angle per azimuth.
fn row_height(y: usize, h: usize) -> f64 {
    row_edge(y, h) - row_edge(y + 1, h)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::chi_square::{integrate_cells, sphere_p_value};
    use crate::math::hash::{random_bits, unit_f64};
    use crate::spectrum::WavelengthDistribution;

    /// A dim sky with one bright texel beside black ones.
    fn sky() -> EnvironmentImage {
        let (w, h) = (16u32, 8u32);
        let values = (0..w * h)
            .map(|i| match i {
                35 => [60.0, 40.0, 20.0],
                _ if i / w < 4 => [0.2, 0.3, 0.9],
                _ if i % 3 == 0 => [0.0; 3],
                _ => [0.3, 0.2, 0.1],
            })
            .collect();
        let image = Image::from_floats(w, h, values).expect("valid");
        let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(0.4);
        EnvironmentImage::new(Arc::new(image), turn).expect("not black")
    }

    #[test]
    fn directions_have_their_density() {
        let sky = sky();
        let total: f64 = integrate_cells(&|d| sky.pdf(d)).iter().sum();
        // the density jumps between texels: the quadrature is good to a percent
        assert!((total - 1.0).abs() < 0.01, "{total}");
        let p = sphere_p_value(
            3,
            100_000,
            |u| Some(sky.sample(u[0], DVec2::new(u[1], u[2])).0),
            &|d| sky.pdf(d),
        );
        assert!(p > 1e-3, "p = {p}");
        for i in 0..1000_u64 {
            let u = |k| unit_f64(random_bits(9, 4 * i + k));
            let (direction, pdf) = sky.sample(u(0), DVec2::new(u(1), u(2)));
            assert!((sky.pdf(direction) / pdf - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn sampling_by_luminance_leaves_little_to_vary() {
        let sky = sky();
        let wavelengths = WavelengthDistribution::uniform([550.0, 560.0]).sample(0.5, 1);
        let n = 40_000_u64;
        let (mut even, mut drawn) = (0.0, 0.0);
        for i in 0..n {
            let u = |k| unit_f64(random_bits(5, 4 * i + k));
            let direction = crate::math::sampling::uniform_sphere([u(0), u(1)]);
            even += f64::from(sky.factor(direction, &wavelengths)[0]) * 4.0 * PI;
            let (direction, pdf) = sky.sample(u(0), DVec2::new(u(1), u(2)));
            drawn += f64::from(sky.factor(direction, &wavelengths)[0]) / pdf;
        }
        // uniform directions have a relative deviation near 7 a sample here: 3.5 % of the mean
        assert!((even / drawn - 1.0).abs() < 0.15, "{even} {drawn}");
    }

    #[test]
    fn the_image_is_where_it_should_be() {
        // right of the middle, above the horizon
        let mut values = vec![[0.0; 3]; 8 * 4];
        values[8 + 6] = [1.0; 3];
        let image = Arc::new(Image::from_floats(8, 4, values).expect("valid"));
        let at = |turn: DMat3, d: DVec3| {
            let environment = EnvironmentImage::new(image.clone(), turn).expect("not black");
            let wavelengths = WavelengthDistribution::uniform([500.0, 600.0]).sample(0.5, 1);
            environment.factor(-d.normalize(), &wavelengths)[0]
        };
        // column 6 of 8 spans azimuths 90 to 135 degrees right of -z
        let bright = DVec3::new(1.0, 0.41, 0.41);
        assert!(at(DMat3::IDENTITY, bright) > 0.9);
        assert_eq!(at(DMat3::IDENTITY, DVec3::new(-1.0, 0.41, 0.41)), 0.0);
        // turned by 90 degrees about +y, what was at +x is at -z
        let turn = DMat3::from_rotation_y(std::f64::consts::FRAC_PI_2);
        assert!(at(turn, turn * bright) > 0.9);
        let black = Image::from_floats(1, 1, vec![[0.0; 3]]).expect("valid");
        assert!(EnvironmentImage::new(Arc::new(black), DMat3::IDENTITY).is_none());
    }
}
