//! Clocks of FMI 3.0 in Co-Simulation and Model Exchange, with `clocks.c` of the test kit, and events in Co-Simulation. Both interface types
//! have the same results.

use crate::close;
use fmu_run::{Batch, Error, Fmu, Interface, Occurrence, Runs, System, Trajectory, Value, Watch};
use fmu_test_kit::c_models::{library, pack};

const INTERFACES: [Interface; 2] = [Interface::CoSimulation, Interface::ModelExchange];

/// The description of the model. The clock `tick` has these attributes.
fn description(traits: &str, tick: &str, co_simulation: &str) -> String {
    if tick == NO_CLOCKS {
        let all = description(traits, CONSTANT, co_simulation);
        let is_kept = |line: &&str| !line.contains("clocks=");
        return all.lines().filter(is_kept).collect();
    }
    let clock = |reference: u32, name: &str, attributes: &str| {
        format!("<Clock name=\"{name}\" valueReference=\"{reference}\" {attributes}/>")
    };
    let input = "causality=\"input\" intervalVariability";
    let clocks: String = [
        clock(10, "tick", &format!("causality=\"input\" {tick}")),
        clock(11, "third", &format!("{input}=\"fixed\" supportsFraction=\"true\"")),
        clock(12, "tuned", &format!("{input}=\"tunable\"")),
        clock(13, "changing", &format!("{input}=\"changing\"")),
        clock(14, "down", &format!("{input}=\"countdown\"")),
        clock(15, "pressed", &format!("{input}=\"triggered\"")),
        clock(16, "out", "causality=\"output\" intervalVariability=\"triggered\" clocks=\"10\""),
        clock(17, "next", "causality=\"local\" intervalVariability=\"triggered\""),
    ]
    .concat();
    let counts: String = (0..8)
        .map(|k| {
            let (reference, clock) = (20 + k, 10 + k);
            format!("<Int32 name=\"count{k}\" valueReference=\"{reference}\" causality=\"output\" clocks=\"{clock}\"/>")
        })
        .collect();
    let output = |reference: u32, name: &str, rest: &str| {
        format!(
            "<Float64 name=\"{name}\" valueReference=\"{reference}\" causality=\"output\" variability=\"discrete\" {rest}"
        )
    };
    let outputs = [
        output(31, "sum", "clocks=\"10\"/>"),
        output(32, "instant", "clocks=\"10\"/>"),
        output(33, "sampled", "clocks=\"10\"/>"),
        output(35, "vector", "clocks=\"15\"><Dimension start=\"2\"/></Float64>"),
    ]
    .concat();
    format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="clocks" instantiationToken="{{{traits}}}">
        <ModelExchange modelIdentifier="clocks"/>
        <CoSimulation modelIdentifier="clocks" {co_simulation}/>
        <ModelVariables>
        <Float64 name="u" valueReference="1" causality="input" start="0"/>
        <Int32 name="n" valueReference="2" causality="input" start="0"/>
        <Int64 name="large" valueReference="8" causality="input" start="0"/>
        <Float64 name="x" valueReference="3" causality="output"/>
        <Int32 name="hits" valueReference="4" causality="output"/>
        <Int32 name="timed" valueReference="5" causality="output"/>
        <Int32 name="seen" valueReference="6" causality="output"/>
        <Float64 name="der(x)" valueReference="7" causality="local" derivative="3"/>
        <Float64 name="sample" valueReference="30" causality="input" variability="discrete" start="0" clocks="10"/>
        <Float64 name="period" valueReference="34" causality="parameter" variability="tunable" start="0.4"/>
        {clocks}{counts}{outputs}
        </ModelVariables>
        <ModelStructure><Output valueReference="3"/><ContinuousStateDerivative valueReference="7"/>
        <EventIndicator valueReference="7"/></ModelStructure></fmiModelDescription>"#
    )
}

