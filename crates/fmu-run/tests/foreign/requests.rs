//! Messages about requests that cannot be fulfilled: unknown names, wrong values and times.

use crate::VERSIONS;
use crate::built::{misbehaving, opened, opened_with};
use fmu_run::{
    Batch, Composition, Error, Measure, Order, Setup, Standard, Start, System, Trajectory, Value, Watch,
    nearest,
};

/// Runs an FMU after a change of the batch, and returns the error.
fn error<'a>(fmu: &System, change: impl FnOnce(&mut Batch<'a>)) -> String {
    let mut batch = Batch { time: &[0.0, 0.1, 0.2], outputs: vec!["y"], every: Some(1), ..Batch::default() };
    change(&mut batch);
    fmu.run(&batch, &Watch::default()).unwrap_err().to_string()
}

#[test]
fn unknown_names_have_a_hint() {
    let names = "theta1 theta2 omega1 omega2 tau1 tau2 pitch roll pitch_rate roll_rate theta3 theta3_start der(theta3)";
    let near = |name| nearest(name, names.split(' ').map(str::to_owned));
    for (wrong, right) in [
        ("thet1", "theta1"),
        ("theta", "theta1"),
        ("rolls", "roll"),
        ("TAU2", "tau2"),
        ("pitch_angle", "pitch"),
        ("Roll_Rate", "roll_rate"),
    ] {
        assert_eq!(near(wrong).as_deref(), Some(right), "{wrong}");
    }
    assert_eq!(near("nope"), None);
    let fmu = misbehaving(Standard::Fmi2, &[]);
    let of_input = error(fmu.system(), |batch| batch.inputs = vec![("slopes", Trajectory::Constant(0.0))]);
    assert_eq!(of_input, "FaultyFmu has no variable \"slopes\"; did you mean \"slope\"?");
    assert_eq!(
        error(fmu.system(), |batch| batch.outputs = vec!["nope"]),
        "FaultyFmu has no variable \"nope\""
    );
}

#[test]
fn values_and_times_are_checked() {
    let fmu = misbehaving(Standard::Fmi2, &[]);
    let input = |name, values| move |batch: &mut Batch| batch.inputs = vec![(name, values)];
    assert_eq!(
        error(fmu.system(), input("behaviour", Trajectory::Constant(0.0))),
        "behaviour is not an input but a fixed parameter; give it a start value"
    );
    assert_eq!(
        error(fmu.system(), input("y", Trajectory::Constant(0.0))),
        "y is not an input but a continuous output, which cannot be set"
    );
    let text = |text: &str| Value::from(text);
    let (stiff, on, glad) = (text("stiff"), text("on"), text("Glad"));
    for (name, start, why) in [
        ("y", Start::Same(1.0), "y is read-only: it is calculated by the FMU and has no start value"),
        ("flag", Start::Same(2.0), "flag is a Boolean and cannot be 2"),
        ("count", Start::Same(2.5), "count is an integer and cannot be 2.5"),
        ("slope", Start::Value(&stiff), "slope is a number, its start value cannot be \"stiff\""),
        ("flag", Start::Value(&on), "flag is a Boolean, its start value cannot be \"on\""),
        (
            "behaviour",
            Start::Value(&glad),
            "behaviour is one of Good, SilentError, its start value cannot be \"Glad\"",
        ),
    ] {
        assert_eq!(error(fmu.system(), |batch| batch.start = vec![(name, start)]), why);
    }
    let [two, three] = [&[1.0, 2.0][..], &[1.0, 2.0, 3.0]];
    assert_eq!(
        error(fmu.system(), |batch| batch.start =
            vec![("slope", Start::Each(two)), ("count", Start::Each(three))]),
        "slope is given for 2 runs, count for 3"
    );
    assert_eq!(
        error(fmu.system(), |batch| {
            batch.inputs = vec![("slope", Trajectory::EachRun(&[0.0; 9]))];
            batch.start = vec![("count", Start::Each(two))];
        }),
        "slope is given for 3 runs, count for 2"
    );
    for (time, why) in [
        (&[0.0][..], "time has 1 values; a run needs at least two"),
        (&[0.0, 0.1, f64::NAN], "time[2] is NaN; times must be finite"),
        (&[0.0, 0.2, 0.2], "time[2] is 0.2, which is not after time[1], 0.2"),
        (&[0.0, 3.41e-200, -5e-324], "time[2] is -5e-324, which is not after time[1], 3.41e-200"),
    ] {
        assert_eq!(error(fmu.system(), |batch| batch.time = time), why);
    }
    assert_eq!(error(fmu.system(), |batch| batch.every = Some(0)), "every must be at least 1");
    assert_eq!(error(fmu.system(), |batch| batch.threads = Some(0)), "threads must be at least 1");
    let select = |names: &[&str]| fmu.system().select(names).unwrap_err().to_string();
    assert_eq!(select(&["y", "label"]), "label is not a number");
    let mut one = fmu.system().instances(&Setup::default()).unwrap();
    let mut set = |names: &[&str], values: &[f64]| {
        let selection = fmu.system().select(names).unwrap();
        one.set(&selection, values, None).unwrap_err().to_string()
    };
    assert_eq!(set(&["count"], &[2.5]), "count is an integer and cannot be 2.5");
    assert_eq!(set(&["slope", "flag"], &[1.0, 2.0]), "flag is a Boolean and cannot be 2");
    assert_eq!(one.texts("y").unwrap_err().to_string(), "y is a number, not a string");
    let unit = |name, unit| fmu.system().display_unit(name, unit).unwrap_err().to_string();
    assert_eq!(unit("slope", "N"), "slope can be given in m/s, not in \"N\"");
    assert_eq!(unit("count", "kg"), "count has no unit, its values cannot be in kg");
}

