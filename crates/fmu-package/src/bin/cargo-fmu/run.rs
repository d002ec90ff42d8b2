//! Simulates the FMU of a model.

use crate::builder::{self, Purpose};
use crate::inputs::{Table, is_exact, named, value};
use crate::motion::{Comparison, Motion, examine};
use crate::plot::plot;
use crate::project::{Package, Project};
use crate::results::{Column, write_table};
use anyhow::{Context, Result, bail, ensure};
use fmi_abi::Causality;
use fmu_package::terminal::{fmi_version, short};
use fmu_package::{BuildOptions, Standard};
use fmu_run::{
    BaseType, Batch, Description, Fmu, Logged, Runs, Start, Status, System, Value, Variable, Watch,
};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

/// The options of `run`.
#[derive(clap::Args, Clone, Debug)]
pub struct Options {
    #[command(flatten)]
    package: Package,
    /// Start value: a number, true, false, an enumeration item, or a string; for an array, one value for all elements, or
    /// one for each, separated by commas; repeat the option for several variables
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    /// Inputs over time: a CSV file with a column time and one column for each input; two rows with the same time make a jump
    #[arg(long, value_name = "FILE")]
    input: Option<PathBuf>,
    /// Stop time, s [default: from the model's default experiment]
    #[arg(long, value_name = "S")]
    stop: Option<f64>,
    /// Step size, s [default: from the model's default experiment]
    #[arg(long, value_name = "S")]
    step: Option<f64>,
    /// Variables to show, separated by commas [default: all outputs except bytes]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    show: Vec<String>,
    /// Simulate the FMU for FMI 2.0 or for FMI 3.0 [default: 2, if FMI 2.0 has all types of the model]
    #[arg(long, value_parser = fmi_version, value_name = "2|3")]
    fmi: Option<Standard>,
    /// Show all messages of the model, not only warnings
    #[arg(long)]
    log: bool,
    /// Build and simulate again after every change of a model file
    #[arg(long)]
    watch: bool,
}

