//! The settings that the page may change: those that leave the scene as it is.

use crate::math::named::Named;
use crate::scene::Settings;
use crate::scene::settings::{Aiming, IntegratorKind, Regularize};
use serde_json::{Value, json};

/// Numbers of wavelengths per path.
const LANES: [u64; 3] = [1, 4, 8];

/// The settings as the page shows them.
pub fn shown(settings: &Settings) -> Value {
    json!({
        "integrator": settings.integrator.as_str(),
        "regularize": settings.regularization.mode.as_str(),
        "aim": settings.aim.as_str(),
        "lanes": settings.lanes,
        "epsilon": settings.regularization.epsilon,
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

/// The settings with the values of a JSON object in their place.
///
/// # Errors
/// A key or value that is not on the list.
pub fn changed(settings: &Settings, body: &[u8]) -> Result<Settings, String> {
    let values: Value = serde_json::from_slice(body).map_err(|_| "not JSON")?;
    let values = values.as_object().ok_or("not an object")?;
    let mut settings = settings.clone();
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
            _ => return Err("no such setting".to_owned()),
        }
    }
    Ok(settings)
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
        let before = Settings::default();
        let text =
            br#"{"integrator":"path","regularize":"off","aim":"auto","lanes":8,"epsilon":0.1}"#;
        let after = changed(&before, text).expect("valid");
        assert_eq!(after.integrator, IntegratorKind::Path);
        assert_eq!(after.lanes, 8);
        assert_eq!(after.regularization.epsilon, Some(0.1));
        assert_eq!(
            changed(&after, br#"{"epsilon":null}"#)
                .expect("valid")
                .regularization
                .epsilon,
            None
        );
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
        ] {
            assert!(changed(&before, wrong.as_bytes()).is_err(), "{wrong}");
        }
        let read = shown(&after);
        assert_eq!(changed(&before, read.to_string().as_bytes()), Ok(after));
    }
}
