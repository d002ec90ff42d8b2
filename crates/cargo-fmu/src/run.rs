//! Simulates the FMU of a model.

use crate::builder::{self, Purpose};
use crate::plot::{Trajectory as Curve, plot};
use crate::project::{Package, Project};
use anyhow::{Context, Result, bail, ensure};
use fmu_package::terminal::{fmi_version, short};
use fmu_package::{BuildOptions, Standard};
use fmu_run::{
    BaseType, Batch, Description, Fmu, Logged, Runs, Start, Status, Trajectory, Variable, Watch, nearest,
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
    /// Start value: a number, true, false, an enumeration item, or a string; for an array, one value for each element,
    /// separated by commas; repeat the option for several variables
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    /// Inputs over time: a CSV file with a column time and one column for each input
    #[arg(long, value_name = "FILE")]
    input: Option<PathBuf>,
    /// Stop time, s [default: from the model's default experiment]
    #[arg(long, value_name = "S")]
    stop: Option<f64>,
    /// Step size, s [default: from the model's default experiment]
    #[arg(long, value_name = "S")]
    step: Option<f64>,
    /// Variables to show, with commas between the names [default: all outputs]
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

/// Builds and simulates. Returns false if the build or the run failed.
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
        // An editor may write several files.
        sleep(Duration::from_millis(100));
    }
}

/// Returns files and the files in directories, each with the time of its last change.
fn changes(mut open: Vec<PathBuf>) -> BTreeMap<PathBuf, Option<SystemTime>> {
    let mut found = BTreeMap::new();
    while let Some(path) = open.pop() {
        open.extend(fs::read_dir(&path).into_iter().flatten().flatten().map(|entry| entry.path()));
        let time = fs::metadata(&path).and_then(|data| data.modified()).ok();
        found.insert(path, time);
    }
    found
}

/// Checks the given FMUs, or builds and checks those of the project. Returns false if a check failed.
pub fn check(package: &Package, given: &[PathBuf], options: &fmu_check::Options) -> Result<bool> {
    let mut fmus = given.to_vec();
    if fmus.is_empty() {
        let project = Project::find(package)?;
        let directory = project.workspace.join("target/fmu");
        let begin = SystemTime::now();
        let build = BuildOptions { out: Some(directory.clone()), ..BuildOptions::default() };
        if !builder::build(&project, &build, Purpose::Use, &["--out".into(), directory.clone().into()])? {
            return Ok(false);
        }
        fmus.extend(
            [directory.clone(), directory.join("fmi3")]
                .iter()
                .filter_map(|directory| newest(directory, begin)),
        );
    }
    // All FMUs are checked, regardless of the findings in the first.
    let mut good = true;
    for fmu in &fmus {
        let directory = fmu.parent().and_then(Path::file_name).unwrap_or_default();
        // Reports of several FMUs have the same file names, so each FMU gets a directory.
        let out = options.out.as_ref().filter(|_| fmus.len() > 1).map(|out| out.join(directory));
        let options = fmu_check::Options { out: out.or(options.out.clone()), ..options.clone() };
        good &= fmu_check::command(fmu, &options) == ExitCode::SUCCESS;
    }
    Ok(good)
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
    if !builder::build(&project, &build, Purpose::Trial, &arguments)? {
        return Ok(false);
    }
    let fmu = newest(&directory, begin).or_else(|| newest(&directory.join("fmi3"), begin));
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
    // SAFETY: the FMU is the user's own model, which was just compiled.
    #[allow(unsafe_code)]
    let fmu = unsafe { Fmu::open(path) }?;
    let description = fmu.description();
    let table = options.input.as_deref().map(Table::read).transpose()?;
    let shown = shown(&options.show, description)?;
    let starts = options
        .set
        .iter()
        .map(|(name, value)| starts(description, name, value))
        .collect::<Result<Vec<_>>>()?
        .concat();
    let mut time = times(options, description, table.as_ref())?;
    let (runs, watch) = follow(&fmu, &time, table.as_ref(), &starts, &shown)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (csv, svg) = (directory.join(format!("{name}.csv")), directory.join(format!("{name}.svg")));
    let ended = watch.ended().pop();
    let failed = ended.is_none() && !runs.errors.is_empty();
    for (_, reason) in runs.errors.iter().filter(|_| failed) {
        eprintln!("error: {reason}");
    }
    print_messages(&watch, options.log);
    // A failed run has values up to its failure, or none.
    let unreached =
        runs.trajectories.chunks(time.len()).map(unreached).min().filter(|_| !runs.errors.is_empty());
    let reached = time.len() - unreached.unwrap_or_default();
    if reached == 0 {
        [&csv, &svg].iter().for_each(|old| drop(fs::remove_file(old)));
        return Ok(false);
    }
    let mut trajectories: Vec<_> =
        runs.trajectories.chunks(time.len()).map(|values| values[..reached].to_vec()).collect();
    let step_size = time[1] - time[0];
    time.truncate(reached);
    // The model may end between two communication points.
    if let Some((_, end, values)) = ended.filter(|(_, end, _)| *end > time[reached - 1] + 1e-9 * step_size) {
        time.push(end);
        trajectories.iter_mut().zip(values).for_each(|(trajectory, value)| trajectory.push(value));
    }
    let curves: Vec<Curve> = shown
        .iter()
        .zip(&trajectories)
        .map(|(variable, values)| Curve {
            name: &variable.name,
            unit: variable.unit.as_deref().unwrap_or_default(),
            jumps: variable.base != BaseType::Real || variable.variability.as_deref() == Some("discrete"),
            is_boolean: variable.base == BaseType::Boolean,
            values,
        })
        .collect();
    write_table(&csv, &time, &curves).with_context(|| format!("cannot write {}", short(&csv)))?;
    plot(&svg, &description.model_name, &time, &curves)
        .with_context(|| format!("cannot draw {}", short(&svg)))?;
    summarize(&curves, &shown);
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
    Ok(!failed)
}

