//! Malformed models are rejected with a message that names the fault. The compiler rejects others already: see the tests of
//! fmu-export.

use crate::models::faulty::{FAULT, Faulty};
use crate::models::room::{Name, Room};
use crate::models::{chain::Chain, factors::Factors, types::Types};
use crate::{BOTH, changed};
use fmu_export::Exported;
use fmu_package::{Changes, Standard, describe};

/// Checks the messages on a model with changes; the message is empty if the model is accepted.
#[track_caller]
fn results<M: Exported>(versions: &[Standard], changes: &[(&str, &str)]) {
    for (change, message) in changes {
        for fmi in versions {
            let error = describe(&changed::<M>(change), *fmi, &Changes::default()).err();
            let text = error.map(|error| format!("{error:#}")).unwrap_or_default();
            assert_eq!(text, *message, "{change}, {fmi}");
        }
    }
}

#[test]
fn start_values() {
    let start = |interface: usize, name: Name, value: &str| {
        format!("starts/{interface}/values/{}={value:?}", name as usize)
    };
    let not_a_number = format!("{}; {}", start(0, Name::outside, "NaN"), start(1, Name::outside, "NaN"));
    results::<Room>(
        &BOTH,
        &[
            (r#"variables/outside/type/max="5""#, "the start value of outside must be <= 5, it is 10"),
            (r#"variables/outside/type/min="12.5""#, "the start value of outside must be >= 12.5, it is 10"),
            (&not_a_number, "the start value of outside must be a finite number, it is NaN"),
            (r#"variables/strange/type/max="0.25""#, "the start value of strange must be <= 0.25, it is 0.5"),
            (
                r#"variables/share/type/largest="40""#,
                "the start value of share must be between -2147483648 and 40, it is 50",
            ),
            (
                "variables/heater/type/items/Low/value=3",
                "the start value of heater must be one of 0 (Off), 3 (Low), 5 (High), it is 2",
            ),
            (
                &start(1, Name::setpoint, "22"),
                "setpoint starts with 21 in Co-Simulation and with 22 in Model Exchange",
            ),
            // A calculated output has no start value, so none has to be in its range.
            (r#"variables/wave/type/min="3"; variables/wave/type/name="""#, ""),
        ],
    );
    // In single precision, 0.1 is larger than in double precision, but in the range up to 0.1.
    results::<Types>(
        &[Standard::Fmi3],
        &[
            (
                r#"variables/single/type/max="0.05""#,
                "the start value of single must be <= 0.05, it is 0.10000000149011612",
            ),
            (
                r#"variables/byte/type/largest="2""#,
                "the start value of byte must be between 0 and 2, it is 3",
            ),
        ],
    );
}

#[test]
fn types_and_units() {
    let changes = [
        (
            r#"outside/type/min="30"; variables/outside/type/max="20""#,
            "its range is empty: min 30 is above max 20",
        ),
        (r#"outside/type/max="NaN""#, "max must be a finite number"),
        (r#"outside/type/nominal="0""#, "the nominal value must be > 0, it is 0"),
        (r#"outside/type/quantity="a\nb""#, "its quantity 'a\\nb' is more than one line"),
        (
            r#"outside/type/unit/display/factor="0""#,
            "the factor of the display unit degF must be finite and not 0, it is 0",
        ),
        (r#"outside/type/unit/factor="0""#, "the factor of the unit degC must be finite and not 0, it is 0"),
        (r#"outside/type/unit/offset="inf""#, "the offset of the unit degC must be finite, it is inf"),
        (r#"outside/type/unit/name="""#, "the name '' of its unit is empty or more than one line"),
        (r#"share/type/smallest="101""#, "its range is empty: min 101 is above max 100"),
        ("heater/type/items=[]", "it has no items"),
        (r#"heater/type/items/Low/name="""#, "the item '' is empty or more than one line"),
        (
            r#"heater/type/items/Low/description="a\nb""#,
            "the description of its item Low is more than one line",
        ),
        (r#"heater/type/items/Low/name="Off""#, "it has two items with the name Off"),
        ("heater/type/items/Low/value=0", "it has two items with the value 0"),
    ];
    for (change, message) in changes {
        let (variable, _) = change.split_once('/').unwrap();
        let of = match variable {
            "outside" => "ThermodynamicTemperature",
            "share" => "Share",
            _ => "Heater",
        };
        let message = format!("{variable} cannot have the type {of}: {message}");
        results::<Room>(&BOTH, &[(&format!("variables/{change}"), &message)]);
    }
    results::<Room>(
        &BOTH,
        &[
            (
                r#"variables/outside/type/name="Two\nLines""#,
                "outside cannot have the type Two\\nLines: its name is more than one line",
            ),
            (
                r#"variables/heater/type/name="""#,
                "heater cannot have its type: an Enumeration needs a name (section 2.2.7)",
            ),
            (
                r#"variables/outside/type/nominal="30""#,
                "there are two different types with the name ThermodynamicTemperature",
            ),
            (r#"variables/outside/type/unit/factor="2""#, "there are two different units with the name degC"),
            (
                r#"variables/share/type/name="power""#,
                "power is a variable and a type; rename one of them (section 2.2.3)",
            ),
        ],
    );
    results::<Types>(
        &[Standard::Fmi3],
        &[
            (
                r#"variables/image/type/mimeType="""#,
                "image cannot have the type Image: its MIME type '' is empty or more than one line",
            ),
            (
                "variables/image/type/maxSize=1",
                "the start value of image must have at most 1 bytes, it has 2",
            ),
        ],
    );
}

#[test]
fn facts() {
    for identifier in ["", "7up", "my model", "a/b", "naïve"] {
        let message = format!(
            "the identifier '{identifier}' must be one of C: letters, digits and underscores, no digit first"
        );
        results::<Room>(&BOTH, &[(&format!("identifier={identifier:?}"), &message)]);
    }
    results::<Room>(
        &BOTH,
        &[
            (r#"name="""#, "the model's name '' is empty or more than one line"),
            (r#"guid="""#, "Room has no guid"),
            (r#"author="A\nB""#, "the author of Room is more than one line"),
            (r#"stepSize="0""#, "the step size of the default experiment must be > 0, it is 0"),
            (r#"tolerance="-1""#, "the tolerance of the default experiment must be > 0, it is -1"),
            (r#"stopTime="inf""#, "the stop time of the default experiment must be finite, it is inf"),
            (r#"startTime="2""#, "the default experiment ends at 1, before its start at 2"),
            ("coSimulation=null; modelExchange=null", "Room offers neither Co-Simulation nor Model Exchange"),
        ],
    );
}

#[test]
fn names() {
    results::<Room>(
        &BOTH,
        &[
            (r#"variables/outside/name="""#, "the variable name '' is empty or more than one line"),
            (r#"variables/outside/name="a\nb""#, "the variable name 'a\\nb' is empty or more than one line"),
            (r#"variables/outside/description="a\nb""#, "the description of outside is more than one line"),
        ],
    );
    results::<Chain>(
        &BOTH,
        &[
            (
                r#"variables/0/name="two words""#,
                "the variable name 'two words' is no name of the structured naming convention, which a model with arrays \
                 needs: write names as in Modelica, such as motor.torque, der(x), or 'any text' (section 2.2.9 of FMI 2.0)",
            ),
            (r#"variables/0/name="motor.'a \\' b'.values[2]""#, ""),
            (r#"variables/0/name="axes[2,1].x""#, ""),
            (r#"variables/0/name="der(axes[2,1].x, 2)""#, ""),
        ],
    );
    // FMI 2.0 needs neither.
    for (change, name) in [("0/name", "time"), ("byte/array", "eventIndicator[1]")] {
        let change = format!("variables/{change}={name:?}; variables/0/array={name:?}");
        let message = format!(
            "{name} is the name of a variable that FMI 3.0 needs; declare the time as independent, rename any other variable \
             of this name"
        );
        results::<Types>(&[Standard::Fmi3], &[(&change, &message)]);
    }
    results::<Factors>(&[Standard::Fmi2], &[(r#"variables/u/name="time""#, "")]);
}

#[test]
fn references() {
    let reference = |of: &str, name: Name| format!("variables/{of}/differentiates={}", name as usize);
    let dependencies =
        |names: [Name; 2]| format!("variables/wave/dependencies={:?}", names.map(|name| name as usize));
    results::<Room>(
        &BOTH,
        &[
            (
                r#"variables/outside/causality="independent""#,
                "there are two independent variables (section 2.2.7)",
            ),
            (
                &reference("wave", Name::temperature),
                "the state temperature has 2 derivatives among the variables",
            ),
            (&reference("wave", Name::wave), "wave cannot be the derivative of wave"),
            (&reference("wave", Name::alarms), "wave cannot be the derivative of alarms"),
            (
                &dependencies([Name::time, Name::rate]),
                "wave depends on der(temperature), which is calculated or constant; name the inputs, states and parameters \
                 that it follows from",
            ),
            (&dependencies([Name::time; 2]), "wave names time twice among what it depends on"),
        ],
    );
    let undeclared = "y reacts to u, which its depends_on does not name";
    results::<Factors>(
        &BOTH,
        &[
            ("variables/y/dependencies=[2]", undeclared),
            ("variables/y/dependencies=[2]; smooth=false", undeclared),
        ],
    );
}

#[test]
fn models_that_cannot_be_made() {
    for (fault, message) in [
        ("broken", "the model cannot be made for Co-Simulation: it is broken"),
        ("panic", "the model cannot be made for Co-Simulation: it is mad"),
        ("two-faced", "u starts with 1 in Co-Simulation and with 0 in Model Exchange"),
        ("unwritable", "the start value of label has a character that XML lacks: \"a\\u{1}\""),
        ("rejects itself", "these start values make no model: no is no"),
        (
            "unreadable",
            "y cannot be read from a new model: the code behind its `in` or `by` panics, for example because of an index out \
             of bounds",
        ),
        ("indicator", "Faulty: indicators() does not fill in indicator 1"),
        ("", ""),
    ] {
        FAULT.set(fault);
        results::<Faulty>(&BOTH, &[("", message)]);
    }
}

#[test]
fn derivatives_that_differ_from_the_values() {
    for (fault, beginning, function) in [
        ("partial", "y with respect to u is ", "by Partials::partial,"),
        ("no number", "y with respect to u is NaN", "by Partials::partial,"),
        (
            "initial_partial",
            "y with respect to u in Initialization Mode is ",
            "by Partials::initial_partial,",
        ),
        ("partial_by_time", "y with respect to time is ", "by Partials::partial_by_time,"),
    ] {
        FAULT.set(fault);
        for (fmi, interface) in BOTH.into_iter().flat_map(|fmi| [(fmi, ""), (fmi, "modelExchange=null")]) {
            let error = describe(&changed::<Faulty>(interface), fmi, &Changes::default()).err();
            let text = error.map(|error| error.to_string()).unwrap_or_default();
            // Time is no variable of the model, so FMI 2.0 has no derivatives with respect to it.
            let is_accepted = fault == "partial_by_time" && fmi == Standard::Fmi2;
            let is_named =
                text.starts_with(&format!("the derivative of {beginning}")) && text.contains(function);
            assert!(if is_accepted { text.is_empty() } else { is_named }, "{fault}, {fmi}: {text}");
        }
    }
}
