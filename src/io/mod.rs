//! placeholder

pub mod obj;
