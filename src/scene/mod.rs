//! The immutable scene: everything the transport needs, validated when it is built.

pub mod description;
pub mod effects;
pub mod settings;

pub use description::SceneDescription;
pub use settings::Settings;
