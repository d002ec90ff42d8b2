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
    let export = dependency()?;
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
    write(&folder.join("Cargo.toml"), &manifest(&name, &export))?;
    let lock = tested();
    if !lock.is_empty() && !in_workspace(folder) {
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

/// fmu-export as it came with this command: beside it in a clone, of the registry otherwise.
fn dependency() -> Result<String> {
    let version = env!("CARGO_PKG_VERSION");
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("fmu-export");
    Ok(if beside.join("Cargo.toml").is_file() {
        format!("{{ version = {version:?}, path = {:?} }}", beside.display().to_string())
    } else {
        format!("{version:?}")
    })
}

fn manifest(name: &str, export: &str) -> String {
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

# A small library, which asks for little of the system it runs on.
[profile.release]
lto = true
strip = true

[lints.rust]
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
