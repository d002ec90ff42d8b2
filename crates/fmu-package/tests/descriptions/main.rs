//! The descriptions of test models, compared with the files in `expected`, and the errors for malformed models.
//!
//! If the environment variable `UPDATE_EXPECTED` is set, the tests write these files.
#![allow(missing_docs, unsafe_code)]

mod malformed;
mod models;
mod terminals;

use fmi_abi::Category;
use fmi_abi::description::ModelDescription;
use fmu_export::Exported;
use fmu_package::{Changes, LoadedModel, Standard, describe};
use fmu_test_kit::models::Palette;
use models::breakpoints::{BREAKPOINTS, Breakpoints, LENGTH};
use models::{branches::Branches, chain::Chain, factors::Factors, room::Room};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::{env, fs};

const BOTH: [Standard; 2] = [Standard::Fmi2, Standard::Fmi3];

fn model<M: Exported>() -> LoadedModel {
    changed::<M>("")
}

/// Returns the model with changes in its description, written as `PATH=JSON; PATH=JSON`. A path selects an item of a list by its index
/// or by its name.
fn changed<M: Exported>(changes: &str) -> LoadedModel {
    let mut description: Value = serde_json::from_str(&fmu_export::describe::<M>()).unwrap();
    for (path, value) in changes.split("; ").filter_map(|change| change.split_once('=')) {
        let mut at = &mut description;
        for key in path.split('/') {
            at = match at {
                Value::Array(items) => {
                    let named = items.iter().position(|item| item["name"] == key);
                    &mut items[named.unwrap_or_else(|| key.parse().unwrap())]
                }
                other => &mut other[key],
            };
        }
        *at = serde_json::from_str(value).unwrap();
    }
    let (fmi2, fmi3) = (fmu_export::fmi2::functions::<M>(), fmu_export::fmi3::functions::<M>());
    // SAFETY: the functions belong to the model, whose variables keep their number and types.
    unsafe { LoadedModel::new(&description.to_string(), fmi2, fmi3) }.unwrap()
}

fn described(model: &LoadedModel, fmi: Standard) -> String {
    describe(model, fmi, &Changes::default()).unwrap()
}

/// The files in `expected`.
const EXPECTED: [&str; 10] = [
    "chain-2.xml",
    "chain-3.xml",
    "factors-2.xml",
    "factors-3.xml",
    "malformed.txt",
    "palette-3.xml",
    "room-2.xml",
    "room-3.xml",
    "structures.xml",
    "terminals.xml",
];

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/descriptions/expected")
}

fn read_expected(file: &str) -> String {
    fs::read_to_string(directory().join(file)).unwrap_or_default()
}

/// Compares a document with its file.
#[track_caller]
fn is_expected(file: &str, text: &str) {
    assert!(EXPECTED.contains(&file));
    // The version and the texts of fmi-abi are replaced, so that the files stay the same when these change.
    let mut text = text.replace(concat!("fmu-package ", env!("CARGO_PKG_VERSION")), "fmu-package");
    for category in Category::ALL {
        text = text.replace(category.description(), &category.name().to_string_lossy());
    }
    if env::var_os("UPDATE_EXPECTED").is_some() {
        fs::write(directory().join(file), &text).unwrap();
    }
    let expected = read_expected(file);
    let different = text.lines().zip(expected.lines()).find(|(line, expected)| line != expected);
    assert!(text == expected, "{file} is out of date (UPDATE_EXPECTED=1 writes it): {different:?}");
}

#[test]
fn every_expected_file_is_compared() {
    let mut files: Vec<_> = fs::read_dir(directory())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, EXPECTED);
}

/// Compares the descriptions for both FMI versions. Also reads the one for FMI 2.0 as an importer does.
fn is_expected_in_both<M: Exported>(name: &str) {
    let model = model::<M>();
    for fmi in BOTH {
        let text = described(&model, fmi);
        is_expected(&format!("{name}-{}.xml", if fmi == Standard::Fmi2 { 2 } else { 3 }), &text);
    }
    let read = ModelDescription::parse(&described(&model, Standard::Fmi2)).unwrap();
    let names: Vec<_> = read.variables.iter().map(|variable| variable.name.as_str()).collect();
    assert_eq!(names, M::TABLE.iter().map(|variable| variable.name()).collect::<Vec<_>>());
}

