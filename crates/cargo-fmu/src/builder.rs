//! Compiles a model together with a program that describes and packs it.
//!
//! The program is a package of its own in the target folder, which uses the model as a library: cargo makes the shared
//! library for the FMU and the library for the program in one go, so that a model is compiled once.

use crate::project::Project;
use anyhow::{Context, Result};
use cargo_metadata::{CrateType, Message};
use fmu_package::{BuildOptions, Sources, Variant};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use toml::{Table, Value};

/// Makes the FMUs in the folder `target/fmu` of the workspace, or where the options say; tells whether that was possible. If
/// not, the programs that were started have said why. `own` are arguments for a program that the package has for it.
pub fn build(project: &Project, options: &BuildOptions, purpose: Purpose, own: &[OsString]) -> Result<bool> {
    let mut command = match &project.own_builder {
        Some(name) => own_program(project, name),
        None => match generated_program(project, options, purpose)? {
            Some(program) => program,
            None => return Ok(false),
        },
    };
    command.args(options.arguments()).args(own);
    let status = command.status().with_context(|| format!("cannot start {:?}", command.get_program()))?;
    Ok(status.success())
}

/// The cargo that has started this program.
pub fn cargo() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

fn own_program(project: &Project, name: &str) -> Command {
    let mut command = Command::new(cargo());
    command.args(["run", "--quiet", "--release", "--package", &project.name, "--bin", name, "--"]);
    command.current_dir(&project.folder);
    command
}

/// Compiles the model and the program that packs it; `None` if that fails.
fn generated_program(project: &Project, options: &BuildOptions, purpose: Purpose) -> Result<Option<Command>> {
    let sources = Sources::of_package(&project.folder).fingerprint()?;
    let variant = Variant { sources, start: Vec::new(), tunable: options.tunable };
    let package = write_package(project, purpose)?;
    let mut command = Command::new(cargo());
    command
        .args(["build", "--release", "--message-format", "json-render-diagnostics", "--manifest-path"])
        .arg(package.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(project.target.join("cargo-fmu"))
        // Where the configuration of cargo is looked for.
        .current_dir(&project.folder)
        .env("FMU_GUID", variant.guid())
        .stdin(Stdio::null())
        .stdout(Stdio::piped());
    let mut child = command.spawn().context("cannot start cargo")?;
    let stdout = child.stdout.take().context("cargo has no output")?;
    let (mut program, mut library) = (None, None);
    for message in Message::parse_stream(BufReader::new(stdout)) {
        let Message::CompilerArtifact(artifact) = message.context("cannot read what cargo says")? else {
            continue;
        };
        if artifact.target.name == program_name(project) {
            program = artifact.executable;
        } else if artifact.manifest_path.parent().is_some_and(|folder| folder == project.folder)
            && artifact.target.crate_types.contains(&CrateType::CDyLib)
        {
            library = artifact.filenames.iter().find(|file| is_library(file.as_str())).cloned();
        }
    }
    if !child.wait().context("cannot wait for cargo")?.success() {
        return Ok(None);
    }
    let program = program.context("cargo has not said where the program is")?;
    let mut command = Command::new(program);
    let elsewhere = options.describe || options.guid || options.c_sources || options.all_targets;
    if !elsewhere && options.target.is_empty() && options.binary.is_empty() {
        let library = library.context("cargo has not said where the library is")?;
        let mut binary = OsString::from(format!("{}=", fmu_package::Platform::host()?));
        binary.push(library);
        command.arg("--binary").arg(binary);
    }
    Ok(Some(command))
}

fn is_library(file: &str) -> bool {
    [".so", ".dll", ".dylib"].iter().any(|suffix| file.ends_with(suffix))
}

/// What works on every byte of an FMU.
const COMPRESSING: [&str; 4] = ["crc32fast", "miniz_oxide", "sha2", "simd-adler32"];

/// What an FMU is made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Purpose {
    /// To be shipped: a fast library.
    Use,
    /// To be looked at, and changed again: a library that is there fast.
    Trial,
}

/// The program's name, one for each model: models may share a target folder.
fn program_name(project: &Project) -> String {
    format!("packs-{}", project.name)
}

/// Writes the package of the program, and tells its folder.
fn write_package(project: &Project, purpose: Purpose) -> Result<PathBuf> {
    let folder = project.target.join("cargo-fmu").join(&project.name);
    fs::create_dir_all(folder.join("src")).with_context(|| format!("cannot make {}", folder.display()))?;
    write(&folder.join("Cargo.toml"), &manifest(project, purpose)?)?;
    write(&folder.join("src/main.rs"), &program(project))?;
    let lock = folder.join("Cargo.lock");
    let known = folder.join("Cargo.lock.model");
    let of_model = fs::read_to_string(project.workspace.join("Cargo.lock")).unwrap_or_default();
    // Cargo goes on from there with what the program needs besides.
    if !lock.is_file() || fs::read_to_string(&known).ok().as_deref() != Some(of_model.as_str()) {
        fs::write(&lock, locked(&of_model, &tested())?)?;
        fs::write(&known, of_model)?;
    }
    Ok(folder)
}

