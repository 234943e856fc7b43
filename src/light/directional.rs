//! placeholder
/// H4
#[derive(Clone, Debug)]
pub struct DirectionalLight;
