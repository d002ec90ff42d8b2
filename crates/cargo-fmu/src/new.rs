//! Begins a model: a crate of its own, from one of those that come with this command.

use crate::builder::{cargo, tested, write};
use anyhow::{Context, Result, bail, ensure};
use fmu_package::terminal::short;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What to begin with.
#[derive(clap::Args, Clone, Debug)]
pub struct Options {
    /// Its folder, which is made
    path: PathBuf,
    /// Its name [default: that of the folder]
    #[arg(long)]
    name: Option<String>,
    /// What to begin with: lag (the least there is), ball (events where a sign changes, an end), motor (events at times),
    /// house (a file, texts, units with an offset)
    #[arg(long, value_enum, value_name = "MODEL", default_value_t, hide_possible_values = true)]
    from: Begin,
    /// Take fmu-export from this git repository, as a URL, so that others can build the model
    #[arg(long, value_name = "URL")]
    git: Option<String>,
}

/// The models to begin with.
#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq)]
enum Begin {
    #[default]
    Lag,
    Ball,
    Motor,
    House,
}

/// The files of a model, all but those that every crate has.
macro_rules! files {
    ($model:literal: $($file:literal)+) => {
        ($model, &[$(($file, include_str!(concat!("../models/", $model, "/", $file)))),+])
    };
}

impl Begin {
    fn files(self) -> (&'static str, &'static [(&'static str, &'static str)]) {
        match self {
            Self::Lag => files!("lag": "src/lib.rs" "tests/lag.rs"),
            Self::Ball => files!("ball": "src/lib.rs" "src/ball.rs" "tests/ball.rs"),
            Self::Motor => files!("motor": "src/lib.rs" "src/motor.rs" "tests/motor.rs"),
            Self::House => {
                files!("house": "src/lib.rs" "src/house.rs" "tests/house.rs" "modelDescription/resources/winter.csv")
            }
        }
    }
}

/// Makes the crate.
pub fn new(options: &Options) -> Result<()> {
    let folder = &options.path;
    ensure!(!folder.exists(), "{} is there already; name a new folder", folder.display());
    let name = match &options.name {
        Some(name) => name.clone(),
        None => folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    };
    // Cargo knows what may be a name, and of the workspace and the repository around.
    let cargo = cargo();
    let mut command = Command::new(&cargo);
    command.args(["new", "--quiet", "--lib", "--edition", "2024", "--name", &name]).arg(folder);
    let output =
        command.output().with_context(|| format!("cannot start cargo ({})", cargo.to_string_lossy()))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        bail!("{}", text.trim().trim_start_matches("error: "));
    }
    let crate_name = name.replace('-', "_");
    let (model, files) = options.from.files();
    for (file, text) in files {
        let path = folder.join(file.replace("lag", &crate_name));
        let parent = path.parent().context("a file is in a folder")?;
        fs::create_dir_all(parent).with_context(|| format!("cannot make {}", parent.display()))?;
        let text = match options.from {
            // The least there is becomes what it is called; others keep what they are.
            Begin::Lag => renamed(&renamed(text, "lag", &crate_name), "Lag", &camel(&crate_name)),
            _ if file.starts_with("tests/") => {
                text.replace(&format!("use {model}::"), &format!("use {crate_name}::"))
            }
            _ => text.replace(&format!("\", \"{model}\")"), &format!("\", \"{crate_name}\")")),
        };
        write(&path, &text)?;
    }
    let in_workspace = in_workspace(folder);
    let export = Dependency::of(folder, options.git.as_deref())?;
    write(&folder.join("Cargo.toml"), &manifest(&name, &export, !in_workspace))?;
    let lock = tested();
    if !lock.is_empty() && !in_workspace {
        write(&folder.join("Cargo.lock"), &lock)?;
    }
    // With the width of its new place; without rustfmt it stays as it is.
    let _ = Command::new(&cargo).args(["fmt", "--quiet"]).current_dir(folder).output();
    println!(
        "{0} begins with {model}: change {0}/src/{1}, then\n  cd {0}\n  cargo test        # the model as it is\n  {2:<16}  # the FMU, a table and a picture",
        short(folder),
        if files.len() > 2 { format!("{model}.rs") } else { "lib.rs".to_owned() },
        match options.from {
            Begin::Lag => "cargo fmu run --set u=1",
            _ => "cargo fmu run",
        },
    );
    if let Dependency::Here(path) = export {
        println!(
            "Its Cargo.toml names {}, which is only on this machine; --git URL names a repository for everyone",
            path.display()
        );
    }
    Ok(())
}

