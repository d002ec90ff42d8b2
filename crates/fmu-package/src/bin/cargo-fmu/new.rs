//! Creates a crate from one of the models that this command contains.

use crate::builder::{own_clone, tested_lock, write};
use anyhow::{Context, Result, bail, ensure};
use fmu_package::cargo;
use fmu_package::terminal::short;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The options of `new`.
#[derive(clap::Args, Clone, Debug)]
pub struct Options {
    /// The directory of the new model
    path: PathBuf,
    /// Name of the model [default: the name of the directory]
    #[arg(long)]
    name: Option<String>,
    /// Model to start from: lag (the smallest), ball (state events, an early end), motor (time events),
    /// house (a file, strings, units with an offset), tank (the model of the guide: enumeration, array, events)
    #[arg(long, value_enum, value_name = "MODEL", default_value_t, hide_possible_values = true)]
    from: Begin,
    /// Take fmu-export from the git repository at this URL, so that others can build the model
    #[arg(long, value_name = "URL")]
    git: Option<String>,
}

/// Models to start from.
#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq)]
enum Begin {
    #[default]
    Lag,
    Ball,
    Motor,
    House,
    Tank,
}

/// The files of a model, except `Cargo.toml` and `Cargo.lock`, which are written for each crate.
macro_rules! files {
    ($model:literal: $($file:literal)+) => {
        ($model, &[$(($file, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/models/", $model, "/", $file)))),+])
    };
}

impl Begin {
    fn files(self) -> (&'static str, &'static [(&'static str, &'static str)]) {
        match self {
            Self::Lag => files!("lag": "src/lib.rs" "tests/lag.rs"),
            Self::Ball => files!("ball": "src/lib.rs" "src/ball.rs" "tests/ball.rs"),
            Self::Motor => files!("motor": "src/lib.rs" "src/motor.rs" "tests/motor.rs"),
            Self::Tank => files!("tank": "src/lib.rs" "tests/tank.rs"),
            Self::House => {
                files!("house": "src/lib.rs" "src/house.rs" "tests/house.rs" "modelDescription/resources/winter.csv")
            }
        }
    }
}

/// Creates the crate. After an error, the new directory is removed, because a part of a model would only be in the way.
pub fn new(options: &Options) -> Result<()> {
    let directory = &options.path;
    ensure!(!directory.exists(), "{} exists already; name a new directory", directory.display());
    create(options).inspect_err(|_| _ = fs::remove_dir_all(directory))
}

fn create(options: &Options) -> Result<()> {
    let directory = &options.path;
    let name = match &options.name {
        Some(name) => name.clone(),
        None => directory.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    };
    // Cargo accepts other letters, but the library's name becomes an identifier of C.
    ensure!(
        name.is_ascii(),
        "{name} has letters other than a to z, which an FMU cannot have in its identifier; add --name with letters, digits, - and _"
    );
    ensure!(
        name.replace('-', "_") != "fmu_export",
        "{name} is the name of the library that the model uses; add --name with another name"
    );
    // Cargo checks the name, adds the crate to a workspace above it, and creates a git repository unless there is one above.
    let cargo = cargo();
    let mut command = Command::new(&cargo);
    command.args(["new", "--quiet", "--lib", "--edition", "2024", "--name", &name]).arg(directory);
    let output =
        command.output().with_context(|| format!("cannot start cargo ({})", cargo.to_string_lossy()))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        // Cargo has no message if a signal ends it, for example because a file exceeds a limit.
        ensure!(!text.trim().is_empty(), "cargo new failed: {}", output.status);
        bail!("{}", text.trim().trim_start_matches("error: "));
    }
    let crate_name = name.replace('-', "_");
    let (model, files) = options.from.files();
    for (file, text) in files {
        let path = directory.join(file.replace("lag", &crate_name));
        let parent = path.parent().context("a file is in a directory")?;
        fs::create_dir_all(parent).with_context(|| format!("cannot create {}", parent.display()))?;
        let text = match options.from {
            // The type of the smallest model gets the name of the crate; the types of the others keep their names.
            Begin::Lag => renamed(&renamed(text, "lag", &crate_name), "Lag", &type_name(&crate_name)),
            _ if file.starts_with("tests/") => {
                text.replace(&format!("use {model}::"), &format!("use {crate_name}::"))
            }
            _ => text.replace(&format!("\", \"{model}\")"), &format!("\", \"{crate_name}\")")),
        };
        write(&path, &text)?;
    }
    let workspace = workspace_above(directory);
    let export = Dependency::of(directory, options.git.as_deref())?;
    write(&directory.join("Cargo.toml"), &manifest(&name, &export, workspace.is_none()))?;
    let lock = tested_lock();
    if !lock.is_empty() && workspace.is_none() {
        write(&directory.join("Cargo.lock"), &lock)?;
    }
    // The new names change line lengths, so the code is formatted again, unless rustfmt is not installed.
    let _ = Command::new(&cargo).args(["fmt", "--quiet"]).current_dir(directory).output();
    let run = match options.from {
        Begin::Lag => "cargo fmu run --set u=1",
        _ => "cargo fmu run",
    };
    println!(
        "{0} begins with {model}: change {0}/src/{1}, then\n  cd {0}\n  {2:<width$}  # the model before changes\n  \
        {run}  # the FMU, a table and a plot",
        short(directory),
        if files.len() > 2 { format!("{model}.rs") } else { "lib.rs".to_owned() },
        "cargo test",
        width = run.len(),
    );
    if let Some(root) = workspace {
        println!(
            "It is a member of the workspace in {0}, whose Cargo.toml lists it, so its FMUs go to {1}",
            root.display(),
            root.join("target/fmu").display()
        );
    }
    if let Dependency::Local(path) = export {
        println!(
            "Its Cargo.toml names {}, which is only on this machine; --git URL names a repository for everyone",
            path.display()
        );
    }
    Ok(())
}

/// Returns the directory of the workspace, if the crate is a member of one in another directory. Cargo then uses the `Cargo.lock` there.
fn workspace_above(directory: &Path) -> Option<PathBuf> {
    let mut command = Command::new(cargo());
    command.args(["locate-project", "--workspace", "--message-format", "plain"]).current_dir(directory);
    let output = command.output().ok()?;
    let root = PathBuf::from(String::from_utf8_lossy(&output.stdout).trim());
    let is_own = fs::canonicalize(&root).ok()? == fs::canonicalize(directory.join("Cargo.toml")).ok()?;
    if is_own { None } else { root.parent().map(Path::to_owned) }
}

/// The source of fmu-export in a model's `Cargo.toml`.
enum Dependency {
    /// The registry.
    Registry,
    /// A commit of a git repository: URL and revision.
    Git(String, String),
    /// A relative path within one git repository.
    Relative(String),
    /// A path on this machine.
    Local(PathBuf),
}

impl Dependency {
    /// Returns the source of fmu-export for a model in a directory.
    fn of(directory: &Path, repository: Option<&str>) -> Result<Self> {
        let package = own_clone().map(|root| root.join("crates/fmu-export"));
        if let Some(url) = repository {
            let revision = package.as_deref().and_then(|package| git(package, &["rev-parse", "HEAD"]));
            let revision = revision.context(
                "this program is not in a clone of its git repository, so there is no revision to name",
            )?;
            return Ok(Self::Git(url.to_owned(), revision));
        }
        let directory = fs::canonicalize(directory).with_context(|| short(directory))?;
        // `cargo new` may have created a repository in the directory itself.
        let parent = directory.parent().unwrap_or(&directory);
        let root = git(parent, &["rev-parse", "--show-toplevel"]).map(PathBuf::from);
        if let Some(root) = &root {
            let own = package.clone().filter(|package| package.starts_with(root));
            if let Some(package) = own.or_else(|| package_in(root)) {
                return Ok(Self::Relative(relative(&directory, &package)));
            }
        }
        Ok(package.map_or(Self::Registry, Self::Local))
    }

    fn in_manifest(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        match self {
            Self::Registry => format!("{version:?}"),
            Self::Git(url, revision) => format!("{{ git = {url:?}, rev = {revision:?} }}"),
            Self::Relative(path) => format!("{{ path = {path:?} }}"),
            Self::Local(path) => {
                format!("{{ version = {version:?}, path = {:?} }}", path.display().to_string())
            }
        }
    }
}

/// Returns the directory of fmu-export in a repository, which may have these crates as a submodule. In each clone of the repository,
/// the same version is then at the same relative path.
fn package_in(root: &Path) -> Option<PathBuf> {
    let names = ["fmu-export/Cargo.toml", "*/fmu-export/Cargo.toml"];
    let files = git(root, &[&["ls-files", "--recurse-submodules", "--"], &names[..]].concat())?;
    let mut packages = files.lines().filter_map(|file| Some(root.join(file).parent()?.to_owned()));
    packages.find(|package| {
        let manifest = fs::read_to_string(package.join("Cargo.toml")).unwrap_or_default();
        manifest.lines().any(|line| line.trim() == "name = \"fmu-export\"")
    })
}

/// Returns the output of git in a directory, if it succeeds.
fn git(directory: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(directory).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// Returns the path from one directory to another.
fn relative(from: &Path, to: &Path) -> String {
    let common = from.components().zip(to.components()).take_while(|(one, other)| one == other).count();
    let up = from.components().skip(common).map(|_| "..".to_owned());
    let down = to.components().skip(common).map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

fn manifest(name: &str, export: &Dependency, with_profile: bool) -> String {
    let export = export.in_manifest();
    // In a workspace, cargo ignores the profiles of its members.
    let profile = match with_profile {
        true => {
            "# Makes the library in the FMU small. An integer that overflows is an error, not another number.\n[profile.release]\nlto = true\nstrip = true\noverflow-checks = true\n\n"
        }
        false => "",
    };
    format!(
        r#"[package]
name = {name:?}
version = "0.1.0"
edition = "2024"

# The cdylib goes into the FMU; tests use the rlib.
[lib]
crate-type = ["cdylib", "rlib"]

[dependencies]
fmu-export = {export}

{profile}[lints.rust]
missing_docs = "warn"
unsafe_code = "deny"
"#
    )
}

/// Replaces a word where it is not part of a longer one.
fn renamed(text: &str, word: &str, replacement: &str) -> String {
    let mut result = String::new();
    let mut rest = text;
    while let Some(position) = rest.find(word) {
        let is_part =
            |letter: Option<char>| letter.is_some_and(|letter| letter.is_alphanumeric() || letter == '_');
        let (before, after) = (&rest[..position], &rest[position + word.len()..]);
        result.push_str(before);
        let part = is_part(result.chars().last()) || is_part(after.chars().next());
        result.push_str(if part { word } else { replacement });
        rest = after;
    }
    result + rest
}

/// Returns the name of the type of the smallest model. It is not a name that this model uses for something else, such as `Model`.
fn type_name(crate_name: &str) -> String {
    let used =
        ["CoSimulation", "Error", "Info", "Model", "ModelExchange", "Result", "Self", "Step", "Stepped"];
    let name = camel(crate_name);
    if used.contains(&&*name) { format!("My{name}") } else { name }
}

/// Returns a crate name as the name of a Rust type.
fn camel(name: &str) -> String {
    let capital = |word: &str| {
        let mut letters = word.chars();
        letters
            .next()
            .map(|first| first.to_uppercase().chain(letters).collect::<String>())
            .unwrap_or_default()
    };
    name.split('_').map(capital).collect()
}

#[cfg(test)]
mod tests {
    use super::type_name;

    #[test]
    fn types_do_not_hide_those_of_the_template() {
        for (name, type_of_model) in [
            ("heat_pump", "HeatPump"),
            ("model", "MyModel"),
            ("co_simulation", "MyCoSimulation"),
            ("steps", "Steps"),
        ] {
            assert_eq!(type_name(name), type_of_model);
        }
    }
}
