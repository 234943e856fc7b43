//! `abbe lens`: the data of a lens prescription, and drawings of it.

mod drawing;
mod plots;
mod report;

use super::args::LensOptions;
use super::{CliError, Outcome, ending, print};
use crate::io::atomic;
use crate::io::destination::Claims;
use crate::optics::{Prescription, Wavelength, stacks};
use crate::spectrum::Library;
use crate::spectrum::ior::{LINE_C_NM, LINE_D_NM, LINE_F_NM};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The built-in library with the catalogs of the folders of `--glass-path`, or else of
/// `ABBE_GLASS_PATH`.
pub fn library(folders: &[PathBuf]) -> Result<Library, CliError> {
    let mut library = Library::embedded().clone();
    let from_environment: Vec<PathBuf>;
    let folders = if folders.is_empty() {
        let list = std::env::var_os("ABBE_GLASS_PATH").unwrap_or_default();
        let paths = std::env::split_paths(&list);
        from_environment = paths.filter(|p| !p.as_os_str().is_empty()).collect();
        &from_environment
    } else {
        folders
    };
    for folder in folders {
        crate::io::glass::add_folder(&mut library, folder)
            .map_err(|e| CliError::Failed(e.to_string()))?;
    }
    Ok(library)
}

/// A wavelength by its letter or in nanometers.
fn wavelength(text: &str) -> Result<f64, CliError> {
    match text.trim() {
        "F" => Ok(LINE_F_NM),
        "d" => Ok(LINE_D_NM),
        "C" => Ok(LINE_C_NM),
        number => match number.parse::<f64>() {
            Ok(nm) if nm.is_finite() && nm > 0.0 => Ok(nm),
            _ => Err(CliError::Usage(format!(
                "--wavelengths: `{number}` is neither F, d, C nor nanometers"
            ))),
        },
    }
}

fn field(text: &str) -> Result<[f64; 2], CliError> {
    let parts: Result<Vec<f64>, _> = text.split(':').map(|p| p.trim().parse::<f64>()).collect();
    match parts.as_deref() {
        Ok(&[y]) if y.is_finite() => Ok([0.0, y]),
        Ok(&[x, y]) if x.is_finite() && y.is_finite() => Ok([x, y]),
        _ => Err(CliError::Usage(format!(
            "--fields: `{text}` is neither Y nor X:Y"
        ))),
    }
}

fn adjust(
    lens: &mut Prescription,
    options: &LensOptions,
    library: &Library,
) -> Result<(), CliError> {
    if !options.wavelengths.is_empty() {
        let list = options.wavelengths.iter().map(|w| wavelength(w));
        let nm: Vec<f64> = list.collect::<Result<_, _>>()?;
        // the primary is the one nearest to what was primary
        let was = lens.primary_nm();
        let distance = |i: &usize| (nm[*i] - was).abs();
        let nearest = (0..nm.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        lens.primary = nearest.unwrap_or(0);
        lens.wavelengths = nm
            .into_iter()
            .map(|nm| Wavelength { nm, weight: 1.0 })
            .collect();
    }
    if !options.fields.is_empty() {
        lens.fields = options
            .fields
            .iter()
            .map(|f| field(f))
            .collect::<Result<_, _>>()?;
    }
    lens.validate()
        .map_err(|e| CliError::file(&options.file, e.to_string()))?;
    if let Some(name) = &options.coating {
        let stack = stacks::named(name, library)?.ok_or_else(|| {
            let names = stacks::NAMES.join(", ");
            CliError::Usage(format!("--coating: there is no coating `{name}` ({names})"))
        })?;
        if stack.backing.is_some() {
            return Err(CliError::Usage(format!(
                "--coating: `{name}` lets no light through"
            )));
        }
        lens.coat(&stack);
    }
    Ok(())
}

fn write(path: &Path, svg: &str) -> Result<(), CliError> {
    Ok(atomic::write_atomic(path, |out| {
        out.write_all(svg.as_bytes())
    })?)
}

/// Runs the command.
pub fn run(options: &LensOptions) -> Result<Outcome, CliError> {
    let library = library(&options.glass_path)?;
    let mut lens = crate::io::lens::read(&options.file, &library).map_err(CliError::Failed)?;
    adjust(&mut lens, options, &library)?;
    let mut claims = Claims::of_inputs([&options.file]);
    let outputs = [&options.drawing, &options.spots, &options.fans];
    for path in outputs.into_iter().flatten() {
        claims.output(path)?;
        ending::drawing(path)?;
    }
    let report = report::Report::new(&lens, options.ghosts.map(usize::from));
    let printed = print(&if options.json {
        report.json()
    } else {
        report.table()
    });
    if let Some(path) = &options.drawing {
        write(path, &drawing::cross_section(&lens))?;
    }
    if let Some(path) = &options.spots {
        write(path, &plots::spots(&lens, &report))?;
    }
    if let Some(path) = &options.fans {
        write(path, &plots::fans(&lens))?;
    }
    printed.map(|()| Outcome::Done)
}