/// Removes the clocks and the clocked variables from the description.
const NO_CLOCKS: &str = "none";
const CONSTANT: &str = "intervalVariability=\"constant\" intervalDecimal=\"0.1\"";
const EVENTS: &str = "hasEventMode=\"true\" canHandleVariableCommunicationStepSize=\"true\" mightReturnEarlyFromDoStep=\"true\"";

fn opened_with(traits: &str, tick: &str, co_simulation: &str) -> System {
    let directory = tempfile::tempdir().unwrap();
    let xml = description(traits, tick, co_simulation);
    let path = pack(directory.path(), ("clocks", 3), &xml, &library("clocks", &[]), &[]);
    // SAFETY: the FMU of these tests.
    unsafe { Fmu::open(&path) }.unwrap().system().clone()
}

fn opened(traits: &str, tick: &str) -> System {
    opened_with(traits, tick, EVENTS)
}

/// Communication points that are sums of floating-point numbers, most of which are not the nearest to a decimal number.
fn sums(step: f64, count: usize) -> Vec<f64> {
    std::iter::successors(Some(0.0), |time| Some(time + step)).take(count + 1).collect()
}

fn run(fmu: &System, interface: Interface, batch: &Batch) -> Result<Runs, Error> {
    fmu.run(&Batch { interface: Some(interface), every: Some(1), ..batch.clone() }, &Watch::default())
}

/// Runs the FMU in both interface types, which must have equal results, and returns the trajectories and the events of Co-Simulation.
fn both(fmu: &System, batch: &Batch) -> (Vec<Vec<f64>>, Vec<Occurrence>) {
    let [one, other] = INTERFACES.map(|interface| run(fmu, interface, batch).unwrap());
    assert_eq!((&one.errors, &other.errors), (&Vec::new(), &Vec::new()));
    let same = |one: &[f64], other: &[f64]| {
        one.iter().zip(other).for_each(|(one, other)| {
            assert!(one.is_nan() && other.is_nan() || (one - other).abs() < 1e-9, "{one} {other}")
        });
    };
    same(&one.trajectories, &other.trajectories);
    assert_eq!(one.events.len(), other.events.len(), "{:#?} {:#?}", one.events, other.events);
    for (one, other) in one.events.iter().zip(&other.events) {
        close(one.time, other.time, 1e-9);
        same(&one.before, &other.before);
        same(&one.after, &other.after);
        assert_eq!(one.clocks, other.clocks);
    }
    (one.trajectories.chunks(one.size.kept).map(<[f64]>::to_vec).collect(), one.events)
}

/// The times and the values of the events at which a clock has ticked.
fn ticks(events: &[Occurrence], clock: &str, output: usize) -> Vec<(f64, f64)> {
    let of_clock = events.iter().filter(|event| event.clocks.iter().any(|name| name == clock));
    of_clock.map(|event| (event.time, event.after[output])).collect()
}

#[test]
fn a_periodic_clock_ticks_at_exact_times() {
    // The declared interval is 0.1 s, as a decimal number or as a fraction.
    for tick in [
        CONSTANT,
        "intervalVariability=\"tunable\" intervalDecimal=\"0.1\" shiftDecimal=\"0\"",
        "intervalVariability=\"fixed\" supportsFraction=\"true\" intervalCounter=\"2\" resolution=\"20\" intervalDecimal=\"9\"",
    ] {
        let fmu = opened("", tick);
        let time: Vec<f64> = (0..=20).map(|k| f64::from(k) / 20.0).collect();
        let mut batch = Batch {
            time: &time,
            outputs: vec!["count0", "instant", "x", "sum", "sampled"],
            ..Batch::default()
        };
        batch.inputs = vec![
            ("u", Trajectory::Constant(1.0)),
            ("sample", Trajectory::Sampled { times: &[0.0, 0.5], values: &[1.0, 10.0] }),
        ];
        batch.events = true;
        let (found, events) = both(&fmu, &batch);
        for (k, time) in time.iter().enumerate() {
            let ticks = k / 2 + 1;
            close(found[2][k], *time, 1e-9);
            if k % 2 == 1 {
                assert!([0, 1, 3, 4].iter().all(|row: &usize| found[*row][k].is_nan()));
                continue;
            }
            assert_eq!([found[0][k], found[1][k]], [ticks as f64, *time]);
            // Five ticks with the sample 1, then 10. The tick at 0.5 s has the new one.
            assert_eq!(found[3][k], (ticks.min(5) + 10 * ticks.saturating_sub(5)) as f64);
            close(found[4][k], *time, 1e-9);
        }
        let expected: Vec<_> = (0..=10).map(|k| (f64::from(k) / 10.0, f64::from(k + 1))).collect();
        assert_eq!(ticks(&events, "tick", 0), expected);
        // With hold, the values stay until the next tick.
        batch.hold = true;
        let (held, _) = both(&fmu, &batch);
        (0..=20).for_each(|k| assert_eq!(held[0][k], (k / 2 + 1) as f64));
    }
}

