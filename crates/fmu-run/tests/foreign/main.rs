//! FMUs that behave like FMUs of other producers. `integrator.c` of the test kit describes each manner and, for most of them, names tools
//! in which it was observed.
#![allow(unsafe_code, reason = "FMUs are opened")]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod built;
mod endings;
mod opening;
mod requests;
mod ssp;

use built::{built, opened, opened_with};
use fmu_run::{
    Batch, Composition, Error, Fmu, Order, Setup, Standard, Start, Status, System, Tolerance, Trajectory,
    Value, Watch,
};

const VERSIONS: [Standard; 2] = [Standard::Fmi2, Standard::Fmi3];

fn times() -> Vec<f64> {
    (0..11).map(|k| f64::from(k) / 10.0).collect()
}

/// Runs an FMU with u = 1 for 1 s. Returns y at the end, or the error.
fn end(fmu: &System) -> Result<f64, String> {
    let time = times();
    let batch = Batch {
        time: &time,
        inputs: vec![("u", Trajectory::Constant(1.0))],
        outputs: vec!["y"],
        every: Some(1),
        ..Batch::default()
    };
    let runs = fmu.run(&batch, &Watch::default()).map_err(|error| error.to_string())?;
    match runs.errors.first() {
        Some((_, why)) => Err(why.clone()),
        None => Ok(runs.trajectories[10]),
    }
}

#[test]
fn foreign_manners_do_not_change_results() {
    let same = [
        "plain",
        "memory",
        "unchecked_memory",
        "null_environment",
        "freed_environment",
        "thread",
        "other_thread",
        "free",
        "format",
        "percent",
        "chatty",
        "null_texts",
        "stop_time",
        "pending",
        "warning",
        "once",
        "directory",
        "locale",
        "output",
        "libm",
        "exceptions",
        "no_reset",
    ];
    for standard in VERSIONS {
        for manner in same {
            let result = end(&opened(manner, standard));
            assert!(
                result.as_ref().is_ok_and(|y| (y - 1.0).abs() < 1e-12),
                "{manner}, {standard}: {result:?}"
            );
        }
    }
}

#[test]
fn errors_have_the_messages_of_fmus_with_another_environment() {
    for (standard, function) in VERSIONS.into_iter().zip(["fmi2DoStep", "fmi3DoStep"]) {
        let expected = format!("at 0.5 s: {function}: the stranger gives up");
        assert_eq!(end(&opened("other_environment", standard)), Err(expected));
        // With several instances, a message is attributed to an instance by the thread that logs it.
        let fmu = opened("other_environment", standard);
        let mut others = fmu.instances(&Setup { count: 3, ..Setup::default() }).unwrap();
        others.step(0.6, None).unwrap();
        others.step(0.1, None).unwrap();
        let errors: Vec<_> = others.errors().map(|(index, why)| (index, why.to_owned())).collect();
        assert_eq!(errors.len(), 3);
        assert!(errors.iter().all(|(_, why)| why.ends_with("the stranger gives up")), "{errors:?}");
    }
}

#[test]
fn the_tolerance_of_the_default_experiment_is_passed() {
    for standard in VERSIONS {
        let fmu = opened("tolerance", standard);
        for (tolerance, expected, passed) in [
            (Tolerance::Default, 1.0 + 1e-5, 1e-5),
            (Tolerance::Value(1e-3), 1.001, 1e-3),
            (Tolerance::None, 1.01, -1.0),
        ] {
            let time = times();
            let batch = Batch {
                time: &time,
                inputs: vec![("u", Trajectory::Constant(1.0))],
                outputs: vec!["y", "tolerance", "stop"],
                every: Some(10),
                tolerance,
                ..Batch::default()
            };
            let runs = fmu.run(&batch, &Watch::default()).unwrap();
            assert!((runs.trajectories[1] - expected).abs() < 1e-12, "{standard} {tolerance:?}");
            assert_eq!(runs.trajectories[2..], [passed, passed, 1.0, 1.0]);
            let setup = Setup { tolerance, stop_time: Some(3.0), ..Setup::default() };
            let mut one = fmu.instances(&setup).unwrap();
            let mut values = [0.0; 2];
            one.get(&fmu.select(&["tolerance", "stop"]).unwrap(), &mut values);
            assert_eq!(values, [passed, 3.0]);
        }
        for wrong in [0.0, -1e-3, f64::INFINITY] {
            let setup = Setup { tolerance: Tolerance::Value(wrong), ..Setup::default() };
            assert!(matches!(fmu.instances(&setup), Err(Error::Request(why)) if why.contains("above 0")));
        }
    }
}

