//! Numbers as text that comes back bit for bit: the shortest decimal that names them, which readers
//! of JSON numbers would round a second time. For `#[serde(with)]`.

use serde::{Deserialize, Deserializer, Serializer, de::Error};

/// Writes a number as text.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}

/// Reads a finite number.
///
/// # Errors
/// The text is no finite number.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let text = String::deserialize(deserializer)?;
    let number = text.parse().ok().filter(|v: &f64| v.is_finite());
    number.ok_or_else(|| D::Error::custom(format!("\"{text}\" is not a finite number")))
}

#[cfg(test)]
mod tests {
    use crate::math::hash::random_bits;
    use serde::{Deserialize, Serialize};

    #[derive(Serialize, Deserialize)]
    struct One(#[serde(with = "super")] f64);

    #[test]
    fn every_bit_comes_back() {
        let random = (0..10_000).map(|i| f64::from_bits(random_bits(1, i)));
        for value in random.filter(|v| v.is_finite()).chain([0.1, -0.0, 1e308]) {
            let text = serde_json::to_string(&One(value)).expect("text");
            let One(back) = serde_json::from_str(&text).expect("number");
            assert_eq!(back.to_bits(), value.to_bits(), "{text}");
        }
        for bad in ["\"nan\"", "\"inf\"", "1", "\"\""] {
            assert!(serde_json::from_str::<One>(bad).is_err(), "{bad}");
        }
    }
}
