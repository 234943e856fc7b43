//! A stop rule of one's own: passes are added until the noise of one object is small, whatever that
//! of the rest.
//!
//!     cargo run --release --example stop_rule

#![allow(clippy::print_stdout, reason = "a program that prints its results")]

use abbe::film::Crop;
use abbe::io::{exr, image};
use abbe::material::Material;
use abbe::render::session::NO_LIMIT;
use abbe::render::{Render, Session, SessionOptions, StopReason};
use abbe::scene::builder::look_at;
use abbe::scene::{Scene, SceneBuilder, Settings};
use abbe::spectrum::Emission;
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;
/// The pixels that count: those of the ball.
const BALL: Crop = Crop {
    x0: 24,
    y0: 16,
    x1: 40,
    y1: 32,
};
/// Noise of the ball at which to stop, relative to its mean.
const GOAL: f64 = 0.05;
/// Passes before noise is known well enough.
const LEAST_PASSES: u64 = 4;

fn scene() -> Result<Scene, Box<dyn Error>> {
    let mut scene = SceneBuilder::new();
    let red = scene.material(Material::diffuse(0.6));
    let white = scene.material(Material::diffuse(0.8));
    scene.sphere("ball", [0.0; 3], 0.6).of(red);
    scene
        .quad("wall", [0.0, 0.0, -1.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0])
        .of(white);
    scene
        .sphere("lamp", [2.0, 2.5, 2.0], 0.5)
        .emits(Emission::from_rgb([5.0; 3]));
    let view = look_at([0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0]);
    scene.pinhole("main", [WIDTH, HEIGHT], view, 0.7);
    Ok(scene.build()?)
}

/// Noise of Y over the ball, relative to its mean; `None` before both halves of the passes have
/// some.
fn noise(render: &Render) -> Option<f64> {
    let [even, odd] = render.pass_counts();
    let noise = render.outputs().image.noise(1, even, odd)?;
    let (mut square, mut sum, mut count) = (0.0, 0.0, 0.0);
    for (i, (noise, xyz)) in noise.iter().zip(render.xyz().chunks(3)).enumerate() {
        let (x, y) = (i as u32 % WIDTH, i as u32 / WIDTH);
        if BALL.contains(x, y) {
            square += noise * noise;
            sum += xyz[1];
            count += 1.0;
        }
    }
    Some(f64::sqrt(square / count) * count / sum)
}

/// Noise of the ball after each pass.
type History = Vec<Option<f64>>;

/// Renders until the ball is good enough.
fn rendered() -> Result<(Session, History), Box<dyn Error>> {
    let options = SessionOptions {
        passes: Some(0..NO_LIMIT),
        ..SessionOptions::default()
    };
    let mut session = Session::new(scene()?, &Settings::default(), options)?;
    let mut history = History::new();
    let reason = session.run_with(|session, progress| {
        let noise = noise(&session.render());
        history.push(noise);
        let enough = progress.passes >= LEAST_PASSES && noise.is_some_and(|n| n <= GOAL);
        Ok::<_, Box<dyn Error>>(if enough {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    })?;
    debug_assert!(reason == StopReason::Driver);
    Ok((session, history))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (session, history) = rendered()?;
    for (pass, noise) in history.iter().enumerate() {
        let percent = noise.map_or_else(String::new, |n| format!("{:.2} %", 100.0 * n));
        println!("pass {pass}: {percent}");
    }
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let path = Path::new(&folder).join("stop_rule.exr");
    exr::write(&path, &image::of(&session.render()))?;
    println!("{}", path.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stops_at_the_first_pass_that_is_good_enough() {
        let (session, history) = rendered().expect("renders");
        assert_eq!(session.render().passes().len(), history.len());
        let good = |noise: &Option<f64>| noise.is_some_and(|n| n <= GOAL);
        assert!(good(history.last().expect("a pass")));
        assert!(
            !history[LEAST_PASSES as usize - 1..history.len() - 1]
                .iter()
                .any(good)
        );
        assert!(
            history.len() > LEAST_PASSES as usize,
            "the goal takes more: {history:?}"
        );
    }
}
