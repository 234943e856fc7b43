//! placeholder
/// H3
#[derive(Clone, Copy, Debug)]
pub struct Mirror;
/// H3
#[derive(Clone, Copy, Debug)]
pub struct Conductor;