#[test]
fn messages_reach_a_listener() {
    let of = |manner, standard| {
        let fmu = opened(manner, standard);
        let setup =
            Setup { listening: true, count: if manner == "once" { 1 } else { 2 }, ..Setup::default() };
        let mut instances = fmu.instances(&setup).unwrap();
        instances.step(0.1, None).unwrap();
        let messages = instances.take_messages();
        assert!(instances.take_messages().is_empty() || manner.contains("thread"));
        messages.into_iter().map(|of| (of.index, of.message.status, of.message.text)).collect::<Vec<_>>()
    };
    for standard in VERSIONS {
        let step = "a step".to_owned();
        assert_eq!(
            of("chatty", standard),
            [(Some(0), Status::Ok, step.clone()), (Some(1), Status::Ok, step)]
        );
        let percent = of("percent", standard);
        assert_eq!(percent[0], (Some(0), Status::Warning, "100% of %20s is %n, 50%".to_owned()));
        assert_eq!(of("null_texts", standard)[0], (Some(0), Status::Warning, String::new()));
        let strange = of("null_environment", standard);
        let greeting = (None, Status::Warning, "my environment is not yours".to_owned());
        assert_eq!(strange.last(), Some(&greeting), "{strange:?}");
    }
    let expanded = "tank has 7 of 8, 0.500 and 1.0e-09, ab  |%|z";
    assert_eq!(of("format", Standard::Fmi2)[0].2, expanded);
    assert_eq!(of("references", Standard::Fmi2)[0].2, "u and counter of #4, #b1#, #r77# and #1");
    assert!(of("references", Standard::Fmi3)[0].2.starts_with("#r%d#"));
}

#[test]
fn runs_pass_messages_with_their_time() {
    for standard in VERSIONS {
        let (fmu, watch, time) = (opened("chatty", standard), Watch::listening(), times());
        let gains = [0.0, 1.0, 2.0];
        let batch = Batch {
            time: &time,
            start: vec![("gain", Start::Each(&gains))],
            outputs: vec!["y"],
            threads: Some(2),
            ..Batch::default()
        };
        fmu.run(&batch, &watch).unwrap();
        let messages = watch.take_messages();
        for run in 0..3 {
            let of_run: Vec<_> = messages.iter().filter(|of| of.index == Some(run)).collect();
            let at: Vec<_> = of_run.iter().filter_map(|of| of.time).collect();
            assert_eq!(at, time[..10], "{standard}, run {run}");
        }
        assert_eq!(messages.len(), 30);
        assert!(watch.take_messages().is_empty());
    }
}

#[test]
fn discard_and_missing_stop_time_are_errors_with_their_messages() {
    for standard in VERSIONS {
        let discarded = end(&opened("discard", standard)).unwrap_err();
        assert!(
            discarded.starts_with("at 0.5 s: ") && discarded.ends_with("the step is too large"),
            "{discarded}"
        );
        let missing = opened("stop_time", standard).instances(&Setup::default()).unwrap_err().to_string();
        assert!(missing.ends_with("the stop time is missing"), "{missing}");
    }
}