#[test]
fn ticks_are_at_the_communication_points_that_they_equal() {
    // The point that should be 0.3 is 0.30000000000000004, and the later ones are further off.
    let (fmu, time) = (opened("", CONSTANT), sums(0.1, 1000));
    assert!((time[1000] - 100.0).abs() > 1e-12);
    let (found, _) =
        both(&fmu, &Batch { time: &time, outputs: vec!["count0", "instant"], ..Batch::default() });
    for (k, time) in time.iter().enumerate() {
        assert_eq!([found[0][k], found[1][k]], [(k + 1) as f64, *time]);
    }
    // An FMU that needs steps of equal size has ticks only there.
    let fmu =
        opened_with("", "intervalVariability=\"constant\" intervalDecimal=\"0.05\"", "hasEventMode=\"true\"");
    let runs = run(
        &fmu,
        Interface::CoSimulation,
        &Batch { time: &time, outputs: vec!["count0"], ..Batch::default() },
    )
    .unwrap();
    assert!(
        runs.errors[0].1.contains("the next event is at t = 0.05 s, between two communication points"),
        "{:?}",
        runs.errors
    );
}

#[test]
fn each_type_of_clock() {
    let fmu = opened("", CONSTANT);
    let outputs = vec![
        "count1",
        "count2",
        "count3",
        "count4",
        "count5",
        "count6",
        "count7",
        "vector[2]",
        "hits",
        "timed",
    ];
    let time = [-0.2, 0.0, 0.9, 1.8];
    let mut batch = Batch { time: &time, outputs, events: true, ..Batch::default() };
    batch.inputs = vec![
        ("u", Trajectory::Constant(0.5)),
        ("period", Trajectory::Sampled { times: &[-0.2, 0.9], values: &[0.4, 0.25] }),
    ];
    batch.clocks = vec![("pressed", &[-0.15, 0.9, 1.0, 2.0])];
    let (found, events) = both(&fmu, &batch);
    let expect = |clock: &str, output: usize, expected: &[f64]| {
        let found = ticks(&events, clock, output);
        assert_eq!(found.len(), expected.len(), "{clock} {found:?}");
        for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
            close(found.0, *expected, 1e-15);
            assert_eq!(found.1, (k + 1) as f64, "{clock} {found:?}");
        }
    };
    // Shift 2/3 s, interval 1/3 s.
    expect("third", 0, &[2.0 / 3.0 - 0.2, 0.8, 4.0 / 3.0 - 0.2, 5.0 / 3.0 - 0.2, 1.8]);
    // Shift 0.2 s and interval 0.4 s until the parameter changes at 0.9 s. From there, the interval is 0.25 s.
    expect("tuned", 1, &[0.0, 0.4, 0.8, 1.15, 1.4, 1.65]);
    // Each interval is 0.1 s longer than the one before.
    expect("changing", 2, &[-0.1, 0.1, 0.4, 0.8, 1.3]);
    // The countdown of 0.25 s begins again at 1.0 s, before it has ended.
    expect("down", 3, &[0.1, 1.25]);
    expect("pressed", 4, &[-0.15, 0.9, 1.0]);
    // Every third tick from -0.2 s on, in steps of 0.1 s; the clock next follows in the same event.
    expect("out", 5, &[0.0, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8]);
    expect("next", 6, &[0.0, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8]);
    // Arrays, and the ticks that are at communication points.
    close(ticks(&events, "pressed", 7)[1].1, -0.55, 1e-9);
    assert_eq!([found[4][0].is_nan(), found[4][1].is_nan(), found[4][3].is_nan()], [true; 3]);
    assert_eq!([found[4][2], found[0][3]], [2.0, 5.0]);
    // x = 0.5 at 0.8 s, and the time event at 0.45 s.
    assert_eq!([&found[8], &found[9]], [&[0.0, 0.0, 1.0, 1.0], &[0.0, 0.0, 1.0, 1.0]]);
}

