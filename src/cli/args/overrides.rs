//! Options that stand for keys of the scene file: any key by its name, and the moment at which a
//! model is shown.

use super::values::{finite, key_value, positive};
use crate::cli::CliError;
use crate::io::model_file::ModelKind;
use crate::math::hash::combine;
use clap::Args;
use std::path::Path;

/// Options that replace keys of the scene file.
#[derive(Debug, Default, Args)]
pub struct Overrides {
    /// Replaces any key of the scene file, such as render.spp=16 or object.0.material=glass
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub set: Vec<(String, String)>,
}

/// How long a shutter is open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Open {
    /// A share of a frame.
    Frames(f64),
    /// Seconds.
    Seconds(f64),
}

/// The frame of a model that is rendered.
#[derive(Clone, Copy, Debug, Args)]
pub struct Moment {
    /// Shows an animated model (glTF) from this frame on, counted from 0
    #[arg(long, value_name = "N", value_parser = finite, allow_negative_numbers = true)]
    pub frame: Option<f64>,
    /// Frames per second
    #[arg(long, value_name = "RATE", requires = "frame", default_value = "24", value_parser = positive, allow_negative_numbers = true)]
    pub fps: f64,
    /// How long the shutter is open from then on: a share of a frame, or a time such as 0.02s or
    /// 20ms
    #[arg(long, value_name = "OPEN", requires = "frame", default_value = "0.5", value_parser = open, allow_negative_numbers = true)]
    pub shutter: Open,
}

impl Moment {
    /// The keys that it sets.
    #[must_use]
    pub fn overrides(&self) -> Vec<(String, String)> {
        let Some(frame) = self.frame else {
            return Vec::new();
        };
        let open_s = match self.shutter {
            Open::Frames(share) => share / self.fps,
            Open::Seconds(time) => time,
        };
        [
            ("model.0.at", format!("{:?}", frame / self.fps)),
            ("model.0.shutter", format!("[0, {open_s:?}]")),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into()
    }

    /// Seed of the frame: each has noise of its own.
    #[must_use]
    pub fn seed(&self, seed: Option<u64>) -> Option<u64> {
        let Some(frame) = self.frame else {
            return seed;
        };
        // seeds have 63 bits
        Some(combine(seed.unwrap_or(0), frame.to_bits()) >> 1)
    }

    /// Only models have frames.
    ///
    /// # Errors
    /// A usage error if a frame of anything else is asked for.
    pub fn check(&self, scene: &Path) -> Result<(), CliError> {
        if self.frame.is_some() && ModelKind::of(scene) != Some(ModelKind::Gltf) {
            return Err(CliError::Usage(
                "--frame is for models (.gltf, .glb); scenes have the keys at of [[model]] and shutter of [[sensor]]".to_owned(),
            ));
        }
        Ok(())
    }
}

fn open(text: &str) -> Result<Open, String> {
    let (number, open): (&str, fn(f64) -> Open) = if let Some(number) = text.strip_suffix("ms") {
        (number, |v| Open::Seconds(v / 1000.0))
    } else if let Some(number) = text.strip_suffix('s') {
        (number, Open::Seconds)
    } else {
        (text, Open::Frames)
    };
    number
        .trim()
        .parse()
        .ok()
        .filter(|v: &f64| v.is_finite() && *v >= 0.0)
        .map(open)
        .ok_or_else(|| {
            "expected a number >= 0 of frames, or a time such as 0.02s or 20ms".to_owned()
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_become_seconds() {
        let moment = |shutter: &str| Moment {
            frame: Some(12.0),
            fps: 25.0,
            shutter: open(shutter).expect("valid"),
        };
        let shutter = |text: &str| moment(text).overrides()[1].1.clone();
        assert_eq!(
            moment("0").overrides()[0],
            ("model.0.at".to_owned(), "0.48".to_owned())
        );
        assert_eq!(shutter("0.5"), "[0, 0.02]");
        assert_eq!(shutter("40ms"), "[0, 0.04]");
        assert_eq!(shutter("0.1s"), "[0, 0.1]");
        for bad in ["-1", "1m", "", "nan", "infs"] {
            assert!(open(bad).is_err(), "{bad}");
        }
        let next = Moment {
            frame: Some(13.0),
            ..moment("0")
        };
        let seeds = [moment("0").seed(None), next.seed(None), next.seed(Some(1))];
        assert!(
            seeds
                .iter()
                .all(|s| s.is_some_and(|s| s <= i64::MAX as u64))
        );
        assert!(seeds[0] != seeds[1] && seeds[1] != seeds[2]);
        assert_eq!(moment("1").seed(Some(3)), moment("0").seed(Some(3)));
        let still = Moment {
            frame: None,
            ..next
        };
        assert_eq!((still.seed(None), still.seed(Some(7))), (None, Some(7)));
        assert!(moment("1").check(Path::new("a.GLB")).is_ok());
        assert!(moment("1").check(Path::new("a.toml")).is_err());
    }
}
