//! Which effects a scene calls for, and which of its elements does.

/// One effect, on or off, with its reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Effect {
    /// Such as "dispersion" or "absorption".
    pub name: &'static str,
    /// Whether it is computed.
    pub on: bool,
    /// The element that called for it, or why none did.
    pub reason: String,
}
