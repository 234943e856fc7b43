//! The options of every command. Values are checked as they are parsed, so that wrong ones are
//! usage errors that say what is allowed.

mod beginning;
mod develop;
mod images;
mod job;
mod lens;
mod overrides;
mod reports;
mod scene;
mod values;
#[cfg(feature = "view")]
mod view;

pub use beginning::{CompletionsOptions, ManOptions, NewOptions, Template};
pub use develop::DevelopOptions;
pub use images::{BandingOptions, CompareOptions, MergeOptions, SpotOptions};
pub use job::{CollectOptions, JobCommand, JobOptions, NewJobOptions, RunOptions, StatusOptions};
pub use lens::{GlassOptions, LensOptions};
pub use overrides::Overrides;
pub use reports::CostOptions;
pub use scene::{ConvertOptions, InfoOptions, RenderOptions};

#[cfg(feature = "view")]
pub use view::ViewOptions;

use crate::io::identity::VERSION;
use clap::{Args, Parser, Subcommand};
use std::sync::LazyLock;

/// Version, target and profile.
fn long_version() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        let profile = if cfg!(debug_assertions) {
            "debug"
        } else {
            "release"
        };
        format!(
            "{VERSION} ({} {}, {profile})",
            std::env::consts::ARCH,
            std::env::consts::OS
        )
    });
    &TEXT
}

/// Spectral bidirectional path tracer for dispersive glass and correct color.
#[derive(Debug, Parser)]
#[command(name = "abbe", version = long_version())]
pub struct Arguments {
    /// Command to carry out.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Renders a scene to an EXR image of XYZ with a PNG preview beside it
    Render(Box<RenderOptions>),
    /// Says what a scene holds and calls for, and why
    Info(InfoOptions),
    /// Shows what accuracy costs in time: renders a scene by several methods and reports error
    /// against time
    Cost(Box<CostOptions>),
    /// Measures how far an image is from a reference
    Compare(CompareOptions),
    /// Measures the spots in an image of a detector: power, centroid, radius, encircled energy, MTF
    Spot(SpotOptions),
    /// Makes a picture of an image or part: exposure, tone curve, white balance, gamut of the
    /// display
    Develop(Box<DevelopOptions>),
    /// Shows a scene while it renders, or an image, as a page in the browser
    #[cfg(feature = "view")]
    View(ViewOptions),
    /// Shows the refractive index of a glass
    Glass(GlassOptions),
    /// Prints the reference of all keys of scene files
    Keys(KeysOptions),
    /// Shows the data of a lens prescription: paraxial, aberrations, spots, transmission; drawings
    Lens(Box<LensOptions>),
    /// Adds up part files of disjoint passes
    Merge(MergeOptions),
    /// Renders that last: a folder of chunks that any number of processes work on
    Job(Box<JobOptions>),
    /// Shows what sharing wavelengths and times in a pass does: photon merging beside bidirectional
    /// path tracing
    Banding(BandingOptions),
    /// Writes an editable scene file that refers to a model
    Convert(ConvertOptions),
    /// Writes a commented scene to begin with
    New(NewOptions),
    /// Prints a script that completes commands and options in a shell
    Completions(CompletionsOptions),
    /// Writes the manual pages
    Man(ManOptions),
}

/// Options of `abbe keys`.
#[derive(Debug, Args)]
pub struct KeysOptions {
    /// Prints a JSON Schema for editors instead of tables
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::layers::Layer;
    use clap::CommandFactory;

    fn render(arguments: &[&str]) -> Result<Box<RenderOptions>, clap::Error> {
        let all = ["abbe", "render", "scene.toml"].iter().chain(arguments);
        match Arguments::try_parse_from(all)?.command {
            Command::Render(options) => Ok(options),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn definitions_are_consistent() {
        Arguments::command().debug_assert();
    }

    /// The words of a command as a shell reads them, without what it does with the output.
    fn words(command: &str) -> Vec<String> {
        let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
        for c in command.chars().chain([' ']) {
            match (c, quote) {
                ('\'' | '"', None) => quote = Some(c),
                (c, Some(end)) if c == end => quote = None,
                (' ', None) => {
                    words.extend(Some(std::mem::take(&mut word)).filter(|w| !w.is_empty()));
                }
                (c, _) => word.push(c),
            }
        }
        let end = |w: &String| ["#", "|", ">", "&&", "||", ";"].contains(&w.as_str());
        // names in capitals stand for a number or a file
        let stands_in = |w: &String| w.chars().all(|c| c.is_ascii_uppercase());
        let given = |w: String| if stands_in(&w) { "7".to_owned() } else { w };
        words
            .into_iter()
            .take_while(|w| !end(w))
            .map(given)
            .collect()
    }

    #[test]
    fn the_commands_of_the_documentation_are_understood() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let pages = std::fs::read_dir(root.join("docs")).expect("docs");
        let pages = pages.map(|entry| entry.expect("an entry").path());
        let pages = pages.filter(|path| path.extension().is_some_and(|e| e == "md"));
        let mut count = 0;
        for page in pages.chain([root.join("README.md"), root.join("scenes/README.md")]) {
            let text = std::fs::read_to_string(&page).expect("a page");
            for block in text.split("```sh\n").skip(1) {
                let block = block.split("```").next().unwrap_or_default();
                let block = block.replace("\\\n", " ");
                let commands = block.lines().filter(|line| line.starts_with("abbe "));
                for command in commands {
                    // variables of loops stand for values that only a shell knows
                    if command.contains('$') {
                        continue;
                    }
                    count += 1;
                    let parsed = Arguments::try_parse_from(words(command));
                    let place = page.display();
                    assert!(
                        parsed.is_ok(),
                        "{place}: {command}\n{}",
                        parsed.unwrap_err()
                    );
                }
            }
        }
        assert!(count > 50, "only {count} commands seen");
    }

    #[test]
    fn options_become_overrides_and_set_comes_last() {
        let options = render(&[
            "--spp",
            "3",
            "--integrator",
            "light",
            "--wavelengths",
            "486.1,600",
            "--set",
            "render.spp = 5",
        ]);
        let overrides = options.unwrap().scene_overrides();
        let as_text: Vec<String> = overrides.iter().map(|(k, v)| format!("{k}={v}")).collect();
        let expected = [
            "render.integrator=light",
            "render.spp=3",
            "render.wavelengths={ lines_nm = [486.1, 600.0] }",
            "render.spp=5",
        ];
        assert_eq!(as_text, expected);
    }

    #[test]
    fn layers_are_named_or_classes() {
        let options = render(&["--aov", "error,class:^LS+DE$,depth"]).unwrap();
        assert!(
            matches!(&options.aov[..], [Layer::Error, Layer::Class(class), Layer::Depth] if class == "^LS+DE$")
        );
        assert!(render(&["--aov", "grain"]).is_err());
        assert!(render(&["--aov", "class:("]).is_err());
        assert!(render(&["--aov", "class:L T(1) R(x) E"]).is_err());
        assert!(render(&["--aov", "direct,ghosts,class:L T(1) R(\"back\") E"]).is_ok());
    }

    #[test]
    fn spectral_has_a_default_number_of_bins() {
        assert_eq!(render(&["--spectral"]).unwrap().spectral, Some(47));
        assert_eq!(render(&["--spectral", "5"]).unwrap().spectral, Some(5));
        assert_eq!(render(&[]).unwrap().spectral, None);
    }
}
