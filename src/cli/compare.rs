//! `abbe compare`: how far an image is from a reference, and how much of its error is in bands; or
//! two tables of path classes.

use super::args::CompareOptions;
use super::{CliError, Outcome, print, tell};
use crate::report::class_tables;
use crate::report::compare::{self, Xyz};

/// Runs the command.
pub fn run(options: &CompareOptions) -> Result<Outcome, CliError> {
    let (image, reference) = (&options.image, options.reference.as_deref());
    if let Some(reference) = reference
        && class_tables::is_table(image)
        && class_tables::is_table(reference)
    {
        print(&class_tables::compare(image, reference, options.json)?)?;
        return Ok(Outcome::Done);
    }
    let (image, reference) = match reference {
        Some(reference) => {
            let [image, reference] = Xyz::read_pair(image, reference)?;
            if image.shows_another(&reference) {
                tell("warning: the images are of different scenes or sensors");
            }
            (image, Some(reference))
        }
        None => (Xyz::read(image)?, None),
    };
    let (json, text) = match reference {
        Some(reference) if !options.banding => {
            let errors = compare::errors(&image, &reference);
            (compare::errors_json(&errors), compare::errors_text(&errors))
        }
        // the parser lets only bands be measured without a reference
        reference => {
            let lines = options.lines.to_lines();
            let bands = compare::bands(&image, reference.as_ref(), &lines)?;
            (compare::bands_json(&bands), compare::bands_text(&bands))
        }
    };
    print(&if options.json {
        format!("{json:#}\n")
    } else {
        text
    })?;
    Ok(Outcome::Done)
}
