//! Whole renders of small scenes: integrators against each other, against closed forms, and against
//! themselves.

#![allow(
    clippy::print_stdout,
    reason = "measured numbers are shown with --nocapture"
)]

#[path = "../support/gltf.rs"]
mod gltf;

mod aims;
mod animated;
mod cases;
mod casters;
mod closed_forms;
mod contact;
mod curved;
mod determinism;
mod equality;
mod far_field;
mod film;
mod hard_cases;
mod harness;
mod lanes;
mod lens;
mod merging;
mod metropolis;
mod models;
mod motion;
mod regularized;
mod scale;
mod session;
mod together;
mod weights;
