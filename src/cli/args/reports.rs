//! The options of `abbe cost`.

use super::Overrides;
use super::values;
use crate::math::named::Named;
use crate::report::cost::{Group, MOST_PASSES, REFERENCE_CELLS};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

impl ValueEnum for Group {
    fn value_variants<'a>() -> &'a [Self] {
        <Self as Named>::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.as_str()).help(self.help()))
    }
}

/// Options of `abbe cost`.
#[derive(Debug, Args)]
pub struct CostOptions {
    /// The scene file
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The image to measure errors against; one is rendered by another estimator otherwise
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Time for each variant and seed on every thread, such as 10s or 2m (the reference has eight
    /// times as much)
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = values::seconds)]
    pub budget: f64,
    /// Passes for each variant and seed instead of a time, at least 2: the same on every machine
    /// (the reference has eight times as many)
    #[arg(long, value_name = "N", conflicts_with = "budget", value_parser = clap::value_parser!(u32).range(2..=i64::from(MOST_PASSES / REFERENCE_CELLS)))]
    pub spp: Option<u32>,
    /// Seeds per variant, for the spread
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub seeds: u32,
    /// The folder for report, tables and images; NAME.cost in the working directory otherwise
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// Parameter that is varied
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', default_values = ["methods", "effects", "settings"])]
    pub vary: Vec<Group>,
    /// Also plots the value of this pixel against time
    #[arg(long, value_name = "X,Y", value_parser = values::pixel)]
    pub probe: Option<[u32; 2]>,
    /// Measures this sensor; the first otherwise
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Threads; all cores otherwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}
