//! placeholder
/// H3
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric;