#[test]
fn everything_that_both_versions_have() {
    is_expected_in_both::<Room>("room");
}

#[test]
fn arrays() {
    is_expected_in_both::<Chain>("chain");
}

#[test]
fn kinds_of_factors() {
    is_expected_in_both::<Factors>("factors");
}

#[test]
fn types_that_fmi_2_lacks() {
    let model = model::<Palette>();
    is_expected("palette-3.xml", &described(&model, Standard::Fmi3));
    let error = describe(&model, Standard::Fmi2, &Changes::default()).unwrap_err().to_string();
    assert_eq!(error, "float32 is Float32, which FMI 2.0 lacks; add --fmi 3 to make an FMU for FMI 3.0 only");
}

/// Compares only the model structure, because these models differ from others in little else.
#[test]
fn structures() {
    let mut text = "<structures>\n".to_owned();
    let mut add = |name: &str, model: &LoadedModel| {
        for fmi in BOTH {
            let described = described(model, fmi);
            let structure = &described[described.find("  <ModelStructure").unwrap()..];
            text +=
                &format!("  <!-- {name}, {fmi} -->\n{}", structure.replace("</fmiModelDescription>\n", ""));
        }
    };
    add("Factors without derivatives: found from values", &changed::<Factors>("partials=false"));
    add("Factors, not smooth: nothing is ruled out", &changed::<Factors>("smooth=false"));
    let steps = changed::<Factors>("partials=false; modelExchange=null");
    add("Factors of Co-Simulation: nothing about states (section 2.2.8)", &steps);
    add("Branches: nothing is ruled out but by declarations", &model::<Branches>());
    let even = std::array::from_fn(|i| i as f64);
    for (name, change, start, equal) in [
        ("Breakpoints, not smooth", "smooth=false", even.map(|i: f64| i + 1.0), false),
        ("Breakpoints from 0", "", even.map(|i| 0.1 * i), false),
        ("Breakpoints of both signs", "", even.map(|i| 0.01 * (i - 10.0).powi(3)), false),
        ("Breakpoints close to each other", "", even.map(|i| 500.0 + 0.05 * i + 0.005 * i * i), false),
        ("Breakpoints, evenly spaced: each may act", "smooth=false", even, true),
    ] {
        BREAKPOINTS.set((start, equal));
        add(name, &changed::<Breakpoints>(change));
    }
    is_expected("structures.xml", &(text + "</structures>\n"));
}

/// Only a smooth model must accept a change of each variable.
#[test]
fn variables_that_cannot_change_separately() {
    BREAKPOINTS.set((std::array::from_fn::<_, LENGTH, _>(|i| i as f64), true));
    for fmi in BOTH {
        let error = describe(&model::<Breakpoints>(), fmi, &Changes::default()).unwrap_err().to_string();
        assert_eq!(
            error,
            "x[1] cannot be tried separately: the model rejects every other value that is near, from 50 % of it down to \
             0.0008 %: the breakpoints do not fit; let `update` accept some, or leave `smooth` out of INFO and name what \
             follows from x[1] with `depends_on`"
        );
    }
}

/// Values and factors that are calculated from tunable parameters are tunable.
#[test]
fn changes() {
    let changes = Changes { tunable_parameters: true, source_files: Vec::new() };
    for fmi in BOTH {
        let text = described(&model::<Factors>(), fmi);
        let expected = text
            .replace("variability=\"fixed\"", "variability=\"tunable\"")
            .replace("\"constant fixed", "\"constant tunable");
        assert_eq!(describe(&model::<Factors>(), fmi, &changes).unwrap(), expected);

        let text = describe(&model::<Room>(), fmi, &changes).unwrap();
        assert!(text.contains(r#"causality="calculatedParameter" variability="tunable""#), "{text}");
        assert_eq!(text.matches(r#"variability="fixed""#).count(), 1, "{text}");
    }
    let source_files = vec!["a.c".to_owned(), "b.c".to_owned()];
    let text = describe(&model::<Factors>(), Standard::Fmi2, &Changes { source_files, ..changes }).unwrap();
    let list =
        "      <File name=\"a.c\"/>\n      <File name=\"b.c\"/>\n    </SourceFiles>\n  </CoSimulation>";
    assert!(text.contains(list), "{text}");
}
