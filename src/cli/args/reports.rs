//! The options of `abbe cost`.

use super::Overrides;
use super::values;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Parts of the matrix of `abbe cost`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CostGroup {
    /// Integrators and modes of regularization
    Methods,
    /// The scene without one of its effects each
    Effects,
    /// Other values of one setting each
    Settings,
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
    /// Time for each variant and seed on every thread, such as 10s or 2m (the reference has eight times as much)
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = values::seconds)]
    pub budget: f64,
    /// Seeds per variant, for the spread
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub seeds: u32,
    /// The folder for report, tables and images; NAME.cost in the working directory otherwise
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// What is varied
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', default_values = ["methods", "effects", "settings"])]
    pub vary: Vec<CostGroup>,
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