/// Runs the FMU over these times. The watch contains the messages of the FMU.
fn follow(
    fmu: &Fmu,
    time: &[f64],
    table: Option<&Table>,
    starts: &[(&str, Start)],
    shown: &[&Variable],
) -> Result<(Runs, Watch)> {
    let trajectories = table.map(|table| table.at(time)).unwrap_or_default();
    let batch = Batch {
        time,
        inputs: trajectories
            .iter()
            .map(|(name, trajectory)| (name.as_str(), Trajectory::Shared(trajectory)))
            .collect(),
        start: starts.to_vec(),
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
        // Errors are not warnings: `simulate` prints the reason of a failure.
        if all || message.status == Status::Warning {
            let time = time.map_or_else(String::new, |time| format!("t = {time} s, "));
            println!("{time}{}: {}", message.category, message.text.trim());
        }
    }
}

/// Returns the number of values at the end that the run did not reach.
fn unreached(values: &[f64]) -> usize {
    values.iter().rev().take_while(|value| value.is_nan()).count()
}

/// Prints the range of each variable.
fn summarize(curves: &[Curve], shown: &[&Variable]) {
    let width = curves.iter().map(|curve| curve.name.len()).max().unwrap_or_default();
    for (curve, variable) in curves.iter().zip(shown) {
        let finite = || curve.values.iter().copied().filter(|value| value.is_finite());
        let [low, high] =
            [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)];
        let range = match variable.base {
            _ if low > high => "no finite values".to_owned(),
            BaseType::Boolean if low == high => format!("always {}", low != 0.0),
            BaseType::Boolean => "false and true".to_owned(),
            BaseType::Real | BaseType::Float32 => {
                format!("from {:.6} to {:.6} {}", low + 0.0, high + 0.0, curve.unit)
            }
            _ => format!("from {low} to {high} {}", curve.unit),
        };
        println!("{:width$}  {}", curve.name, range.trim_end());
    }
}

/// Returns the communication points, from the options, the times of the inputs, or the default experiment.
fn times(options: &Options, description: &Description, table: Option<&Table>) -> Result<Vec<f64>> {
    let [start, stop, step] = description.default_experiment;
    let start = table.and_then(|table| table.time.first().copied()).or(start).unwrap_or(0.0);
    let end_of_table = table.and_then(|table| table.time.last().copied());
    let stop = options.stop.or(end_of_table).or(stop).unwrap_or(start + 1.0);
    let step = options.step.or(step).unwrap_or((stop - start) / 500.0);
    ensure!(step > 0.0 && stop > start, "--stop {stop} must be after {start}, and --step {step} positive");
    let steps = ((stop - start) / step).round();
    ensure!(
        (1.0..=1e7).contains(&steps),
        "{steps} steps of {step} s are too few or too many; change --stop or --step"
    );
    // A sum of steps would accumulate rounding errors.
    Ok((0..=steps as u32).map(|number| start + f64::from(number) * step).collect())
}

fn shown<'a>(names: &[String], description: &'a Description) -> Result<Vec<&'a Variable>> {
    let is_number = |variable: &&Variable| !matches!(variable.base, BaseType::String | BaseType::Binary);
    if names.is_empty() {
        let outputs: Vec<_> = description
            .variables
            .iter()
            .filter(|variable| variable.causality == "output")
            .filter(is_number)
            .collect();
        ensure!(!outputs.is_empty(), "the model has no outputs that are numbers; name variables with --show");
        return Ok(outputs);
    }
    let mut shown = Vec::new();
    for name in names {
        let found = named(description, name);
        ensure!(!found.is_empty(), "there is no variable {name} to show{}", hint(description, name));
        shown.extend(found);
    }
    Ok(shown)
}