#[test]
fn input_derivatives_need_the_capability_and_a_real_input() {
    let derivative_of =
        |name| move |batch: &mut Batch| batch.input_derivatives = vec![(name, Trajectory::Constant(1.0))];
    for standard in VERSIONS {
        let why = error(&opened("plain", standard), derivative_of("u"));
        assert_eq!(why, "Foreign takes no input derivatives (canInterpolateInputs of FMI 2.0)");
    }
    let capability = [("canHandleVariableCommunicationStepSize=\"true\"", "canInterpolateInputs=\"true\"")];
    let fmu = opened_with("plain", Standard::Fmi2, &capability);
    for name in ["gain", "valve"] {
        let why = error(fmu.system(), derivative_of(name));
        assert_eq!(why, format!("{name} is not a Real input; only these have input derivatives"));
    }
}

/// Items of an enumeration and Booleans can be given by their names, and each run can have its own string.
#[test]
fn start_values_are_strings() {
    let fmu = misbehaving(Standard::Fmi2, &[]);
    let [labels, behaviours] = [["one", "three"], ["Good", "SilentError"]].map(|all| all.map(Value::from));
    let flag = Value::from("true");
    let batch = Batch {
        time: &[0.0, 0.5, 1.0],
        start: vec![
            ("label", Start::EachValue(&labels)),
            ("behaviour", Start::EachValue(&behaviours)),
            ("flag", Start::Value(&flag)),
        ],
        outputs: vec!["y", "flag"],
        measures: vec![Measure::End],
        every: Some(2),
        ..Batch::default()
    };
    let runs = fmu.system().run(&batch, &Watch::default()).unwrap();
    // The FMU adds the length of the label.
    assert_eq!([runs.trajectories[0], runs.trajectories[4]], [3.0, 5.0]);
    assert_eq!(runs.trajectories[2], 1.0);
    assert_eq!(runs.errors.iter().map(|(run, _)| *run).collect::<Vec<_>>(), [1]);
}