/// The versions of other packages that this command was tested with, where it comes from a clone.
pub fn tested() -> String {
    let lock = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).map(|root| root.join("Cargo.lock"));
    lock.and_then(|lock| fs::read_to_string(lock).ok()).unwrap_or_default()
}

/// What a model has locked, and of other packages what is in another list.
fn locked(of_model: &str, others: &str) -> Result<String> {
    let mut lock: Table = toml::from_str(of_model).context("Cargo.lock is no TOML")?;
    let others: Table = toml::from_str(others).unwrap_or_default();
    let packages = |lock: &Table| lock.get("package").and_then(Value::as_array).cloned().unwrap_or_default();
    let series = |package: &Value| {
        let field = |name| package.get(name).and_then(Value::as_str).unwrap_or_default().to_owned();
        let version = field("version");
        let numbers: Vec<&str> = version.split('.').collect();
        let counts = numbers.iter().position(|number| *number != "0").unwrap_or(0);
        (field("name"), numbers[..=counts.min(numbers.len() - 1)].join("."))
    };
    let mut all = packages(&lock);
    let known: BTreeSet<_> = all.iter().map(series).collect();
    // What is of a registry; the rest is where it is.
    let is_elsewhere = |package: &Value| package.get("source").is_some();
    all.extend(
        packages(&others)
            .into_iter()
            .filter(|package| is_elsewhere(package) && !known.contains(&series(package))),
    );
    lock.entry("version").or_insert(Value::Integer(4));
    lock.insert("package".to_owned(), Value::Array(all));
    Ok(lock.to_string())
}

/// As the model's profile `release` says; what only packs is compiled quickly instead.
fn manifest(project: &Project, purpose: Purpose) -> Result<String> {
    let text = fs::read_to_string(project.workspace.join("Cargo.toml"))?;
    let own: Table = toml::from_str(&text)?;
    let table = |value: Option<&Value>| value.and_then(Value::as_table).cloned().unwrap_or_default();
    let mut release = table(own.get("profile").and_then(|profiles| profiles.get("release")));
    // A library that a program uses takes no part in it.
    release.remove("lto");
    release.insert("strip".to_owned(), Value::Boolean(true));
    let level = release.insert("opt-level".to_owned(), Value::Integer(0)).unwrap_or(Value::Integer(3));
    let set = |name: &str, value: Value| Table::from_iter([(name.to_owned(), value)]);
    let mut packages: Table = project
        .compiled
        .iter()
        .map(String::as_str)
        .chain(COMPRESSING)
        .map(|name| (name.to_owned(), Value::Table(set("opt-level", level.clone()))))
        .collect();
    packages.insert(program_name(project), Value::Table(set("incremental", Value::Boolean(true))));
    packages.extend(table(release.get("package")));
    if let Some(Value::Table(model)) = packages.get_mut(&project.name) {
        model.insert("incremental".to_owned(), Value::Boolean(purpose == Purpose::Trial));
    }
    release.insert("package".to_owned(), Value::Table(packages));
    let mut manifest: Table = toml::from_str(&format!(
        "[package]\nname = {:?}\nversion = \"0.0.0\"\nedition = \"2024\"\npublish = false\n\n[workspace]\n\n\
         [dependencies]\nfmu-package = {}\nmodel = {{ package = {:?}, path = {:?}, default-features = false }}\n",
        program_name(project),
        project.fmu_package,
        project.name,
        project.folder.display().to_string(),
    ))?;
    manifest.insert("profile".to_owned(), Value::Table(set("release", Value::Table(release))));
    if let Some(patch) = own.get("patch") {
        manifest.insert("patch".to_owned(), absolute(patch.clone(), &project.workspace));
    }
    Ok(format!("# Written by cargo fmu.\n{manifest}"))
}

/// Paths within, as seen from anywhere.
fn absolute(value: Value, folder: &Path) -> Value {
    let Value::Table(table) = value else { return value };
    let each = |(name, value): (String, Value)| match value {
        Value::String(path) if name == "path" => {
            (name, Value::String(folder.join(path).display().to_string()))
        }
        other => (name, absolute(other, folder)),
    };
    Value::Table(table.into_iter().map(each).collect())
}

fn program(project: &Project) -> String {
    let Project { crate_name, name, folder, .. } = project;
    format!(
        "//! Written by cargo fmu.\n\
         use model::model_of_export_fmu as Model; // not there? src/lib.rs of {crate_name} must end with export_fmu!(...);\n\n\
         fn main() -> std::process::ExitCode {{\n    \
         let (package, folder) = ({name:?}, {folder:?});\n    \
         fmu_package::build::<Model>(&fmu_package::Builder {{\n        \
         command: \"cargo fmu build\",\n        \
         ..fmu_package::Builder::new(package, folder)\n    \
         }})\n}}\n"
    )
}

/// A file that is right already stays untouched, so that cargo sees no change.
pub fn write(path: &Path, text: &str) -> Result<()> {
    if fs::read_to_string(path).ok().as_deref() == Some(text) {
        return Ok(());
    }
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
