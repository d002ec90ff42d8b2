//! Malformed models are rejected with a message that names the fault. Models that the compiler already rejects are in the tests of
//! fmu-export.

use crate::models::faulty::{FAULT, Faulty};
use crate::models::{chain::Chain, factors::Factors, room::Room};
use crate::{BOTH, changed, is_expected, read_expected};
use fmu_export::Exported;
use fmu_package::{Changes, Standard, describe};
use fmu_test_kit::models::Palette;

/// Returns the error message for a changed model; empty if the model is accepted.
fn message<M: Exported>(changes: &str, fmi: Standard) -> String {
    let error = describe(&changed::<M>(changes), fmi, &Changes::default()).err();
    error.map(|error| format!("{error:#}")).unwrap_or_default()
}

/// Returns the error message for a changed model, which must be the same in both FMI versions.
fn message_in_both<M: Exported>(changes: &str) -> String {
    let [one, other] = BOTH.map(|fmi| message::<M>(changes, fmi));
    assert_eq!(one, other, "{changes}");
    one
}

#[test]
fn changed_descriptions() {
    let mut model = "";
    let mut text = String::new();
    let cases = read_expected("malformed.txt");
    for line in cases.lines().filter(|line| !line.starts_with("    ")) {
        text += &format!("{line}\n");
        if let Some(name) = line.strip_prefix("== ") {
            model = name;
        } else if line.contains('=') && !line.starts_with('#') {
            let message = match model {
                "Room" => message_in_both::<Room>(line),
                "Chain" => message_in_both::<Chain>(line),
                "Factors" => message_in_both::<Factors>(line),
                _ => message::<Palette>(line, Standard::Fmi3),
            };
            text += &if message.is_empty() { message } else { format!("    {message}\n") };
        }
    }
    is_expected("malformed.txt", &text);
    // Only FMI 3.0 needs variables of these names.
    assert_eq!(message::<Factors>("variables/u/name=\"time\"", Standard::Fmi2), "");
    let named = "variables/open/array=\"eventIndicator[1]\"";
    assert_eq!(message::<Room>(named, Standard::Fmi2), "");
    assert_eq!(
        message::<Room>(named, Standard::Fmi3),
        "eventIndicator[1] is the name of a variable that FMI 3.0 needs; declare it as independent if it is the time, else \
         rename it"
    );
}

#[test]
fn models_that_cannot_be_made() {
    for (fault, message) in [
        ("broken", "the model cannot be instantiated for Co-Simulation: it is broken"),
        ("panic", "the model cannot be instantiated for Co-Simulation: it panics"),
        ("two-faced", "u starts with 1 in Co-Simulation and with 0 in Model Exchange"),
        (
            "unwritable",
            "the start value of label has a control character that must not be in XML: \"a\\u{1}\"",
        ),
        ("rejects itself", "the model rejects its start values: no is no"),
        (
            "unreadable",
            "y cannot be read from a new model: the code behind its `in` or `by` panics, for example because of an index out \
             of bounds",
        ),
        ("indicator", "Faulty: indicators() does not fill in indicator 1"),
        ("", ""),
    ] {
        FAULT.set(fault);
        assert_eq!(message_in_both::<Faulty>(""), message);
    }
}
