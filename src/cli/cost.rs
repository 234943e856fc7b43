//! `abbe cost`: what accuracy costs in time, told as it is measured.

use super::args::CostOptions;
use super::{CliError, Outcome, interrupt, print, threads};
use crate::render::Cancel;
use crate::report::cost::{Event, Extent, PAGE, Request, Study};
use crate::report::readable::{counted, duration};

/// Runs the command.
pub fn run(options: &CostOptions) -> Result<Outcome, CliError> {
    let folder = options.output.clone().unwrap_or_else(|| {
        let mut name = options.scene.file_stem().unwrap_or_default().to_owned();
        name.push(".cost");
        name.into()
    });
    let page = folder.join(PAGE);
    let study = Study::new(Request {
        scene: options.scene.clone(),
        overrides: options.overrides.set.clone(),
        sensor: options.sensor.clone(),
        reference: options.reference.clone(),
        extent: extent(options),
        seeds: options.seeds,
        folder,
        vary: options.vary.clone(),
        probe: options.probe,
    })?;
    interrupt::end_with("interrupted: the same command goes on from the cells that are done")?;
    let pool = threads::pool(options.threads)?;
    // cells that are rendered count, whoever reads of them
    let mut printed = Ok(());
    let mut say = |text: &str| {
        if !options.quiet && printed.is_ok() {
            printed = print(text);
        }
    };
    let mut tell = |event: Event| say(&text(options, &event));
    let (threads, never) = (pool.current_num_threads(), Cancel::default());
    let Some(report) = pool.install(|| study.run(threads, &never, &mut tell))? else {
        return Ok(Outcome::Interrupted);
    };
    for sentence in &report.sentences {
        say(&format!("{sentence}\n"));
    }
    say(&format!("{}\n", page.display()));
    printed.map(|()| Outcome::Done)
}

fn extent(options: &CostOptions) -> Extent {
    options
        .spp
        .map_or(Extent::Seconds(options.budget), Extent::Passes)
}

/// An event for readers.
fn text(options: &CostOptions, event: &Event) -> String {
    match event {
        Event::Begins { variants, cells } => {
            let length = |extent| match extent {
                Extent::Seconds(seconds) => duration(seconds),
                Extent::Passes(passes) => counted(passes.into(), "pass", "passes"),
            };
            let each = extent(options);
            let seeds = counted(options.seeds.into(), "seed", "seeds");
            format!(
                "{variants} variants, {seeds}, {} each: about {} in all\n",
                length(each),
                length(each.times(*cells)),
            )
        }
        Event::Cell {
            seed,
            label,
            rendered,
        } => {
            let seed = seed.map_or_else(String::new, |seed| format!("seed {seed}: "));
            let kept = if *rendered {
                ""
            } else {
                " (as rendered before)"
            };
            format!("  {seed}{label}{kept}\n")
        }
        Event::LeftOut { label, problems } => format!("  left out: {label}: {problems}\n"),
    }
}