#[test]
fn a_state_does_not_outlive_its_instance() {
    for (standard, manner) in
        [(Standard::Fmi2, "no_reset"), (Standard::Fmi3, "no_reset"), (Standard::Fmi2, "plain")]
    {
        let fmu = opened(manner, standard);
        let (u, y) = (fmu.select(&["u"]).unwrap(), fmu.select(&["y"]).unwrap());
        let mut one = fmu.instances(&Setup::default()).unwrap();
        let mut save_at = |u_value: f64| {
            one.set(&u, &[u_value], None).unwrap();
            one.step(1.0, None).unwrap();
            let saved = one.save().unwrap();
            one.reset(None);
            saved
        };
        let [first, second] = [1.0, 5.0].map(&mut save_at);
        let mut value = [0.0];
        for (states, expected) in [(first, 1.0), (second, 5.0)] {
            let (restored, serialized) = (one.restore(&states, None), one.serialize(&states));
            one.get(&y, &mut value);
            if manner == "plain" {
                restored.unwrap();
                serialized.unwrap();
                assert_eq!(value[0], expected);
            } else {
                let why = restored.unwrap_err().to_string();
                assert!(why.contains("before a reset that made a new instance"), "{why}");
                assert_eq!(serialized.unwrap_err().to_string(), why);
                assert_eq!(value[0], 0.0, "a rejected restore must not change the instance");
            }
            one.forget(states);
        }
        assert_eq!(one.errors().count(), 0);
    }
}

/// If one component cannot free a state, the others free it all the same, so that a state is the same instant of all components.
#[test]
fn a_state_of_a_system_is_one_instant() {
    for standard in VERSIONS {
        let [one, other] = ["free_state_fails", "plain"].map(|manner| opened_with(manner, standard, &[]));
        for components in [[("a", &one), ("b", &other)], [("b", &other), ("a", &one)]] {
            let composition = Composition { components: components.to_vec(), ..Composition::default() };
            let system = System::connect(&composition).unwrap();
            let mut both = system.instances(&Setup::default()).unwrap();
            both.set(&system.select(&["a.u", "b.u"]).unwrap(), &[1.0, 1.0], None).unwrap();
            let first = both.save().unwrap();
            both.forget(first);
            let mut save_after_a_second = || {
                both.step(1.0, None).unwrap();
                both.save().unwrap()
            };
            let states = [1.0, 2.0, 3.0].map(|y| (y, save_after_a_second()));
            for (y, state) in &states {
                both.restore(state, None).unwrap();
                let mut found = [0.0; 2];
                both.get(&system.select(&["a.y", "b.y"]).unwrap(), &mut found);
                assert_eq!((found, both.errors().count()), ([*y; 2], 0), "{standard}");
            }
        }
    }
}

/// A variable of FMI 3.0 may have several names (`Alias`), which are as good as the first one.
#[test]
fn aliases_are_names_of_variables() {
    let unit = "<UnitDefinitions><Unit name=\"m\"><BaseUnit m=\"1\"/><DisplayUnit name=\"mm\" factor=\"1000\"/></Unit></UnitDefinitions>\
        <DefaultExperiment";
    let changes = [
        ("<DefaultExperiment", unit),
        (
            "causality=\"input\" start=\"0\"/>\n    <Float64 name=\"y\" valueReference=\"2\" causality=\"output\"/>",
            "causality=\"input\" start=\"0\" unit=\"m\"><Alias name=\"force\" displayUnit=\"mm\"/></Float64>\
          <Float64 name=\"y\" valueReference=\"2\" causality=\"output\"><Alias name=\"way\"/></Float64>",
        ),
        ("<Dimension valueReference=\"13\"/>", "<Dimension valueReference=\"13\"/><Alias name=\"row\"/>"),
    ];
    let fmu = opened_with("plain", Standard::Fmi3, &changes);
    let batch = Batch {
        time: &times(),
        inputs: vec![("force", Trajectory::Constant(2.0))],
        start: vec![("row[2]", Start::Same(7.0))],
        outputs: vec!["way", "y", "sum"],
        every: Some(10),
        ..Batch::default()
    };
    let runs = fmu.system().run(&batch, &Watch::default()).unwrap();
    // y is 2 s after 1 s; the sum of 1, 7 and 3 does not change.
    let ends: Vec<f64> =
        runs.trajectories.iter().skip(1).step_by(2).map(|value| (value * 1e9).round()).collect();
    assert_eq!(ends, [2e9, 2e9, 11e9]);
    assert_eq!(fmu.system().display_unit("force", "mm").unwrap(), (1000.0, 0.0));
    assert_eq!(fmu.system().array("row").map(|row| row.sizes.clone()), Some(vec![3]));
    let connections = vec![("a.way", "b.force"), ("b.way", "b.u")];
    let composition =
        Composition { components: vec![("a", &fmu), ("b", &fmu)], connections, ..Composition::default() };
    let why = System::connect(&composition).unwrap_err().to_string();
    assert_eq!(why, "b.u is fed twice", "u and force are one input");
}