/// A variable has the unit of its declared type, unless it has its own. A type that is not defined has none.
#[test]
fn units_of_declared_types() {
    let unit = |standard, changes: &[_], name| {
        let fmu = misbehaving(standard, changes);
        fmu.description().variable(name).unwrap().unit.as_deref().map(str::to_owned)
    };
    for (standard, without) in [(Standard::Fmi2, "count"), (Standard::Fmi3, "number")] {
        for (name, expected) in [("y", Some("m")), ("gap", Some("mm")), (without, None)] {
            assert_eq!(unit(standard, &[], name).as_deref(), expected, "{name}");
        }
        assert_eq!(
            unit(standard, &[("declaredType=\"Length\"/>", "declaredType=\"Undefined\"/>")], "y"),
            None
        );
    }
    assert_eq!(unit(Standard::Fmi2, &[], "slope").as_deref(), Some("m/s"));
}

/// Returns the message of a request that cannot be fulfilled.
fn rejected<T>(result: Result<T, Error>) -> String {
    match result {
        Err(Error::Request(why)) => why,
        Err(other) => panic!("{other:?}"),
        Ok(_) => panic!("it is fulfilled"),
    }
}

#[test]
fn calls_of_instances_are_checked() {
    for standard in VERSIONS {
        let directional = [(
            "canHandleVariableCommunicationStepSize=\"true\"",
            match standard {
                Standard::Fmi2 => "providesDirectionalDerivative=\"true\"",
                Standard::Fmi3 => "providesDirectionalDerivatives=\"true\"",
            },
        )];
        let fmu = opened_with("plain", standard, &directional).system().clone();
        let setup = |count, start| Setup { count, start, ..Setup::default() };
        assert_eq!(rejected(fmu.instances(&setup(0, vec![]))), "count must be at least 1");
        let three = vec![("gain", Start::Each(&[1.0, 2.0, 3.0]))];
        assert_eq!(rejected(fmu.instances(&setup(2, three))), "gain has 3 start values for 2 instances");
        let mut two = fmu.instances(&setup(2, vec![])).unwrap();
        for (size, shown) in [(-1e-3, "-0.001"), (0.0, "0"), (f64::NAN, "NaN")] {
            let why = format!("the size of a step is {shown} s; it must be above 0 and finite");
            assert_eq!(rejected(two.step(size, None)), why);
        }
        let late = "to is 0 s; it must be after the time of each instance, and instance 0 is at 0 s";
        assert_eq!(rejected(two.step_to(0.0, None)), late);
        let select = |name| fmu.select(&[name]).unwrap();
        assert_eq!(rejected(two.set(&select("y"), &[1.0], None)), "y is read-only: it is an output");
        let local = "tolerance is read-only: it is a local variable";
        assert_eq!(rejected(two.set(&select("tolerance"), &[1.0], None)), local);
        let known = "tolerance cannot be a known; expected an input, a parameter or a continuous state";
        let mut derivatives = [0.0; 2];
        let with_respect_to = (&select("tolerance"), &[1.0][..]);
        assert_eq!(
            rejected(two.directional_derivative(&select("y"), with_respect_to, &mut derivatives)),
            known
        );
        let none: [Option<&[u8]>; 1] = [None];
        assert_eq!(rejected(two.deserialize(&none)), "there are 1 states for 2 instances");
        assert_eq!(rejected(two.deserialize(&[None, Some(&[][..])])), "the state of instance 1 is cut short");
        assert_eq!(two.errors().count(), 0);
    }
}

