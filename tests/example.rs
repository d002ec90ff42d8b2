//! The example FMU is what the READMEs show, and what they say of it works.

use std::fs;
use std::path::Path;
use std::process::Command;

const REPOSITORY: &str = env!("CARGO_MANIFEST_DIR");

fn read(file: &str) -> String {
    fs::read_to_string(Path::new(REPOSITORY).join(file)).unwrap()
}

#[track_caller]
fn shows(readme: &str, file: &str) {
    let source = read(file);
    let (_, code) = source.split_once("\n\n").unwrap();
    assert!(read(readme).contains(&format!("```rust,ignore\n{code}```")), "{readme} does not show {file}");
}

#[test]
fn the_readmes_show_the_example() {
    shows("crates/fmu-export/README.md", "examples/lag-fmu/src/lib.rs");
    shows("crates/fmu-package/README.md", "examples/lag-fmu/build_fmu.rs");
}

/// `[lints] workspace = true` would not survive a copy.
#[test]
fn the_example_has_the_lints_of_the_workspace() {
    let workspace = read("Cargo.toml");
    let (_, lints) = workspace.split_once("[workspace.lints.rust]\n").unwrap();
    let (lints, _) = lints.split_once("\n[package]").unwrap();
    let lints = lints.replace("[workspace.", "[");
    let example = read("examples/lag-fmu/Cargo.toml");
    assert!(example.contains(&format!("[lints.rust]\n{}", lints.trim_end())), "{lints}");
}

/// What the example's README says about copying it, word for word up to where the copy goes. The copy shares
/// the target folder, so it is also renamed, as the README proposes.
#[test]
fn a_copy_elsewhere_becomes_an_fmu() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("my-fmu");
    let readme = read("examples/lag-fmu/README.md");
    let commands = readme.split("```sh\n").find(|text| text.starts_with("cp ")).unwrap();
    let (commands, _) = commands.split_once("```").unwrap();
    let commands = commands.replace("../my-fmu", copy.to_str().unwrap());
    let (copying, building) = commands.split_once("cd ").unwrap();

    let run = |commands: &str| {
        let output = Command::new("sh")
            .args(["-euc", commands])
            .current_dir(REPOSITORY)
            .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap())
            .env("CARGO_NET_OFFLINE", "true")
            .output()
            .unwrap();
        assert!(output.status.success(), "{commands}\n{}", String::from_utf8_lossy(&output.stderr));
    };
    run(copying);
    for (file, from, to) in [
        ("Cargo.toml", "name = \"lag_fmu\"", "name = \"my_fmu\""),
        ("Cargo.toml", "build_fmu_lag", "build_my_fmu"),
        ("build_fmu.rs", "lag_fmu::", "my_fmu::"),
        ("src/lib.rs", "\"lag\"", "\"my_model\""),
    ] {
        let text = fs::read_to_string(copy.join(file)).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(copy.join(file), text.replace(from, to)).unwrap();
    }
    let building = building.replace("cargo run --release", &format!("'{}' run", env!("CARGO")));
    run(&format!("cd {building}"));

    let fmu = fs::File::open(copy.join("target/fmu/my_model.fmu")).unwrap();
    let mut fmu = zip::ZipArchive::new(fmu).unwrap();
    let text = std::io::read_to_string(fmu.by_name("modelDescription.xml").unwrap()).unwrap();
    assert!(text.contains(r#"modelIdentifier="my_model""#), "{text}");
    assert_eq!(fmu.len(), 2);
}