#[test]
fn absurd_sizes_of_states_are_errors() {
    for standard in VERSIONS {
        for manner in ["huge_state", "endless_state"] {
            let fmu = opened(manner, standard);
            let mut one = fmu.instances(&Setup::default()).unwrap();
            let states = one.save().unwrap();
            assert_eq!(one.serialize(&states).unwrap(), [None]);
            let why = one.none_left().unwrap().to_owned();
            assert!(why.contains("for which there is not enough memory"), "{why}");
        }
        let fmu = opened("growing_state", standard);
        let mut one = fmu.instances(&Setup::default()).unwrap();
        let states = one.save().unwrap();
        let bytes = one.serialize(&states).unwrap();
        assert!(one.deserialize(&bytes).is_ok());
    }
}

#[test]
fn an_absurd_size_of_a_value_is_an_error() {
    let mut one = opened("huge_bytes", Standard::Fmi3).instances(&Setup::default()).unwrap();
    assert_eq!(one.values("bytes_out").unwrap(), [None]);
    assert!(one.none_left().is_some_and(|why| why.contains("for which there is not enough memory")));
}

#[test]
fn resources_are_found_under_any_path() {
    for standard in VERSIONS {
        let directory = tempfile::Builder::new().prefix("a b%20 \u{e4}#").tempdir().unwrap();
        let path = built("resources", standard, directory.path(), &[]);
        // SAFETY: the FMU of this test.
        let fmu = unsafe { Fmu::open(&path) }.unwrap().system().clone();
        assert_eq!(end(&fmu), Ok(3.5), "{standard}");
    }
}

#[test]
fn missing_resources_have_no_location() {
    assert_eq!(end(&opened("null_resources", Standard::Fmi3)), Ok(1.0));
}

/// A difference of temperatures has no offset (section 2.2.3 of FMI 2.0, 2.4.4 of FMI 3.0).
#[test]
fn units_of_differences_have_no_offset() {
    let unit = "<UnitDefinitions><Unit name=\"K\"><BaseUnit K=\"1\"/><DisplayUnit name=\"degC\" offset=\"-273.15\"/></Unit></UnitDefinitions>";
    let of = |standard, own: &str, shared: &str| {
        let (variable, kind, start) = match standard {
            Standard::Fmi2 => ("<Real start=\"0\"/>", "Real", "<Real declaredType=\"T\" start=\"0\""),
            Standard::Fmi3 => ("name=\"u\"", "Float64Type", "declaredType=\"T\" name=\"u\""),
        };
        let attributes = format!("unit=\"K\" displayUnit=\"degC\" {shared}");
        let types = match standard {
            Standard::Fmi2 => format!("<SimpleType name=\"T\"><{kind} {attributes}/></SimpleType>"),
            Standard::Fmi3 => format!("<{kind} name=\"T\" {attributes}/>"),
        };
        let close = if standard == Standard::Fmi2 { "/>" } else { "" };
        let list = format!("{unit}<TypeDefinitions>{types}</TypeDefinitions><DefaultExperiment");
        let changes = [("<DefaultExperiment", &*list), (variable, &format!("{start} {own}{close}"))];
        opened_with("plain", standard, &changes).system().display_unit("u", "degC").unwrap()
    };
    for standard in VERSIONS {
        let relative = "relativeQuantity=\"true\"";
        assert_eq!(of(standard, "", ""), (1.0, -273.15));
        assert_eq!(of(standard, relative, ""), (1.0, 0.0));
        assert_eq!(of(standard, "", relative), (1.0, 0.0));
        assert_eq!(of(standard, "relativeQuantity=\"false\"", relative), (1.0, -273.15));
    }
}