/// Events in Co-Simulation without clocks: early returns, announced events, and inputs that are not continuous.
#[test]
fn events_in_co_simulation() {
    let fmu = opened("", CONSTANT);
    let (time, n) = ([0.0, 0.3, 0.6, 1.0], [0.0, 0.0, 2.0, 2.0]);
    let mut batch =
        Batch { time: &time, outputs: vec!["x", "hits", "timed", "seen"], events: true, ..Batch::default() };
    batch.inputs = vec![("u", Trajectory::Constant(1.2)), ("n", Trajectory::Shared(&n))];
    let (found, events) = both(&fmu, &batch);
    let without_ticks: Vec<_> =
        events.iter().filter(|event| event.clocks.is_empty()).map(|event| event.time).collect();
    // The state event is where x = 0.5. At 0.6 s, the input changes, and a clock ticks, too.
    assert_eq!(without_ticks.len(), 2, "{without_ticks:?}");
    close(without_ticks[0], 0.5 / 1.2, 1e-9);
    assert_eq!(without_ticks[1], 0.45);
    assert_eq!(
        [&found[1], &found[2], &found[3]],
        [&[0.0, 0.0, 1.0, 1.0], &[0.0, 0.0, 1.0, 1.0], &[0.0, 0.0, 1.0, 1.0]]
    );
    close(found[0][3], 1.2, 1e-9);
    // A 64-bit integer among the inputs changes in Event Mode, too.
    let large = [Value::Integer(1), Value::Integer(1), Value::Integer(1), Value::Integer(1 << 60)];
    let inputs = vec![("u", Trajectory::Constant(1.2)), ("large", Trajectory::Values(&large))];
    let (changed, _) = both(&fmu, &Batch { inputs, ..batch.clone() });
    assert_eq!(changed[3], [1.0, 1.0, 1.0, 2.0]);
    // The same without clocks: such an FMU runs with event mode if events are requested, and otherwise without, as before.
    let fmu = opened("", NO_CLOCKS);
    let (unclocked, events) = both(&fmu, &batch);
    assert_eq!((unclocked, events.len()), (found, 3));
    let without = run(&fmu, Interface::CoSimulation, &Batch { events: false, ..batch.clone() }).unwrap();
    assert!(without.errors[0].1.contains("it cannot be set, or not here"), "{:?}", without.errors);
    // The outputs at 0.6 s are those after the event there, at which the input changes.
    let at = events.iter().find(|event| event.time == 0.6).unwrap();
    assert_eq!((at.before[3], at.after[3]), (0.0, 1.0));
}