/// Whether another folder's `Cargo.lock` is in force.
fn in_workspace(folder: &Path) -> bool {
    let mut command = Command::new(cargo());
    command.args(["locate-project", "--workspace", "--message-format", "plain"]).current_dir(folder);
    let root = command.output().map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    let own = fs::canonicalize(folder.join("Cargo.toml"));
    !matches!((root.and_then(fs::canonicalize), own), (Ok(root), Ok(own)) if root == own)
}

/// The source of fmu-export in a model's `Cargo.toml`.
enum Dependency {
    /// A registry has it.
    Registry,
    /// A commit of a git repository: URL and revision.
    Git(String, String),
    /// A path from the model, which is in the same git repository.
    Beside(String),
    /// A path on this machine.
    Here(PathBuf),
}

impl Dependency {
    /// fmu-export of the version of this command.
    fn of(folder: &Path, git: Option<&str>) -> Result<Self> {
        let package = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("fmu-export");
        let is_there = package.join("Cargo.toml").is_file();
        if let Some(url) = git {
            let revision = git_says(&package, &["rev-parse", "HEAD"]);
            let revision = revision.with_context(|| {
                format!("{} is in no git repository, so there is no revision to name", package.display())
            })?;
            return Ok(Self::Git(url.to_owned(), revision));
        }
        if !is_there {
            return Ok(Self::Registry);
        }
        let folder = fs::canonicalize(folder).with_context(|| short(folder))?;
        // cargo may have made the directory itself a repository.
        let around = folder.parent().unwrap_or(&folder);
        let root = git_says(around, &["rev-parse", "--show-toplevel"]).map(PathBuf::from);
        Ok(match root.filter(|root| package.starts_with(root)) {
            Some(_) => Self::Beside(relative(&folder, &package)),
            None => Self::Here(package),
        })
    }

    fn in_manifest(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        match self {
            Self::Registry => format!("{version:?}"),
            Self::Git(url, revision) => format!("{{ git = {url:?}, rev = {revision:?} }}"),
            Self::Beside(path) => format!("{{ version = {version:?}, path = {path:?} }}"),
            Self::Here(path) => {
                format!("{{ version = {version:?}, path = {:?} }}", path.display().to_string())
            }
        }
    }
}

/// What git prints in a directory, if it succeeds there.
fn git_says(folder: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(folder).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// The path from one directory to another.
fn relative(from: &Path, to: &Path) -> String {
    let common = from.components().zip(to.components()).take_while(|(one, other)| one == other).count();
    let up = from.components().skip(common).map(|_| "..".to_owned());
    let down = to.components().skip(common).map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

fn manifest(name: &str, export: &Dependency, with_profile: bool) -> String {
    let export = export.in_manifest();
    // A workspace has profiles in its own Cargo.toml only.
    let profile = match with_profile {
        true => {
            "# A small library, which asks for little of the system it runs on.\n[profile.release]\nlto = true\nstrip = true\n\n"
        }
        false => "",
    };
    format!(
        r#"[package]
name = {name:?}
version = "0.1.0"
edition = "2024"

# cdylib is what goes into the FMU; rlib what tests use.
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

/// Replaces a word where it is one.
fn renamed(text: &str, word: &str, by: &str) -> String {
    let mut result = String::new();
    let mut rest = text;
    while let Some(place) = rest.find(word) {
        let is_part =
            |letter: Option<char>| letter.is_some_and(|letter| letter.is_alphanumeric() || letter == '_');
        let (before, after) = (&rest[..place], &rest[place + word.len()..]);
        result.push_str(before);
        let part = is_part(result.chars().last()) || is_part(after.chars().next());
        result.push_str(if part { word } else { by });
        rest = after;
    }
    result + rest
}

/// As Rust names types.
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