#[test]
fn steps_have_the_same_size_if_the_fmu_needs_it() {
    let changes = [("canHandleVariableCommunicationStepSize=\"true\"", "")];
    for standard in VERSIONS {
        let fmu = opened_with("plain", standard, &changes).system().clone();
        assert_eq!(end(&fmu).map(|y| (y * 1e9).round()), Ok(1e9), "the times differ only by rounding errors");
        let batch = Batch { time: &[0.0, 0.1, 0.3, 0.35, 1.0], outputs: vec!["y"], ..Batch::default() };
        let why = fmu.run(&batch, &Watch::default()).unwrap_err().to_string();
        assert!(
            why.contains("the first step has 0.1 s and the step from 0.1 s has 0.19999999999999998 s"),
            "{why}"
        );
        let mut two = fmu.instances(&Setup { count: 2, ..Setup::default() }).unwrap();
        two.step(0.1, None).unwrap();
        let why = two.step(0.25, None).unwrap_err().to_string();
        assert!(why.contains("canHandleVariableCommunicationStepSize is not true"), "{why}");
        two.step_to(0.2, None).unwrap();
        assert!(two.step_to(0.25, Some(&[false, true])).is_err());
        two.step_to(0.3, None).unwrap();
        assert_eq!(two.errors().count(), 0);
        two.reset(None);
        two.step(0.25, None).unwrap();
        opened("plain", standard).run(&batch, &Watch::default()).unwrap();
    }
}

/// Differences between the times of a grid have rounding errors, but all steps have one size if an FMU needs it.
#[test]
fn steps_have_the_same_size_to_the_last_bit_if_the_fmu_needs_it() {
    let time: Vec<_> = (0..=30).map(|k| 100.0 + 0.1 * f64::from(k)).collect();
    assert!(time.windows(2).any(|pair| pair[1] - pair[0] != time[1] - time[0]));
    let changes = [("canHandleVariableCommunicationStepSize=\"true\"", "")];
    for standard in VERSIONS {
        let fmu = opened_with("equal_steps", standard, &changes).system().clone();
        let batch = Batch { time: &time, outputs: vec!["y"], every: Some(1), ..Batch::default() };
        assert_eq!(fmu.run(&batch, &Watch::default()).unwrap().errors, []);
        let setup = Setup { start_time: time[0], ..Setup::default() };
        let mut one = fmu.instances(&setup).unwrap();
        time[1..].iter().for_each(|time| one.step_to(*time, None).unwrap());
        one.reset(None);
        time.windows(2).for_each(|pair| one.step(pair[1] - pair[0], None).unwrap());
        assert_eq!(one.errors().count(), 0);
    }
}

/// Variables of different types may have the same value reference (section 2.2.7 of FMI 2.0).
#[test]
fn value_references_are_unique_only_within_a_type() {
    let on = "<ScalarVariable name=\"on\" valueReference=\"1\" causality=\"input\" variability=\"discrete\"><Boolean start=\"false\"/></ScalarVariable></ModelVariables>";
    for (known, is_loop) in [("10", false), ("1", true)] {
        let unknown = format!("<Unknown index=\"2\" dependencies=\"{known}\"/>");
        let changes = [("</ModelVariables>", on), ("<Unknown index=\"2\"/>", &unknown)];
        let fmu = opened_with("plain", Standard::Fmi2, &changes);
        let order = Order::Dependencies;
        let composition = Composition {
            name: "s",
            components: vec![("a", &fmu)],
            connections: vec![("a.y", "a.u")],
            order,
        };
        assert_eq!(System::connect(&composition).is_err(), is_loop, "{known}");
    }
}