#[test]
fn missing_capabilities_fail_no_instance() {
    let fmu = misbehaving(Standard::Fmi2, &[]).system().clone();
    let mut one = fmu.instances(&Setup::default()).unwrap();
    let [y, slope] = [["y"], ["slope"]].map(|name| fmu.select(&name).unwrap());
    let lacks = |what: &str| format!("FaultyFmu {what}");
    assert_eq!(rejected(one.save()), lacks("cannot save its state (canGetAndSetFMUstate is not true)"));
    assert_eq!(
        rejected(one.deserialize(&[Some(b"12345678")])),
        lacks("cannot deserialize a state (canSerializeFMUstate is not true)")
    );
    assert_eq!(
        rejected(one.directional_derivative(&y, (&slope, &[1.0]), &mut [0.0])),
        lacks("has no directional derivatives (providesDirectionalDerivative is not true)")
    );
    assert_eq!(
        rejected(one.set_input_derivatives(&slope, &[1.0], None)),
        lacks("takes no input derivatives (canInterpolateInputs of FMI 2.0)")
    );
    one.step(0.1, None).unwrap();
    assert_eq!(one.errors().count(), 0);
}

#[test]
fn connections_are_checked() {
    for standard in VERSIONS {
        let fmu = opened_with("plain", standard, &[]);
        let connect = |connections: &[(&'static str, &'static str)], order| {
            let components = vec![("a", &fmu), ("b", &fmu)];
            let connections = connections.to_vec();
            System::connect(&Composition { name: "s", components, connections, order })
        };
        for (from, to, why) in [
            ("a.Y", "b.u", "s has no variable \"a.Y\"; did you mean \"a.y\"?"),
            ("a.u", "b.u", "a.u is input, not output"),
            ("a.y", "b.y", "b.y is output, not input"),
        ] {
            assert_eq!(rejected(connect(&[(from, to)], Order::Jacobi)), why);
        }
        let other_type = rejected(connect(&[("a.y", "b.valve")], Order::Jacobi));
        assert!(other_type.starts_with("a.y cannot feed b.valve: the output is "), "{other_type}");
        let twice = [("a.y", "b.u"), ("b.y", "b.u")];
        assert_eq!(rejected(connect(&twice, Order::Jacobi)), "b.u is fed twice");
        let connected = connect(&[("a.y", "b.u")], Order::Jacobi).unwrap();
        let fed = "b.u is fed by a.y, it cannot be set";
        let mut one = connected.instances(&Setup::default()).unwrap();
        assert_eq!(rejected(one.set(&connected.select(&["b.u"]).unwrap(), &[1.0], None)), fed);
        let of_run = |change: &dyn Fn(&mut Batch)| {
            let mut batch = Batch { time: &[0.0, 1.0], outputs: vec!["b.y"], ..Batch::default() };
            change(&mut batch);
            rejected(connected.run(&batch, &Watch::default()))
        };
        assert_eq!(of_run(&|batch| batch.inputs = vec![("b.u", Trajectory::Constant(1.0))]), fed);
        assert_eq!(of_run(&|batch| batch.start = vec![("b.u", Start::Same(1.0))]), fed);
        let unknown = connected.select(&["a.y"]).unwrap();
        assert_eq!(
            rejected(one.get_output_derivatives(&unknown, &mut [0.0])),
            "only Real variables have derivatives, of one FMU and not of a system"
        );
    }
}

/// The model description lists no dependencies, so each output may depend on every input.
#[test]
fn algebraic_loops_are_named() {
    let fmu = misbehaving(Standard::Fmi2, &[]);
    let connect = |components, order| {
        let connections = vec![("a.instances", "a.count")];
        System::connect(&Composition { name: "s", components, connections, order })
    };
    let found = rejected(connect(vec![("a", &fmu)], Order::Dependencies));
    assert!(found.starts_with("there is an algebraic loop: a.instances -> a.count; "), "{found}");
    assert!(found.ends_with("Order Jacobi passes them on a step later"), "{found}");
    let delayed = connect(vec![("a", &fmu)], Order::Jacobi).unwrap();
    let batch = Batch { time: &[0.0, 1.0], outputs: vec!["a.count"], every: Some(1), ..Batch::default() };
    assert_eq!(delayed.run(&batch, &Watch::default()).unwrap().trajectories[1], 1.0);
    let why = connect(vec![("a", &fmu), ("b", &fmu)], Order::Jacobi).unwrap_err().to_string();
    assert!(why.contains("can have only one instance per process"), "{why}");
}
