//! Whole renders of small scenes: integrators against each other, against closed forms, and against themselves.

mod closed_forms;
mod determinism;
mod equality;
mod harness;
mod lanes;
mod scale;
