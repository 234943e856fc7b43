//! A first look at a scene: a coarse picture of one sample for each block of pixels, to be shown
//! before the pilots of a render and its first pass are done. Nothing of it enters a film.

use super::OutputRequest;
use crate::integrator::{Workspace, sample_pixel};
use crate::math::hash::combine;
use crate::scene::settings::{Aiming, Regularize};
use crate::scene::{Scene, Settings};
use crate::spectrum::SensorResponse;
use crate::transport::{PassSettings, Target};
use rayon::prelude::*;

/// A coarse picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// X, Y and Z of each block, row by row.
    pub xyz: Vec<f64>,
}

/// Values of one row of blocks: of the blocks themselves, and raster positions with theirs.
type Row = (Vec<[f64; 3]>, Vec<([f64; 2], [f64; 3])>);

impl Look {
    /// The picture in blocks of `side` × `side` pixels, each from the sample of one pixel. Needs no
    /// pilot: photons are not merged, chains not solved for, nothing is regularized.
    #[must_use]
    pub fn new(
        scene: &Scene,
        sensor: usize,
        settings: &Settings,
        response: SensorResponse,
        side: u32,
    ) -> Self {
        let mut settings = settings.clone();
        settings.aim = Aiming::Off;
        settings.regularization.mode = Regularize::Off;
        let crop = scene.sensors[sensor].whole_film();
        let request = OutputRequest::default();
        let frame = super::frame(scene, sensor, &settings, &crop, &request);
        let pass = PassSettings::default();
        let (width, height) = (crop.width().div_ceil(side), crop.height().div_ceil(side));
        // not the same one of each block: numbers of neighbors are drawn to complement each other
        let pixel = |i: u32, j: u32| {
            let choice = combine(u64::from(i), u64::from(j)) >> 32;
            let (dx, dy) = (choice as u32 % side, choice as u32 / side % side);
            let x = (crop.x0 + i * side + dx).min(crop.x1 - 1);
            (x, (crop.y0 + j * side + dy).min(crop.y1 - 1))
        };
        let row = |workspace: &mut Workspace, j: u32| -> Row {
            let mut splats = Vec::new();
            let own = (0..width).map(|i| {
                let response = sample_pixel(&frame, &pass, pixel(i, j), response, workspace);
                let mut own = [0.0; 3];
                for contribution in &workspace.contributions {
                    let xyz = response.xyz(&contribution.lanes);
                    match contribution.target {
                        Target::OwnPixel => {
                            own.iter_mut().zip(xyz).for_each(|(sum, more)| *sum += more);
                        }
                        Target::Splat(raster) => splats.push((raster.to_array(), xyz)),
                    }
                }
                own
            });
            let own = own.collect();
            (own, splats)
        };
        let rows: Vec<Row> = (0..height)
            .into_par_iter()
            .map_init(Workspace::default, row)
            .collect();
        let mut blocks: Vec<[f64; 3]> = rows.iter().flat_map(|row| row.0.iter().copied()).collect();
        for (raster, xyz) in rows.iter().flat_map(|row| &row.1) {
            // a light path stands for all pixels of its block, over which it is spread
            let place = |v: f64, first: u32| (v - f64::from(first)) / f64::from(side);
            let (i, j) = (place(raster[0], crop.x0), place(raster[1], crop.y0));
            let inside = |v: f64, end: u32| v >= 0.0 && v < f64::from(end);
            if inside(i, width) && inside(j, height) {
                let block = &mut blocks[j as usize * width as usize + i as usize];
                block
                    .iter_mut()
                    .zip(xyz)
                    .for_each(|(sum, more)| *sum += more);
            }
        }
        Self {
            width,
            height,
            xyz: blocks.into_flattened(),
        }
    }

    /// Whether there is any light in it.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.xyz.iter().all(|v| *v == 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Session, SessionOptions};
    use crate::scene::builder::tests::lit_floor;
    use crate::scene::settings::IntegratorKind;

    /// Mean X, Y and Z of the look and of the render.
    fn means(integrator: IntegratorKind) -> [[f64; 3]; 2] {
        let settings = Settings {
            spp: 1,
            integrator,
            ..Settings::default()
        };
        let scene = std::sync::Arc::new(lit_floor([160, 120]).build().expect("valid"));
        let options = SessionOptions::default();
        let mut session = Session::new(scene.clone(), &settings, options).expect("a session");
        let look = Look::new(&scene, 0, &settings, SensorResponse::Xyz, 4);
        assert_eq!((look.width, look.height), (40, 30));
        session.run();
        let mean = |xyz: &[f64]| {
            let sum = |c: usize| xyz.iter().skip(c).step_by(3).sum::<f64>();
            [0, 1, 2].map(|c| sum(c) / (xyz.len() / 3) as f64)
        };
        [mean(&look.xyz), mean(&session.render().xyz())]
    }

    #[test]
    fn a_look_is_as_bright_as_the_render() {
        // 1200 samples, and 19200: the mean of a floor of two thirds of the picture, whose samples
        // scatter by about their mean, is known to 4 %
        for integrator in [IntegratorKind::Bdpt, IntegratorKind::Light] {
            let [look, render] = means(integrator);
            for (a, b) in look.iter().zip(render) {
                assert!((a / b - 1.0).abs() < 0.16, "{look:?} {render:?}");
            }
        }
    }
}
