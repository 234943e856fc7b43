//! A first look at a render: a coarse picture of one sample for each block of pixels, to be shown
//! before the first pass is done. Nothing of it enters a film.

use super::Render;
use crate::integrator::{Workspace, sample_pixel};
use crate::transport::Target;
use rayon::prelude::*;

/// The pass whose samples are taken.
const PASS: u32 = 0;

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

impl Render {
    /// The picture in blocks of `side` × `side` pixels, each from the sample of one pixel. Photons
    /// are not merged.
    #[must_use]
    pub fn look(&self, side: u32) -> Look {
        let (frame, crop) = (self.frame(), self.crop());
        let pass = self.settings_of(&frame, PASS);
        let (width, height) = (crop.width().div_ceil(side), crop.height().div_ceil(side));
        let response = self.outputs().response;
        let middle =
            |first: u32, end: u32, block: u32| (first + block * side + side / 2).min(end - 1);
        let row = |workspace: &mut Workspace, j: u32| -> Row {
            let y = middle(crop.y0, crop.y1, j);
            let mut splats = Vec::new();
            let own = (0..width).map(|i| {
                let pixel = (middle(crop.x0, crop.x1, i), y);
                let response = sample_pixel(&frame, &pass, pixel, response, workspace);
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
        Look {
            width,
            height,
            xyz: blocks.into_flattened(),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::material::Material;
    use crate::render::{Session, SessionOptions};
    use crate::scene::settings::IntegratorKind;
    use crate::scene::{SceneBuilder, Settings, builder::look_at};
    use crate::spectrum::Emission;

    /// Mean Y of the look and of the render.
    fn means(integrator: IntegratorKind) -> (f64, f64) {
        let mut scene = SceneBuilder::new();
        let white = scene.material(Material::diffuse(0.7));
        scene
            .quad("floor", [0.0; 3], [0.0, 0.0, 3.0], [3.0, 0.0, 0.0])
            .of(white);
        scene
            .sphere("lamp", [1.0, 2.5, 0.5], 0.3)
            .emits(Emission::from_rgb([10.0; 3]));
        let view = look_at([0.0, 1.5, 4.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0]);
        scene.pinhole("main", [160, 120], view, 40_f64.to_radians());
        let settings = Settings {
            spp: 1,
            integrator,
            ..Settings::default()
        };
        let scene = scene.build().expect("valid");
        let mut session =
            Session::new(scene, &settings, SessionOptions::default()).expect("a session");
        let look = session.render().look(4);
        assert_eq!((look.width, look.height), (40, 30));
        assert!(session.render().passes().is_empty());
        session.run();
        let mean = |xyz: &[f64]| {
            let y: Vec<f64> = xyz.iter().skip(1).step_by(3).copied().collect();
            y.iter().sum::<f64>() / y.len() as f64
        };
        (mean(&look.xyz), mean(&session.render().xyz()))
    }

    #[test]
    fn a_look_is_as_bright_as_the_render() {
        // 1200 samples, and 19200: the mean of a floor of two thirds of the picture, whose samples
        // scatter by about their mean, is known to 4 %
        for integrator in [IntegratorKind::Bdpt, IntegratorKind::Light] {
            let (look, render) = means(integrator);
            assert!((look / render - 1.0).abs() < 0.16, "{look} {render}");
        }
    }
}