fn assignment(argument: &str) -> Result<(String, String), String> {
    let (name, value) = argument.split_once('=').ok_or("write NAME=VALUE, for example gain=2.5")?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

/// Builds and simulates the FMU. Returns false if the build or the run failed. With `--watch`, repeats this after each change and never
/// returns.
pub fn run(options: &Options) -> Result<bool> {
    if !options.watch {
        return once(options);
    }
    let project = Project::find(&options.package)?;
    let names = ["Cargo.toml", "src", "modelDescription"].map(|name| project.directory.join(name));
    let watched: Vec<_> = names.into_iter().chain(options.input.clone()).collect();
    loop {
        let begin = Instant::now();
        let before = changes(watched.clone());
        match once(options) {
            Ok(true) => {
                println!("done in {:.1} s; waiting for a change (Ctrl-C ends)", begin.elapsed().as_secs_f64())
            }
            Ok(false) => println!("waiting for a change (Ctrl-C ends)"),
            Err(error) => println!("error: {error:#}\nwaiting for a change (Ctrl-C ends)"),
        }
        while changes(watched.clone()) == before {
            sleep(Duration::from_millis(300));
        }
        // An editor may still be writing other files.
        sleep(Duration::from_millis(100));
    }
}

/// Returns the time of the last change of each path and, for a directory, of everything in it.
fn changes(mut pending: Vec<PathBuf>) -> BTreeMap<PathBuf, Option<SystemTime>> {
    let mut found = BTreeMap::new();
    while let Some(path) = pending.pop() {
        pending.extend(fs::read_dir(&path).into_iter().flatten().flatten().map(|entry| entry.path()));
        let time = fs::metadata(&path).and_then(|data| data.modified()).ok();
        found.insert(path, time);
    }
    found
}

/// Checks FMUs with fmu-check: the given FMUs or, if none are given, the FMUs of the project, which are built first. Returns false if the
/// build or a check fails, or if the interface types differ for the inputs in a file.
pub fn check(
    package: &Package,
    given: &[PathBuf],
    input: Option<&Path>,
    options: &fmu_check::Options,
) -> Result<bool> {
    let mut fmus = given.to_vec();
    if fmus.is_empty() {
        let project = Project::find(package)?;
        let directory = project.workspace.join("target/fmu");
        let begin = SystemTime::now();
        let build = BuildOptions { out: Some(directory.clone()), ..BuildOptions::default() };
        if !builder::build(&project, &build, Purpose::Check, &["--out".into(), directory.clone().into()])? {
            return Ok(false);
        }
        fmus.extend(
            [directory.clone(), directory.join("fmi3")]
                .iter()
                .filter_map(|directory| newest(directory, begin)),
        );
    }
    // All FMUs are checked, even if the first one has findings.
    let mut good = true;
    for fmu in &fmus {
        let directory = fmu.parent().and_then(Path::file_name).unwrap_or_default();
        // Reports of several FMUs have the same file names, so each goes into a directory with the name of the FMU's directory.
        let out = options.out.as_ref().filter(|_| fmus.len() > 1).map(|out| out.join(directory));
        let options = fmu_check::Options { out: out.or(options.out.clone()), ..options.clone() };
        good &= fmu_check::command(fmu, &options) == ExitCode::SUCCESS;
        if let Some(input) = input {
            good &= agrees(fmu, input)?;
        }
    }
    Ok(good)
}

/// Returns whether both interface types of an FMU have the same results for the inputs in a file, and no other mistake shows. Prints the
/// results.
fn agrees(path: &Path, input: &Path) -> Result<bool> {
    // SAFETY: the user asks to run this FMU, which the check has executed before.
    #[allow(unsafe_code)]
    let fmu = unsafe { Fmu::open(path) }?;
    let table = Table::read(input, fmu.description())?;
    let time = times([None; 2], fmu.description(), Some(&table))?;
    let found = examine(&fmu, &Motion { time: &time, table: &table, starts: &[] })?;
    match &found.comparison {
        Some(comparison) => println!("{}: {comparison}", short(path)),
        None => println!("{}: there is only one interface type, so --input compares nothing", short(path)),
    }
    found.mistakes.iter().for_each(|mistake| println!("{}: {mistake}", short(path)));
    Ok(found.mistakes.is_empty() && !matches!(found.comparison, Some(Comparison::Differ(_))))
}

fn once(options: &Options) -> Result<bool> {
    let project = Project::find(&options.package)?;
    let directory = project.workspace.join("target/fmu");
    let build = BuildOptions {
        fmi: options.fmi,
        out: Some(directory.clone()),
        no_page: true,
        ..BuildOptions::default()
    };
    let begin = SystemTime::now();
    let mut arguments = vec!["--no-page".into(), "--out".into(), directory.clone().into()];
    if let Some(fmi) = options.fmi {
        arguments.extend(["--fmi".into(), if fmi == Standard::Fmi2 { "2" } else { "3" }.into()]);
    }
    if !builder::build(&project, &build, Purpose::Development, &arguments)? {
        return Ok(false);
    }
    // The time of a file tells only that it was built about now, so an FMU of the other version that an earlier command built
    // seconds ago must not be chosen.
    let of_version = |fmi: Standard, directory: &Path| {
        options.fmi.is_none_or(|only| only == fmi).then(|| newest(directory, begin)).flatten()
    };
    let fmu = of_version(Standard::Fmi2, &directory)
        .or_else(|| of_version(Standard::Fmi3, &directory.join("fmi3")));
    let fmu = fmu.with_context(|| format!("there is no new FMU in {}", short(&directory)))?;
    simulate(options, &fmu, &directory)
}

/// Returns the newest FMU in a directory that was written after `since`.
fn newest(directory: &Path, since: SystemTime) -> Option<PathBuf> {
    let made = |path: &PathBuf| {
        let is_new = |data: fs::Metadata| {
            // File systems may round times to seconds.
            data.modified().is_ok_and(|time| time + Duration::from_secs(2) > since)
        };
        path.extension().is_some_and(|suffix| suffix == "fmu") && fs::metadata(path).is_ok_and(is_new)
    };
    let mut made: Vec<_> =
        fs::read_dir(directory).ok()?.flatten().map(|entry| entry.path()).filter(made).collect();
    made.sort_by_key(|path| fs::metadata(path).and_then(|data| data.modified()).ok());
    made.pop()
}

/// Simulates an FMU and writes the table and the plot. Returns false if the run failed.
fn simulate(options: &Options, path: &Path, directory: &Path) -> Result<bool> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (csv, svg) = (directory.join(format!("{name}.csv")), directory.join(format!("{name}.svg")));
    // Removes the results of an earlier run, which would be wrong if this run fails.
    [&csv, &svg].iter().for_each(|old| drop(fs::remove_file(old)));
    // SAFETY: the FMU is the user's own model, which was just compiled.
    #[allow(unsafe_code)]
    let fmu = unsafe { Fmu::open(path) }?;
    let description = fmu.description();
    let table = options.input.as_deref().map(|file| Table::read(file, description)).transpose()?;
    let shown = shown(&options.show, description)?;
    let starts = options.set.iter().map(|(name, value)| starts(description, name, value));
    let starts = starts.collect::<Result<Vec<_>>>()?.concat();
    // The first row of a table is at the start of the run.
    let inputs = table.as_ref().map(Table::trajectories).unwrap_or_default();
    if let Some((name, _)) = starts.iter().find(|(name, _)| inputs.iter().any(|(input, _)| input == name)) {
        bail!(
            "{name} has a column in the table of --input, so --set {name} has no effect; leave out one of them"
        );
    }
    let mut time = times([options.stop, options.step], description, table.as_ref())?;
    let points = time.clone();
    let (runs, watch) = follow(fmu.system(), &time, table.as_ref(), &starts, &shown)?;
    let ended = watch.ended().pop();
    let failed = ended.is_none() && !runs.errors.is_empty();
    for (_, reason) in runs.errors.iter().filter(|_| failed) {
        eprintln!("error: {reason}");
    }
    print_messages(&watch, options.log);
    let mut columns = columns(description, &shown, &runs, time.len());
    // A failed run has values up to its failure, or none.
    let unreached = columns.iter().map(Column::unreached).min().filter(|_| !runs.errors.is_empty());
    let reached = time.len() - unreached.unwrap_or_default();
    if reached == 0 {
        return Ok(false);
    }
    columns.iter_mut().for_each(|column| column.truncate(reached));
    let step_size = time[1] - time[0];
    time.truncate(reached);
    // The model may end between two communication points.
    if let Some((_, end, values)) = ended.filter(|(_, end, _)| *end > time[reached - 1] + 1e-9 * step_size) {
        time.push(end);
        let mut values = values.into_iter();
        for (column, variable) in columns.iter_mut().zip(&shown) {
            // The values at the end do not include strings, bytes and 64-bit integers.
            column.push(if is_exact(variable) { f64::NAN } else { values.next().unwrap_or(f64::NAN) });
        }
    }
    write_table(&csv, &time, &columns).with_context(|| format!("cannot write {}", short(&csv)))?;
    plot(&svg, &description.model_name, &time, &columns)
        .with_context(|| format!("cannot draw {}", short(&svg)))?;
    let width = columns.iter().map(|column| column.name.len()).max().unwrap_or_default();
    for column in &columns {
        println!("{:width$}  {}", column.name, column.summary());
    }
    println!(
        "{}, {}: {} to {} s in {} steps",
        short(&csv),
        short(&svg),
        time[0],
        time[time.len() - 1],
        time.len() - 1
    );
    for (_, note) in runs.notes.iter().chain(&runs.errors).filter(|_| !failed) {
        println!("{note}");
    }
    if let Some(table) = table.as_ref().filter(|_| !failed) {
        match examine(&fmu, &Motion { time: &points, table, starts: &starts }) {
            Ok(found) => {
                match found.comparison {
                    Some(agree @ Comparison::Agree(_)) => println!("{agree}"),
                    Some(differ) => println!("warning: {differ}"),
                    None => {}
                }
                found.mistakes.iter().for_each(|mistake| println!("warning: {mistake}"));
            }
            Err(error) => println!("Co-Simulation and Model Exchange cannot be compared: {error:#}"),
        }
    }
    Ok(!failed)
}