#[test]
fn faulty_clocks_are_named() {
    let why = |traits: &str, tick: &str| {
        let fmu = opened(traits, tick);
        let time = [0.0, 0.25, 1.0];
        let found = INTERFACES.map(|interface| {
            let batch = Batch {
                time: &time,
                outputs: vec!["x"],
                clocks: vec![("pressed", &[0.1])],
                ..Batch::default()
            };
            match run(&fmu, interface, &batch) {
                Ok(runs) => runs.errors.first().map(|(_, why)| why.clone()).unwrap_or_default(),
                Err(error) => error.to_string(),
            }
        });
        found.map(|why| why.replace("Model Exchange: ", "").replace("Co-Simulation: ", ""))
    };
    for (traits, expected) in [
        ("tuned_zero", "clocks: tuned has the interval 0 s; it must be from 1e-18 s to 1e18 s"),
        (
            "tuned_unknown",
            "clocks: tuned has no interval (fmi3IntervalNotYetKnown), which only a countdown clock may lack",
        ),
        ("tuned_tiny", "clocks: tuned ticks without end: 1000 ticks from t = 0"),
        ("shift_negative", "clocks: tuned has the shift -1 s; it must be 0 or from 1e-18 s to 1e18 s"),
        ("changing_zero", "clocks: changing ticks without end: 1000 ticks from t = 0.3 s to t = 0.3 s"),
        ("changing_nan", "clocks: changing has the interval NaN s; it must be 0 or from 1e-18 s to 1e18 s"),
        ("changing_negative", "clocks: changing has the interval -0.1 s; it must be 0 or from"),
        ("resolution_zero", "clocks: third has the interval 1/0 s; it must be from 1e-18 s to 1e18 s"),
        ("qualifier_seven", "the qualifier of an interval is 7; it must be 0, 1 or 2"),
        ("endless", "the event does not end within 10000 iterations"),
        ("next_nan", "the time of the next event is NaN"),
    ] {
        for found in why(traits, CONSTANT) {
            assert!(found.contains(expected), "{traits}: {found}");
        }
    }
    let [found, _] = why("next_past", CONSTANT);
    assert!(found.contains("events without end: 1000 events from t = "), "{found}");
    let [found, _] = why("stuck", CONSTANT);
    assert!(found.contains("events without end: 1000 events from t = 0 s to t = 0 s"), "{found}");
    let [found, _] = why("last_nan", CONSTANT);
    assert!(found.contains("the FMU returned early, at NaN s"), "{found}");
    for (tick, expected) in [
        (
            "intervalVariability=\"constant\"",
            "the clock tick has no interval, although it is a constant clock",
        ),
        (
            "intervalVariability=\"constant\" intervalDecimal=\"0\"",
            "the clock tick must have an interval from 1e-18 s to 1e18 s",
        ),
        (
            "intervalVariability=\"constant\" intervalDecimal=\"NaN\"",
            "the clock tick must have an interval from 1e-18 s to 1e18 s",
        ),
        (
            "intervalVariability=\"constant\" supportsFraction=\"true\" intervalCounter=\"1\" resolution=\"0\"",
            "the clock tick must have an interval from 1e-18 s to 1e18 s",
        ),
        (
            "intervalVariability=\"constant\" intervalDecimal=\"1\" shiftDecimal=\"-1\"",
            "the clock tick must have a shift of 0 or from",
        ),
        ("", "the clock tick has no intervalVariability"),
    ] {
        for found in why("", tick) {
            assert!(found.contains(expected), "{tick}: {found}");
        }
    }
    // The FMU rejects the question for the interval. Because it logs no message, the run is repeated with logging on.
    for found in why("", "intervalVariability=\"fixed\"") {
        assert!(found.ends_with("the shift is declared, or a fraction"), "{found}");
    }
    let [found, _] = why("", "intervalVariability=\"constant\" intervalDecimal=\"0.1\" clocks=\"77\"");
    assert_eq!(found, "modelDescription.xml: tick has the clock 77, which does not exist");
    // A clock that never ticks is not an error.
    assert_eq!(
        why("", "intervalVariability=\"constant\" intervalDecimal=\"1e18\" shiftDecimal=\"1e18\""),
        ["", ""]
    );
}

#[test]
fn each_run_has_its_own_ticks() {
    let (fmu, time) = (opened("", CONSTANT), [0.0, 0.1, 0.2]);
    let mut batch =
        Batch { time: &time, outputs: vec!["sum"], hold: true, threads: Some(2), ..Batch::default() };
    batch.inputs = vec![("sample", Trajectory::EachRun(&[1.0, 2.0, 3.0, 10.0, 20.0, 30.0]))];
    for interface in INTERFACES {
        let runs = run(&fmu, interface, &batch).unwrap();
        let [_, _, sum] = runs.trajectories[..3] else { panic!("{runs:?}") };
        assert_eq!((sum, &runs.trajectories[3..]), (6.0, &[10.0, 30.0, 60.0][..]));
        assert_eq!(runs.errors, []);
    }
}

