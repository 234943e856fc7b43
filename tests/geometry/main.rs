//! Properties of ray queries that no picture would show: no leaks, no re-hits, no preferred scale.

mod exclusion;
mod hard_cases;
mod motion;
mod support;
mod watertight;