/// Returns the results of a run as columns, in the order of the variables. `times` is the number of times in the run.
fn columns<'a>(
    description: &Description,
    shown: &[&'a Variable],
    runs: &Runs,
    times: usize,
) -> Vec<Column<'a>> {
    let (mut numbers, mut exact) = (runs.trajectories.chunks(times), runs.exact.chunks(times));
    let column = |variable: &&'a Variable| match is_exact(variable) {
        true => Column::of_values(variable, exact.next().unwrap_or_default().to_vec()),
        false => Column::of_numbers(description, variable, numbers.next().unwrap_or_default().to_vec()),
    };
    shown.iter().map(column).collect()
}

/// Runs the FMU over these times. Returns the results, and the watch that has collected the messages of the FMU.
fn follow(
    fmu: &System,
    time: &[f64],
    table: Option<&Table>,
    starts: &[(String, Value)],
    shown: &[&Variable],
) -> Result<(Runs, Watch)> {
    let batch = Batch {
        time,
        inputs: table.map(Table::trajectories).unwrap_or_default(),
        start: starts.iter().map(|(name, value)| (name.as_str(), Start::Value(value))).collect(),
        outputs: shown.iter().map(|variable| variable.name.as_str()).collect(),
        every: Some(1),
        threads: Some(1),
        ..Batch::default()
    };
    let watch = Watch::listening();
    let runs = fmu.run(&batch, &watch)?;
    Ok((runs, watch))
}