/// Values that a variable cannot have are errors that name the type.
#[test]
fn values_fit_their_variables() {
    let more = "<Float32 name=\"single\" valueReference=\"51\" causality=\"input\" start=\"0\"/>\
        <Enumeration name=\"choice\" valueReference=\"9\" causality=\"input\" start=\"1\"/></ModelVariables>";
    let fmu = opened_with("plain", Standard::Fmi3, &[("</ModelVariables>", more)]).system().clone();
    let with = |start| fmu.instances(&Setup { start, ..Setup::default() });
    let mut one = with(vec![("choice", Start::Same(5e9))]).unwrap();
    let choice = fmu.select(&["choice"]).unwrap();
    let mut value = [0.0];
    one.get(&choice, &mut value);
    assert_eq!(value, [5e9]);
    one.set(&choice, &[-6e9], None).unwrap();
    one.get(&choice, &mut value);
    assert_eq!(value, [-6e9]);
    for (name, value, why) in [
        ("choice", 1e16, "an integer from -9007199254740991 to 9007199254740992"),
        ("valve", 2.5, "valve is an integer and cannot be 2.5"),
        ("single", 1e300, "single is a 32-bit floating-point number and cannot be 1e300"),
        ("y", 1.0, "y is read-only"),
    ] {
        let found = with(vec![(name, Start::Same(value))]).unwrap_err().to_string();
        assert!(found.contains(why), "{found}");
    }
    for (name, why) in [
        ("y", "y is not an input but an output, which cannot be set"),
        ("tolerance", "tolerance is not an input but a discrete local, which cannot be set"),
    ] {
        let inputs = vec![(name, Trajectory::Constant(1.0))];
        let batch = Batch { time: &[0.0, 1.0], inputs, ..Batch::default() };
        assert_eq!(fmu.run(&batch, &Watch::default()).unwrap_err().to_string(), why);
    }
    let of_fmi2 = opened("plain", Standard::Fmi2)
        .instances(&Setup { start: vec![("valve", Start::Same(5e9))], ..Setup::default() });
    assert!(of_fmi2.unwrap_err().to_string().contains("an integer from -2147483648 to 2147483647"));
}

#[test]
fn the_rounding_of_an_fmu_does_not_reach_the_caller() {
    for standard in VERSIONS {
        let fmu = opened("rounding", standard);
        let mut one = fmu.instances(&Setup::default()).unwrap();
        let mut value = [0.0];
        one.get(&fmu.select(&["y"]).unwrap(), &mut value);
        let third = std::hint::black_box(1.0_f64) / std::hint::black_box(3.0);
        assert_eq!(third.to_bits(), 0x3fd5_5555_5555_5555, "{standard}");
        // If the FMU's unmasked exceptions remained, this division would end the process.
        assert!((std::hint::black_box(1.0_f64) / std::hint::black_box(value[0])).is_infinite());
    }
}

#[test]
fn a_second_instance_of_an_fmu_that_exists_once_is_an_error() {
    for standard in VERSIONS {
        let fmu = opened("once", standard);
        let first = fmu.instances(&Setup::default()).unwrap();
        let second = fmu.instances(&Setup::default()).unwrap_err().to_string();
        assert_eq!(second, "there is an instance already");
        drop(first);
        fmu.instances(&Setup::default()).unwrap();
    }
}

