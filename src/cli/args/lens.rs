//! The options of `abbe lens` and `abbe glass`.

use clap::Args;
use std::path::PathBuf;

/// Options of `abbe lens`.
#[derive(Debug, Args)]
pub struct LensOptions {
    /// The prescription: Zemax .zmx, CODE V .seq, or .json of optiland
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Wavelengths in place of those of the file: F, d, C or nanometers
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub wavelengths: Vec<String>,
    /// Fields in place of those of the file, in its kind: Y or X:Y
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    pub fields: Vec<String>,
    /// Coats every surface between air and glass: MgF2, V-coat or broadband
    #[arg(long, value_name = "NAME")]
    pub coating: Option<String>,
    /// Also lists the N most powerful ghosts of two reflections of each field, at the primary
    /// wavelength
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "10", value_parser = clap::value_parser!(u16).range(1..))]
    pub ghosts: Option<u16>,
    /// Folder of glass catalogs (.agf, .yml, .toml), more than once if needed; ABBE_GLASS_PATH
    /// otherwise
    #[arg(long, value_name = "FOLDER")]
    pub glass_path: Vec<PathBuf>,
    /// Draws the cross-section with traced rays
    #[arg(long, value_name = "SVG")]
    pub drawing: Option<PathBuf>,
    /// Draws the spots of all fields
    #[arg(long, value_name = "SVG")]
    pub spots: Option<PathBuf>,
    /// Draws the ray fans of all fields
    #[arg(long, value_name = "SVG")]
    pub fans: Option<PathBuf>,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `abbe glass`.
#[derive(Debug, Args)]
pub struct GlassOptions {
    /// The glass, such as schott:N-SF11 or N-SF11; other words are searched for
    #[arg(value_name = "NAME", required_unless_present = "list")]
    pub name: Option<String>,
    /// Lists the names of all glasses
    #[arg(long, conflicts_with = "name")]
    pub list: bool,
    /// Folder of glass catalogs (.agf, .yml, .toml), more than once if needed; ABBE_GLASS_PATH
    /// otherwise
    #[arg(long, value_name = "FOLDER")]
    pub glass_path: Vec<PathBuf>,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
}
