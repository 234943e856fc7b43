//! The files of `spectra/` that are built into the program.

use super::Curve;
use super::read::{Table, parse_table};

macro_rules! embedded {
    ($($path:literal),* $(,)?) => {
        [$(($path, include_str!(concat!("../../spectra/", $path)))),*]
    };
}

/// The files built in, by their path in `spectra/`.
pub(super) const FILES: [(&str, &str); 19] = embedded![
    "cie/A.csv",
    "cie/D50.csv",
    "cie/D65.csv",
    "cie/E.csv",
    "cie/F2.csv",
    "cie/F11.csv",
    "cie/cmf_1931_2deg.csv",
    "emission/Cd.csv",
    "emission/H.csv",
    "emission/Hg.csv",
    "emission/Na.csv",
    "glass/hikari.toml",
    "glass/material.toml",
    "glass/ohara.toml",
    "glass/schott.toml",
    "glass/vendors.txt",
    "metal/metal.toml",
    "reflectance/colorchecker.csv",
    "reflectance/srgb.csv",
];

/// The columns of a built-in CSV file.
pub(super) fn embedded_columns(path: &str) -> Vec<(String, Curve)> {
    let (_, text) = FILES
        .iter()
        .find(|f| f.0 == path)
        .expect("invariant: the file is in the list of built-in ones");
    columns(parse_table(text).expect("invariant: the built-in spectra are well formed"))
}

/// The columns of a CSV table, with their names.
pub(super) fn columns(table: Table) -> Vec<(String, Curve)> {
    let nm = table.nm;
    table
        .columns
        .into_iter()
        .map(|(name, values)| (name, Curve::table(&nm, &values)))
        .collect()
}