#[test]
fn exact_values_are_start_values_inputs_and_outputs() {
    let fmu = opened("plain", Standard::Fmi3);
    let wide = |number: i64| Value::Integer(number.into());
    let (large, small) = (wide((1 << 53) + 1), wide(i64::MIN));
    let bytes = [Value::Binary(vec![0, 1, 2]), Value::Binary(Vec::new()), Value::Binary(vec![255])];
    let time = [0.0, 0.1, 0.2];
    let labels = ["a", "", "\u{e4}"].map(Value::from);
    let naturals = [Value::Integer(u64::MAX.into()), Value::Integer(7)];
    let sampled = [large.clone(), small.clone()];
    let batch = Batch {
        time: &time,
        inputs: vec![
            ("label", Trajectory::Values(&labels)),
            ("bytes", Trajectory::Values(&bytes)),
            ("wide", Trajectory::SampledValues { times: &[0.0, 0.15], values: &sampled }),
        ],
        start: vec![("natural", Start::EachValue(&naturals))],
        outputs: vec!["echo", "y", "bytes_out", "wide_out", "natural"],
        every: Some(1),
        ..Batch::default()
    };
    let runs = fmu.run(&batch, &Watch::default()).unwrap();
    assert_eq!((runs.size.outputs, runs.size.exact, runs.size.runs, runs.errors.len()), (1, 4, 2, 0));
    for (run, natural) in naturals.iter().enumerate() {
        let of = |output: usize| {
            runs.exact[(run * 4 + output) * 3..][..3]
                .iter()
                .map(|value| value.clone().unwrap())
                .collect::<Vec<_>>()
        };
        assert_eq!(of(0), labels);
        assert_eq!(of(1), bytes);
        assert_eq!(of(2), [large.clone(), large.clone(), small.clone()]);
        assert_eq!(of(3), vec![natural.clone(); 3]);
    }
    let mut two = fmu
        .instances(&Setup { count: 2, start: vec![("wide", Start::Value(&large))], ..Setup::default() })
        .unwrap();
    assert_eq!(two.values("wide_out").unwrap(), vec![Some(large.clone()); 2]);
    two.set_values("wide", &[small.clone(), large.clone()], None).unwrap();
    two.set_values("label", &["x".into()], Some(&[false, true])).unwrap();
    assert_eq!(two.values("wide_out").unwrap(), [Some(small), Some(large)]);
    assert_eq!(two.texts("echo").unwrap().or_empty(), ["none", "x"]);
    // Values that do not fit the type are errors. So are numbers that f64 may have rounded, outputs, and variables for which `set`
    // is meant.
    for (name, value, why) in [
        ("wide", Value::Real(1.5), "its value cannot be 1.5"),
        ("wide", Value::Real(1e17), "may not be the one that is meant"),
        ("wide", Value::Integer(1 << 63), "cannot be 9223372036854775808"),
        ("natural", Value::Integer(-1), "cannot be -1"),
        (
            "natural",
            Value::Integer(1 << 64),
            "from 0 to 18446744073709551615 and cannot be 18446744073709551616",
        ),
        ("label", Value::Integer(1), "is a string, its value cannot be 1"),
        ("label", Value::from("a\0"), "character NUL"),
        ("bytes", Value::from("text"), "is binary, its value cannot be"),
        ("u", Value::Real(1.0), "set it with set"),
        ("wide_out", Value::Integer(1), "read-only"),
    ] {
        let found = two.set_values(name, std::slice::from_ref(&value), None).unwrap_err().to_string();
        assert!(found.contains(why), "{name}: {found}");
        if name != "u" {
            let start = vec![(name, Start::Value(&value))];
            let batch = Batch { time: &time, start, outputs: vec!["y"], ..Batch::default() };
            let found = fmu.run(&batch, &Watch::default()).unwrap_err().to_string();
            assert!(found.contains(why), "{name}: {found}");
        }
    }
    let mut rounded = [0.0; 2];
    two.get(&fmu.select(&["wide_out"]).unwrap(), &mut rounded);
    assert!(two.errors().all(|(_, why)| why.contains("wide_out")) && rounded[1].is_nan(), "{rounded:?}");
}

/// Replaces missing strings by empty ones.
trait OrEmpty {
    fn or_empty(self) -> Vec<String>;
}

impl OrEmpty for Vec<Option<String>> {
    fn or_empty(self) -> Vec<String> {
        self.into_iter().map(|text| text.unwrap_or_default()).collect()
    }
}