#[test]
fn a_run_ends_at_a_tick() {
    for interface in INTERFACES {
        let batch = Batch {
            time: &[0.0, 0.2, 0.5, 1.0],
            outputs: vec!["x", "count0"],
            events: true,
            ..Batch::default()
        };
        let batch = Batch { inputs: vec![("u", Trajectory::Constant(1.0))], ..batch };
        let watch = Watch::default();
        let fmu = opened("ends", CONSTANT);
        let runs = fmu.run(&Batch { interface: Some(interface), every: Some(1), ..batch }, &watch).unwrap();
        assert_eq!(runs.errors, [(0, "ended by the FMU at t = 0.3 s".to_owned())]);
        // The event that ends the run is not complete.
        assert!(
            runs.events.iter().all(|event| event.time < 0.3 && event.after.len() == 2),
            "{:?}",
            runs.events
        );
        close(watch.ended()[0].2[0], 0.3, 1e-9);
        assert_eq!(watch.ended()[0].2[1], 4.0);
        assert_eq!((runs.trajectories[5], runs.trajectories[6].is_nan()), (3.0, true));
    }
}

#[test]
fn requests_are_checked() {
    let why = |co_simulation: &str, change: &dyn Fn(&mut Batch<'_>)| {
        let fmu = opened_with("", CONSTANT, co_simulation);
        let mut batch = Batch { time: &[0.0, 1.0], outputs: vec!["x"], ..Batch::default() };
        change(&mut batch);
        run(&fmu, Interface::CoSimulation, &batch).unwrap_err().to_string()
    };
    assert_eq!(
        why("", &|_| ()),
        "tick is a clock, but in Co-Simulation clocks has no event mode (hasEventMode), which clocks need"
    );
    assert_eq!(
        why(EVENTS, &|batch| batch.clocks = vec![("tick", &[])]),
        "tick is not a triggered input clock"
    );
    assert_eq!(
        why(EVENTS, &|batch| batch.clocks = vec![("pressed", &[]); 2]),
        "pressed is twice among the clocks"
    );
    for times in [&[0.2, 0.1][..], &[f64::NAN], &[-0.1]] {
        let found = why(EVENTS, &|batch| batch.clocks = vec![("pressed", times)]);
        assert_eq!(
            found,
            "the times of pressed must be finite, increase and not be before the first communication point"
        );
    }
    assert!(
        why(EVENTS, &|batch| batch.read_before_set = true)
            .starts_with("read_before_set is not for runs with events")
    );
    assert!(
        why(EVENTS, &|batch| batch.outputs = vec!["tick"])
            .starts_with("tick is a clock; only the function run")
    );
    let fmu = opened_with("", NO_CLOCKS, "");
    let unclocked = |batch: &Batch<'_>| {
        run(&fmu, Interface::CoSimulation, &Batch { time: &[0.0, 1.0], outputs: vec!["x"], ..batch.clone() })
            .unwrap_err()
            .to_string()
    };
    let found = unclocked(&Batch { events: true, ..Batch::default() });
    assert!(
        found.contains("in Co-Simulation for a single FMU that has event mode (hasEventMode of FMI 3.0)"),
        "{found}"
    );
    let found = unclocked(&Batch { hold: true, ..Batch::default() });
    assert_eq!(found, "hold is for outputs that have clocks, and clocks has no clocks");
    assert_eq!(
        why(EVENTS, &|batch| {
            batch.outputs = vec!["sum"];
            batch.measures = vec![fmu_run::Measure::Max];
        }),
        "sum has a value only while its clock ticks, so it has no measures"
    );
    assert!(
        why(EVENTS, &|batch| batch.inputs = vec![("sum", Trajectory::Constant(1.0))])
            .starts_with("sum is not an input")
    );
}
