//! The guid depends on the package and on the packages that it uses by path, but not on their locations.

use fmu_package::Sources;
use std::fs;
use std::path::Path;

/// Makes a workspace with a model that uses `near` by path; `near` uses `far`, outside of the workspace.
fn project(directory: &Path) {
    let package = |name: &str, dependencies: &str| {
        let code = directory.join(name).join("src");
        fs::create_dir_all(&code).unwrap();
        fs::write(code.join("lib.rs"), "").unwrap();
        let manifest = format!("[package]\nname = \"{}\"\n{dependencies}", name.replace('/', "_"));
        fs::write(directory.join(name).join("Cargo.toml"), manifest).unwrap();
    };
    fs::create_dir_all(directory.join("all")).unwrap();
    let workspace = "[workspace]\nmembers = [\"model\", \"near\", \"tools\"]\n\
                     [workspace.dependencies]\nall_near = { path = \"near\" }\n";
    fs::write(directory.join("all/Cargo.toml"), workspace).unwrap();
    fs::write(directory.join("all/Cargo.lock"), "").unwrap();
    package(
        "all/model",
        "[dependencies]\nall_near.workspace = true\n[dev-dependencies]\nall_tools.path = \"../tools\"\n",
    );
    package(
        "all/near",
        "[target.'cfg(windows)'.dependencies]\nfar.path = \"../../far\"\n[build-dependencies]\nall_model.path = \"../model\"\n",
    );
    package("all/tools", "");
    package("far", "");
    for file in ["all/model/build.rs", "all/model/build_fmu.rs", "all/near/build.rs"] {
        fs::write(directory.join(file), "").unwrap();
    }
}

fn fingerprint(directory: &Path) -> String {
    Sources::of_package(directory.join("all/model")).fingerprint().unwrap()
}

#[test]
fn any_compiled_file_changes_the_guid() {
    let directory = tempfile::tempdir().unwrap();
    project(directory.path());
    for (file, counts) in [
        ("all/model/src/lib.rs", true),
        ("all/model/src/table.csv", true),
        ("all/model/Cargo.toml", true),
        ("all/Cargo.toml", true),
        ("all/Cargo.lock", true),
        ("all/near/src/lib.rs", true),
        ("all/near/src/deep/table.csv", true),
        ("all/near/build.rs", true),
        ("all/near/Cargo.toml", true),
        ("far/src/lib.rs", true),
        ("far/Cargo.toml", true),
        ("all/near/src/.lib.rs.swp", false),
        ("all/near/README.md", false),
        ("all/tools/src/lib.rs", false),
    ] {
        let path = directory.path().join(file);
        let before = fingerprint(directory.path());
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, fs::read_to_string(&path).unwrap_or_default() + "\n# more\n").unwrap();
        assert_eq!(fingerprint(directory.path()) != before, counts, "{file}");
    }
}

#[test]
fn the_guid_does_not_depend_on_the_location() {
    let (one, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    project(one.path());
    project(&other.path().join("deep"));
    assert_eq!(fingerprint(one.path()), fingerprint(&other.path().join("deep")));
}

#[test]
fn a_missing_package_is_named() {
    let directory = tempfile::tempdir().unwrap();
    project(directory.path());
    fs::remove_dir_all(directory.path().join("far")).unwrap();
    let error = Sources::of_package(directory.path().join("all/model")).fingerprint().unwrap_err();
    let text = format!("{error:#}");
    assert!(text.contains("far") && text.lines().count() == 1, "{text}");
}