/// Prints the warnings of the FMU, or all its messages.
fn print_messages(watch: &Watch, all: bool) {
    for Logged { time, message, .. } in watch.take_messages() {
        // Without `all`, errors are left out, because `simulate` prints the reason of a failure.
        if all || message.status == Status::Warning {
            let time = time.map_or_else(String::new, |time| format!("t = {time} s, "));
            println!("{time}{}: {}", message.category, message.text.trim());
        }
    }
}

/// Returns the communication points, from the options `--stop` and `--step`, the times of the inputs, or the default experiment.
fn times(
    [own_stop, own_step]: [Option<f64>; 2],
    description: &Description,
    table: Option<&Table>,
) -> Result<Vec<f64>> {
    let [start, stop, step] = description.default_experiment;
    let start = table.and_then(|table| table.time.first().copied()).or(start).unwrap_or(0.0);
    let end_of_table = table.and_then(|table| table.time.last().copied()).filter(|end| *end > start);
    let stop = own_stop.or(end_of_table).or(stop).unwrap_or(start + 1.0);
    let step = own_step.or(step).unwrap_or((stop - start) / 500.0);
    ensure!(step > 0.0 && stop > start, "--stop {stop} must be after {start}, and --step {step} positive");
    let count = (stop - start) / step;
    let steps = count.round();
    ensure!(
        (1.0..=1e7).contains(&steps),
        "{steps} steps of {step} s are too few or too many; change --stop or --step"
    );
    // Only the end of a table or of the default experiment may be rounded to a step.
    ensure!(
        own_stop.is_none() && own_step.is_none() || (count - steps).abs() <= 1e-6,
        "from {start} to {stop} s are {count} steps of {step} s, not a whole number; change --stop or --step"
    );
    // A sum of steps would accumulate rounding errors.
    Ok((0..=steps as u32).map(|number| start + f64::from(number) * step).collect())
}

/// Returns the variables that are shown: those with these names, or all outputs except bytes if there are no names.
fn shown<'a>(names: &[String], description: &'a Description) -> Result<Vec<&'a Variable>> {
    if names.is_empty() {
        let is_shown = |variable: &&Variable| {
            variable.causality == Causality::Output && variable.base != BaseType::Binary
        };
        let outputs: Vec<_> = description.variables.iter().filter(is_shown).collect();
        ensure!(!outputs.is_empty(), "the model has no outputs; name variables with --show");
        return Ok(outputs);
    }
    let mut shown = Vec::new();
    for name in names {
        shown.extend(named(description, name, "show")?);
    }
    // The table could not be read by these names.
    for (index, variable) in shown.iter().enumerate() {
        let is_again = shown[..index].iter().any(|before| before.name == variable.name);
        ensure!(!is_again, "{} is twice among the variables of --show", variable.name);
    }
    Ok(shown)
}

/// Returns the start value of a variable, or of each element of an array.
fn starts(description: &Description, name: &str, text: &str) -> Result<Vec<(String, Value)>> {
    let found = named(description, name, "set")?;
    let is_array = found.len() > 1 || found[0].name != name;
    let values: Vec<&str> = if is_array { text.split(',').map(str::trim).collect() } else { vec![text] };
    ensure!(
        values.len() == found.len() || values.len() == 1,
        "{name} has {} elements, --set gives {} values; give one value for all, or one for each, separated by commas",
        found.len(),
        values.len()
    );
    let start = |(variable, text): (&&Variable, &&str)| {
        let value = value(description, variable, text)
            .with_context(|| format!("{} cannot be {text:?}", variable.name))?;
        Ok((variable.name.clone(), value))
    };
    found.iter().zip(values.iter().cycle()).map(start).collect()
}