/// Returns the variable of this name, or the elements of the array.
fn named<'a>(description: &'a Description, name: &str) -> Vec<&'a Variable> {
    if let Some(variable) = description.variable(name) {
        return vec![variable];
    }
    let is_element = |variable: &&Variable| {
        variable.name.strip_prefix(name).is_some_and(|index| index.starts_with('[') && index.ends_with(']'))
    };
    description.variables.iter().filter(is_element).collect()
}

/// Names a similar variable, if there is one.
fn hint(description: &Description, name: &str) -> String {
    let near = nearest(name, description.variables.iter().map(|variable| variable.name.clone()));
    near.map_or(String::new(), |near| format!("; did you mean {near}?"))
}

/// Returns the start value of a variable, or of each element of an array.
fn starts<'a>(description: &'a Description, name: &str, value: &'a str) -> Result<Vec<(&'a str, Start<'a>)>> {
    let found = named(description, name);
    ensure!(!found.is_empty(), "there is no variable {name} to set{}", hint(description, name));
    let is_array = found.len() > 1 || found[0].name != name;
    let values: Vec<&str> = if is_array { value.split(',').map(str::trim).collect() } else { vec![value] };
    ensure!(
        values.len() == found.len() || values.len() == 1,
        "{name} has {} elements, --set gives {} values; give one value for all, or one for each, separated by commas",
        found.len(),
        values.len()
    );
    // Start::Text is a value of a string or a Boolean, or the name of an enumeration item.
    let start = |variable: &Variable, value: &'a str| match value.parse() {
        Ok(number) if variable.base != BaseType::String => Start::Same(number),
        _ => Start::Text(value),
    };
    let values = values.iter().cycle();
    Ok(found
        .iter()
        .zip(values)
        .map(|(variable, value)| (variable.name.as_str(), start(variable, value)))
        .collect())
}

fn write_table(path: &Path, time: &[f64], curves: &[Curve]) -> Result<()> {
    let mut writer = csv::Writer::from_path(path)?;
    writer.write_record(std::iter::once("time").chain(curves.iter().map(|curve| curve.name)))?;
    for (row, time) in time.iter().enumerate() {
        let value = |curve: &Curve| match curve.values[row] {
            value if curve.is_boolean => (value != 0.0).to_string(),
            value => value.to_string(),
        };
        writer.write_record(std::iter::once(time.to_string()).chain(curves.iter().map(value)))?;
    }
    Ok(writer.flush()?)
}

/// Inputs over time.
struct Table {
    time: Vec<f64>,
    inputs: Vec<(String, Vec<f64>)>,
}

impl Table {
    fn read(file: &Path) -> Result<Self> {
        let path = || short(file);
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(file).with_context(path)?;
        let names: Vec<String> = reader.headers().with_context(path)?.iter().map(str::to_owned).collect();
        let mut columns = vec![Vec::new(); names.len()];
        for (row, record) in reader.records().enumerate() {
            for (column, field) in record.with_context(path)?.iter().enumerate() {
                let value = match field {
                    "true" => Ok(1.0),
                    "false" => Ok(0.0),
                    number => number.parse::<f64>(),
                };
                let value = value.with_context(|| {
                    format!("{}, line {}: {} is {field:?}", path(), row + 2, names[column])
                })?;
                columns[column].push(value);
            }
        }
        let mut columns: Vec<_> = names.into_iter().zip(columns).collect();
        let Some(time) = columns.iter().position(|(name, _)| name == "time") else {
            bail!("{} has no column time", path());
        };
        let (_, time) = columns.remove(time);
        ensure!(time.len() > 1, "{} needs at least two times", path());
        ensure!(time.is_sorted_by(|a, b| a < b), "{}: times must increase", path());
        Ok(Self { time, inputs: columns })
    }

    /// Returns the inputs at these times, linearly interpolated.
    fn at(&self, times: &[f64]) -> Vec<(String, Vec<f64>)> {
        let value = |values: &[f64], time: f64| {
            let after = self.time.partition_point(|given| *given <= time).clamp(1, self.time.len() - 1);
            let (begin, end) = (self.time[after - 1], self.time[after]);
            let part = ((time - begin) / (end - begin)).clamp(0.0, 1.0);
            values[after - 1] + part * (values[after] - values[after - 1])
        };
        let trajectory = |values: &[f64]| times.iter().map(|time| value(values, *time)).collect();
        self.inputs.iter().map(|(name, values)| (name.clone(), trajectory(values))).collect()
    }
}
