//! Choosing one of many lights in constant time.

use super::LightId;

/// Chooses lights in proportion to their power (alias table), with a small uniform share so that no light is starved.
#[derive(Clone, Debug, Default)]
pub struct LightSelection {
    // H4
}

#[allow(unused_variables)]
impl LightSelection {
    /// From the lights' powers (any common unit; non-finite or negative counts as 0).
    #[must_use]
    pub fn new(powers: &[f64]) -> Self {
        todo!()
    }

    /// A light and its probability, from `u` in [0,1); also `u` made uniform again. `None` without lights.
    #[must_use]
    pub fn sample(&self, u: f64) -> Option<(LightId, f64, f64)> {
        todo!()
    }

    /// Probability of a light.
    #[must_use]
    pub fn probability(&self, light: LightId) -> f64 {
        todo!()
    }
}
