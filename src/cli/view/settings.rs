//! The settings that the page may change: those that leave the scene as it is, and which layers
//! are kept.

use crate::io::layers::Layer;
use crate::math::named::Named;
use crate::scene::Settings;
use crate::scene::settings::{Aiming, IntegratorKind, Regularization, Regularize};
use serde_json::{Value, json};

/// Numbers of wavelengths per path.
const LANES: [u64; 3] = [1, 4, 8];

/// Choices of the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    pub settings: Settings,
    /// Whether an image per strategy is kept.
    pub strategies: bool,
    /// Whether what regularized strategies make and the rest are kept apart.
    pub shares: bool,
}

impl Chosen {
    /// The choices of the command line.
    pub fn of(settings: &Settings, asked: &[Layer]) -> Self {
        Self {
            settings: settings.clone(),
            strategies: asked.iter().any(|l| matches!(l, Layer::Strategies)),
            shares: asked.iter().any(is_share),
        }
    }

    /// The layers to keep: those that the command line asks for, with and without those that the
    /// page chooses.
    pub fn layers(&self, asked: &[Layer]) -> Vec<Layer> {
        let kept = asked.iter().filter(|layer| match layer {
            Layer::Strategies => self.strategies,
            layer if is_share(layer) => self.shares,
            _ => true,
        });
        let mut layers: Vec<Layer> = kept.cloned().collect();
        if self.strategies && !asked.iter().any(|l| matches!(l, Layer::Strategies)) {
            layers.push(Layer::Strategies);
        }
        if self.shares && !asked.iter().any(is_share) {
            layers.extend([Layer::Regularized, Layer::Unbiased]);
        }
        layers
    }

    /// These choices over the settings of a file, which may have changed all else.
    pub fn over(self, file: &Settings) -> Self {
        let ours = self.settings;
        let settings = Settings {
            integrator: ours.integrator,
            aim: ours.aim,
            lanes: ours.lanes,
            regularization: Regularization {
                mode: ours.regularization.mode,
                epsilon: ours.regularization.epsilon,
                ..file.regularization
            },
            ..file.clone()
        };
        Self { settings, ..self }
    }
}

fn is_share(layer: &Layer) -> bool {
    matches!(layer, Layer::Regularized | Layer::Unbiased)
}

/// The choices as the page shows them.
pub fn shown(chosen: &Chosen) -> Value {
    let settings = &chosen.settings;
    json!({
        "integrator": settings.integrator.as_str(),
        "regularize": settings.regularization.mode.as_str(),
        "aim": settings.aim.as_str(),
        "lanes": settings.lanes,
        "epsilon": settings.regularization.epsilon,
        "strategies": chosen.strategies,
        "shares": chosen.shares,
    })
}

/// Names of the choices.
pub fn choices() -> Value {
    fn names<T: Named>() -> Vec<&'static str> {
        T::ALL.iter().map(|v| v.as_str()).collect()
    }
    json!({
        "integrator": names::<IntegratorKind>(),
        "regularize": names::<Regularize>(),
        "aim": names::<Aiming>(),
        "lanes": LANES,
    })
}

/// The choices with the values of a JSON object in their place.
///
/// # Errors
/// A key or value that is not on the list.
pub fn changed(chosen: &Chosen, body: &[u8]) -> Result<Chosen, String> {
    let values: Value = serde_json::from_slice(body).map_err(|_| "not JSON")?;
    let values = values.as_object().ok_or("not an object")?;
    let mut chosen = chosen.clone();
    let settings = &mut chosen.settings;
    let yes_or_no = |value: &Value| value.as_bool().ok_or("expected true or false");
    for (key, value) in values {
        match key.as_str() {
            "integrator" => settings.integrator = named(value)?,
            "regularize" => settings.regularization.mode = named(value)?,
            "aim" => settings.aim = named(value)?,
            "lanes" => {
                let lanes = value.as_u64().filter(|n| LANES.contains(n));
                settings.lanes = lanes.ok_or("lanes: expected 1, 4 or 8")? as usize;
            }
            "epsilon" => {
                let angle = value.as_f64();
                let angle = angle.filter(|a| *a > 0.0 && *a <= std::f64::consts::FRAC_PI_2);
                if angle.is_none() && !value.is_null() {
                    return Err("epsilon: expected radians above 0, at most pi/2".to_owned());
                }
                settings.regularization.epsilon = angle;
            }
            "strategies" => chosen.strategies = yes_or_no(value)?,
            "shares" => chosen.shares = yes_or_no(value)?,
            _ => return Err("no such setting".to_owned()),
        }
    }
    Ok(chosen)
}

fn named<T: Named>(value: &Value) -> Result<T, String> {
    let names: Vec<&str> = T::ALL.iter().map(|v| v.as_str()).collect();
    let known = value.as_str().and_then(T::named);
    known.ok_or_else(|| format!("expected one of {}", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_listed_can_be_changed() {
        let before = Chosen::of(&Settings::default(), &[Layer::Unbiased]);
        assert!(before.shares && !before.strategies);
        let text =
            br#"{"integrator":"path","regularize":"off","aim":"auto","lanes":8,"epsilon":0.1,"strategies":true}"#;
        let after = changed(&before, text).expect("valid");
        assert_eq!(after.settings.integrator, IntegratorKind::Path);
        assert_eq!(after.settings.lanes, 8);
        assert_eq!(after.settings.regularization.epsilon, Some(0.1));
        let automatic = changed(&after, br#"{"epsilon":null}"#).expect("valid");
        assert_eq!(automatic.settings.regularization.epsilon, None);
        // all else is the file's
        let file = Settings {
            spp: 77,
            ..Settings::default()
        };
        let over = after.clone().over(&file);
        assert_eq!(over.settings.spp, 77);
        assert_eq!(shown(&over), shown(&after));
        for wrong in [
            "",
            "7",
            "{",
            r#"{"spp":3}"#,
            r#"{"path":"/etc/passwd"}"#,
            r#"{"lanes":3}"#,
            r#"{"epsilon":0}"#,
            r#"{"epsilon":9}"#,
            r#"{"integrator":"magic"}"#,
            r#"{"aim":1}"#,
            r#"{"strategies":1}"#,
            r#"{"layers":["strategies"]}"#,
        ] {
            assert!(changed(&before, wrong.as_bytes()).is_err(), "{wrong}");
        }
        let read = shown(&after);
        assert_eq!(changed(&before, read.to_string().as_bytes()), Ok(after));
    }

    #[test]
    fn layers_are_those_asked_for_and_those_chosen() {
        let asked = [
            Layer::Error,
            Layer::Unbiased,
            Layer::Class("^LE$".to_owned()),
        ];
        let names = |chosen: &Chosen| format!("{:?}", chosen.layers(&asked));
        let mut chosen = Chosen::of(&Settings::default(), &asked);
        assert_eq!(names(&chosen), format!("{asked:?}"));
        chosen.strategies = true;
        let expected = r#"[Error, Unbiased, Class("^LE$"), Strategies]"#;
        assert_eq!(names(&chosen), expected);
        chosen.shares = false;
        assert_eq!(names(&chosen), r#"[Error, Class("^LE$"), Strategies]"#);
        chosen.shares = true;
        let all = format!("{:?}", chosen.layers(&[]));
        assert_eq!(all, "[Strategies, Regularized, Unbiased]");
    }
}