#[test]
fn structural_parameters_change_the_sizes_of_arrays() {
    let fmu = opened("plain", Standard::Fmi3);
    let time = [0.0, 1.0];
    for (size, outputs, sum) in [(2.0, vec!["sum", "vector[2]"], 3.0), (5.0, vec!["sum", "vector[5]"], 15.0)]
    {
        let batch = Batch {
            time: &time,
            start: vec![("size", Start::Same(size))],
            outputs,
            every: Some(2),
            ..Batch::default()
        };
        let runs = fmu.run(&batch, &Watch::default()).unwrap();
        assert_eq!((runs.errors.len(), &runs.trajectories[..]), (0, &[sum, size][..]), "{:?}", runs.errors);
    }
    // A structural parameter that is not the size of an array can have any type (section 2.4.7.2 of FMI 3.0).
    let start = vec![("size", Start::Same(2.0)), ("scale", Start::Same(2.5))];
    let batch = Batch { time: &time, start, outputs: vec!["sum"], every: Some(2), ..Batch::default() };
    assert_eq!(fmu.run(&batch, &Watch::default()).unwrap().trajectories, [7.5]);
    let start = vec![("size", Start::Value(&Value::Integer(4))), ("vector[4]", Start::Same(10.0))];
    let mut one = fmu.instances(&Setup { start, ..Setup::default() }).unwrap();
    let mut sum = [0.0];
    let selection = one.system().select(&["sum"]).unwrap();
    one.get(&selection, &mut sum);
    assert_eq!(sum, [16.0]);
    one.reset(None);
    one.get(&selection, &mut sum);
    assert_eq!(sum, [16.0], "a reset must keep the start values");
    // The start values in the model description are for the default size, so the FMU is asked for the others.
    let start = vec![("size", Start::Same(2.0)), ("vector[1]", Start::Same(10.0))];
    let runs =
        fmu.run(&Batch { time: &time, start, outputs: vec!["sum"], ..Batch::default() }, &Watch::default());
    assert_eq!(runs.unwrap().errors, []);
    let halves = "start=\"1 2 3\"><Dimension";
    let fmu_of = |starts: &str| opened_with("plain", Standard::Fmi3, &[(halves, starts)]).system().clone();
    for (starts, size, sum) in [
        // Other start values than the FMU has after its size has changed, which are 1 2 3 4.
        ("start=\"7 8 9\"><Dimension", 4.0, 10.0 + 2.0 + 3.0 + 4.0),
        ("start=\"7 8 9\"><Dimension", 3.0, 10.0 + 2.0 + 3.0),
        // One start value is for all elements, of any number of them.
        ("start=\"7\"><Dimension", 4.0, 10.0 + 3.0 * 7.0),
        // No start value: nothing is invented.
        ("start=\"\"><Dimension", 3.0, 10.0 + 2.0 + 3.0),
    ] {
        let start = vec![("size", Start::Same(size)), ("vector[1]", Start::Same(10.0))];
        let batch = Batch { time: &time, start, outputs: vec!["sum"], every: Some(2), ..Batch::default() };
        assert_eq!(fmu_of(starts).run(&batch, &Watch::default()).unwrap().trajectories, [sum], "{starts}");
    }
    let wrong =
        |start| fmu.instances(&Setup { start, count: 2, ..Setup::default() }).unwrap_err().to_string();
    assert!(wrong(vec![("size", Start::Each(&[1.0, 2.0]))]).contains("one value for all"));
    assert!(wrong(vec![("size", Start::Same(9.0))]).contains("fmi3SetUInt64"));
    assert!(wrong(vec![("size", Start::Same(2.0)), ("vector[3]", Start::Same(0.0))]).contains("no variable"));
    let set = one.set(&one.system().select(&["size"]).unwrap(), &[3.0], None).unwrap_err().to_string();
    assert!(set.contains("size is a structural parameter"), "{set}");
    let start = one.start_from(&[("size", Start::Same(3.0))]).unwrap_err().to_string();
    assert_eq!(start, "size is a structural parameter; set it when the instances are created");
}
