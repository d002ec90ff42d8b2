//! Systems of FMUs: messages about wrong connections, and the files of correct systems.

use fmi_abi::write::zip;
use fmu_run::SystemStructure;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use zip::ZipArchive;

const UNITS: &str = r#"<UnitDefinitions><Unit name="rad"><BaseUnit rad="1"/></Unit><Unit name="s"><BaseUnit s="1"/></Unit></UnitDefinitions>
<TypeDefinitions><SimpleType name="Angle"><Real unit="rad"/></SimpleType>
<SimpleType name="Gear"><Enumeration><Item name="Neutral" value="0"/><Item name="Drive" value="3"/></Enumeration></SimpleType>
<SimpleType name="Other"><Enumeration><Item name="Neutral" value="1"/></Enumeration></SimpleType></TypeDefinitions>"#;

/// Writes an FMU that contains only this model description.
fn packed(path: PathBuf, description: &str) -> PathBuf {
    let entries = [("modelDescription.xml".to_owned(), description.into())];
    fs::write(&path, zip(&entries).unwrap()).unwrap();
    path
}

fn entries(path: &Path) -> Vec<String> {
    let zip = ZipArchive::new(fs::File::open(path).unwrap()).unwrap();
    zip.file_names().map(|name| name.unwrap().into_owned()).collect()
}

fn entry(path: &Path, name: &str) -> String {
    let mut zip = ZipArchive::new(fs::File::open(path).unwrap()).unwrap();
    let mut text = String::new();
    zip.by_name(name).unwrap().read_to_string(&mut text).unwrap();
    text
}

fn fmu(directory: &Path, name: &str, variables: &str) -> PathBuf {
    let text = format!(
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"g\"><CoSimulation modelIdentifier=\"m\"/>{UNITS}\
         <ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
    );
    packed(directory.join(name), &text)
}

fn variable(name: &str, causality: &str, kind: &str) -> String {
    let start = if causality == "output" { "" } else { r#" start="0""# };
    format!(
        r#"<ScalarVariable name="{name}" valueReference="0" causality="{causality}"><{kind}{start}/></ScalarVariable>"#
    )
}

/// Returns two FMUs. Some angles have their unit at the variable, others at the declared type.
fn fmus(directory: &Path) -> Vec<(&'static str, PathBuf)> {
    let plant = [
        variable("u", "input", r#"Real unit="rad""#),
        variable("y", "output", r#"Real declaredType="Angle""#),
        variable("delay", "output", r#"Real unit="s""#),
        variable("bare", "output", "Real"),
        variable("angle", "output", r#"Real start="0" min="-1" declaredType="Angle""#),
        variable("on", "parameter", "Boolean"),
        variable("count", "parameter", r#"Integer max="9""#),
        variable("gear", "parameter", r#"Enumeration declaredType="Gear""#),
        variable("gear_now", "output", r#"Enumeration declaredType="Gear""#),
        variable("note", "parameter", "String"),
    ];
    let law = [
        variable("r", "input", r#"Real unit="rad""#),
        variable("y", "input", r#"Real declaredType="Angle""#),
        variable("n", "input", "Integer"),
        variable("bare", "input", "Real"),
        variable("gear", "input", r#"Enumeration declaredType="Gear""#),
        variable("other_gear", "input", r#"Enumeration declaredType="Other""#),
        variable("u", "output", r#"Real unit="rad""#),
    ];
    vec![
        ("law", fmu(directory, "law.fmu", &law.concat())),
        ("plant", fmu(directory, "plant.fmu", &plant.concat())),
    ]
}

fn system<'a>(directory: &Path) -> SystemStructure<'a> {
    SystemStructure {
        name: "loop",
        description: "A loop",
        components: fmus(directory),
        inputs: vec![("reference", "law.r", "0.5".into())],
        outputs: vec![("angle", "plant.y")],
        connections: vec![("law.u", "plant.u"), ("plant.y", "law.y")],
        start: vec![("plant.on", "true".into())],
        stop_time: 2.0,
        step_size: 0.001,
    }
}

#[test]
fn wrong_systems_are_rejected() {
    let directory = tempfile::tempdir().unwrap();
    let rejection = |change: fn(&mut SystemStructure)| {
        let mut system = system(directory.path());
        change(&mut system);
        format!("{:#}", system.check().err().expect("a wrong system must be rejected"))
    };
    for (change, message) in [
        (
            (|s| s.connections.push(("plant.y", "law.x"))) as fn(&mut SystemStructure),
            "no FMU has a variable law.x",
        ),
        (|s| s.connections.push(("plant.u", "law.y")), "plant.u is input, not output"),
        (
            |s| s.connections[0] = ("plant.u", "law.u"),
            "the connection from plant.u to law.u is reversed: law.u is the output, and plant.u the input that it feeds",
        ),
        (
            |s| s.connections.push(("plant.delay", "law.r")),
            "plant.delay cannot feed law.r: the output is in s, the input in rad",
        ),
        (
            |s| s.connections.push(("plant.y", "law.n")),
            "plant.y cannot feed law.n: the output is Real, the input Integer",
        ),
        (|s| s.connections.push(("plant.y", "law.r")), "law.r is fed twice"),
        (|s| s.outputs.push(("x", "plant.on")), "plant.on is parameter, not output"),
        (
            |s| s.start.push(("plant.y", "0".into())),
            "plant.y is read-only: it is calculated by the FMU and has no start value",
        ),
        (
            |s| s.start.push(("plant.angle", "-2".into())),
            "the start value of plant.angle must not be below -1, it is -2",
        ),
        (
            |s| s.start.push(("plant.count", "10".into())),
            "the start value of plant.count must not be above 9, it is 10",
        ),
        (
            |s| s.start.push(("plant.on", "no".into())),
            "plant.on is a Boolean, its start value cannot be \"no\"",
        ),
        (|s| s.inputs[0].2 = "far".into(), "law.r is a number, its start value cannot be \"far\""),
        (
            |s| s.start.push(("plant.gear", "Fast".into())),
            "plant.gear is one of Neutral, Drive, its start value cannot be \"Fast\"",
        ),
        (
            |s| s.connections.push(("plant.gear_now", "law.other_gear")),
            "plant.gear_now cannot feed law.other_gear: their enumerations have different items",
        ),
        (|s| s.components[0].1 = "none.fmu".into(), "none.fmu is not a usable FMU: it cannot be read"),
        (|s| s.inputs[0].2 = "NaN".into(), "the start value of law.r must be a finite number, it is NaN"),
        (
            |s| s.start.push(("plant.u", "inf".into())),
            "the start value of plant.u must be a finite number, it is inf",
        ),
        (|s| s.stop_time = f64::INFINITY, "the stop time must be finite and > 0, it is inf"),
        (|s| s.step_size = 0.0, "the step size must be finite and > 0, it is 0"),
        (|s| s.components[1].0 = "law", "two components are named law"),
        (
            |s| s.components[1].0 = "a.plant",
            "'a.plant' cannot name a component, because it is empty or has a dot or slash in it",
        ),
    ] {
        assert_eq!(rejection(change).split(": No such file").next(), Some(message));
    }
    // An output with a start value accepts another start value.
    let mut other_start = system(directory.path());
    other_start.start.push(("plant.angle", "0.5".into()));
    other_start.check().unwrap();
    // An undeclared unit fits any unit.
    let mut without_unit = system(directory.path());
    without_unit.connections[1].0 = "plant.bare";
    without_unit.check().unwrap();
    // FMI 2.0 has the same functions for integers and enumerations.
    without_unit.connections.push(("plant.gear_now", "law.n"));
    without_unit.check().unwrap();
}

#[test]
fn the_ssp_is_complete_and_reproducible() {
    let directory = tempfile::tempdir().unwrap();
    let system = system(directory.path());
    let checked = system.check().unwrap();
    let (one, other) = (directory.path().join("one.ssp"), directory.path().join("other.ssp"));
    checked.write_ssp(&one).unwrap();
    system.check().unwrap().write_ssp(&other).unwrap();
    assert!(fs::read(&one).unwrap() == fs::read(&other).unwrap());

    assert_eq!(
        entries(&one),
        [
            "SystemStructure.ssd",
            "resources/experiment.ssv",
            "resources/law.fmu",
            "resources/plant.fmu",
            "resources/plant.ssv"
        ]
    );
    let ssd = entry(&one, "SystemStructure.ssd");
    for part in [
        r#"<ssd:Component name="law" type="application/x-fmu-sharedlibrary" source="resources/law.fmu">"#,
        r#"<ssd:Connection startConnector="reference" endElement="law" endConnector="r"/>"#,
        r#"<ssd:Connection startElement="law" startConnector="u" endElement="plant" endConnector="u"/>"#,
        r#"<ssd:Connection startElement="plant" startConnector="y" endConnector="angle"/>"#,
        r#"<ssd:DefaultExperiment startTime="0" stopTime="2"/>"#,
    ] {
        assert_eq!(ssd.matches(part).count(), 1, "{part}\n{ssd}");
    }
    // The annotation for OMSimulator is the last element of the system.
    let annotations: String = ssd.lines().map(str::trim).collect();
    let last = r#"<oms:SimulationInformation><oms:FixedStepMaster description="oms-ma" stepSize="0.001" absoluteTolerance="0.0001" relativeTolerance="0.0001"/></oms:SimulationInformation></oms:Annotations></ssc:Annotation></ssd:Annotations></ssd:System>"#;
    assert!(annotations.contains(last), "{ssd}");
    // Only the units in use are defined.
    assert!(ssd.contains(r#"<ssc:Unit name="rad">"#) && !ssd.contains(r#"<ssc:Unit name="s">"#), "{ssd}");
    assert!(entry(&one, "resources/plant.ssv").contains(r#"<ssv:Boolean value="true"/>"#));
    assert!(entry(&one, "resources/experiment.ssv").contains(r#"<ssv:Real value="0.5" unit="rad"/>"#));
}

/// A connector names a unit only if the file defines it, also if the other end of the connection has no unit.
#[test]
fn the_units_of_all_connectors_are_defined() {
    let directory = tempfile::tempdir().unwrap();
    let mut bare = system(directory.path());
    bare.connections.push(("plant.delay", "law.bare"));
    let ssp = directory.path().join("bare.ssp");
    bare.check().unwrap().write_ssp(&ssp).unwrap();
    let ssd = entry(&ssp, "SystemStructure.ssd");
    assert!(ssd.contains(r#"<ssc:Real unit="s"/>"#) && ssd.contains(r#"<ssc:Unit name="s">"#), "{ssd}");
}

/// The schema does not allow an empty list of connectors.
#[test]
fn a_component_that_is_not_connected_has_no_connectors() {
    let directory = tempfile::tempdir().unwrap();
    let mut unconnected = system(directory.path());
    (unconnected.inputs, unconnected.outputs, unconnected.connections) = (Vec::new(), Vec::new(), Vec::new());
    let ssp = directory.path().join("unconnected.ssp");
    unconnected.check().unwrap().write_ssp(&ssp).unwrap();
    let ssd = entry(&ssp, "SystemStructure.ssd");
    assert!(!ssd.contains("ssd:Connectors") && !ssd.contains("ssd:Connections"), "{ssd}");
}

/// SSP 1.0 has only Real and Integer for the number types of FMI 3.0.
#[test]
fn fmus_for_fmi_3_are_connected_too() {
    let directory = tempfile::tempdir().unwrap();
    let text = r#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
        <CoSimulation modelIdentifier="m"/><UnitDefinitions><Unit name="rad"><BaseUnit rad="1"/></Unit></UnitDefinitions>
        <TypeDefinitions><Float64Type name="Angle" unit="rad" max="3"/></TypeDefinitions><ModelVariables>
        <Float64 name="u" valueReference="1" causality="input" declaredType="Angle" start="0"/>
        <Int16 name="n" valueReference="2" causality="parameter" start="0"/>
        <Float64 name="y" valueReference="3" causality="output" declaredType="Angle"/></ModelVariables></fmiModelDescription>"#;
    let mut new = system(directory.path());
    new.components.push(("new", packed(directory.path().join("new.fmu"), text)));
    new.connections.push(("law.u", "new.u"));
    new.start.push(("new.n", "7".into()));
    let ssp = directory.path().join("new.ssp");
    new.check().unwrap().write_ssp(&ssp).unwrap();
    let ssv = entry(&ssp, "resources/new.ssv");
    assert!(ssv.contains(r#"<ssv:Integer value="7"/>"#), "{ssv}");
    for (start, message) in [
        (("new.u", "4"), "the start value of new.u must not be above 3, it is 4"),
        (("new.n", "40000"), "the start value of new.n must not be above 32767, it is 40000"),
    ] {
        new.start = vec![(start.0, start.1.into())];
        assert_eq!(new.check().err().unwrap().to_string(), message);
    }
}

#[test]
fn the_directory_for_libcosim_has_the_fmus_and_the_start_values() {
    let directory = tempfile::tempdir().unwrap();
    let mut system = system(directory.path());
    system.start = vec![("plant.on", "1".into())];
    let out = directory.path().join("osp");
    system.check().unwrap().write_osp(&out).unwrap();
    let text = fs::read_to_string(out.join("OspSystemStructure.xml")).unwrap();
    for part in [
        "<BaseStepSize>0.001</BaseStepSize>",
        r#"<Simulator name="law" source="law.fmu">"#,
        r#"<InitialValue variable="r">"#,
        r#"<Boolean value="true"/>"#,
        r#"<Variable simulator="plant" name="y"/>"#,
    ] {
        assert_eq!(text.matches(part).count(), 1, "{part}\n{text}");
    }
    for name in ["law.fmu", "plant.fmu"] {
        assert_eq!(fs::read(out.join(name)).unwrap(), fs::read(directory.path().join(name)).unwrap());
    }
}

/// Returns a system of two plants in series.
fn twins<'a>(components: Vec<(&'a str, PathBuf)>) -> SystemStructure<'a> {
    SystemStructure {
        name: "twins",
        description: "Two of a kind",
        components,
        inputs: vec![("u", "one.u", "0".into())],
        outputs: vec![("y", "other.y")],
        connections: vec![("one.y", "other.u")],
        start: vec![("one.on", "true".into()), ("other.on", "false".into())],
        stop_time: 1.0,
        step_size: 0.1,
    }
}

#[test]
fn two_instances_of_one_fmu_share_its_file() {
    let directory = tempfile::tempdir().unwrap();
    let plant = fmus(directory.path()).remove(1).1;
    let system = twins(vec![("one", plant.clone()), ("other", plant)]);
    let checked = system.check().unwrap();
    let ssp = directory.path().join("twins.ssp");
    checked.write_ssp(&ssp).unwrap();
    let expected =
        ["experiment.ssv", "one.ssv", "other.ssv", "plant.fmu"].map(|name| format!("resources/{name}"));
    assert_eq!(entries(&ssp)[1..], expected);
    let ssd = entry(&ssp, "SystemStructure.ssd");
    assert_eq!(ssd.matches(r#"source="resources/plant.fmu""#).count(), 2, "{ssd}");

    let osp = directory.path().join("osp");
    checked.write_osp(&osp).unwrap();
    assert_eq!(fs::read_dir(&osp).unwrap().count(), 2);
    let text = fs::read_to_string(osp.join("OspSystemStructure.xml")).unwrap();
    assert_eq!(text.matches(r#"source="plant.fmu""#).count(), 2, "{text}");
}

#[test]
fn different_fmus_with_the_same_file_name_are_named() {
    let directory = tempfile::tempdir().unwrap();
    let plant = fmus(directory.path()).remove(1).1;
    let elsewhere = directory.path().join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    let signals = [
        variable("u", "input", "Real"),
        variable("y", "output", "Real"),
        variable("on", "parameter", "Boolean"),
    ];
    let other = fmu(&elsewhere, "plant.fmu", &signals.concat());
    let message = format!(
        "{} and {} are different and have the same file name; rename one of them",
        plant.display(),
        other.display()
    );
    let error = twins(vec![("one", plant), ("other", other)]).check().err().unwrap();
    assert_eq!(error.to_string(), message);
}

#[test]
fn enumerations_and_strings_are_written() {
    let directory = tempfile::tempdir().unwrap();
    let mut system = system(directory.path());
    system.connections.push(("plant.gear_now", "law.gear"));
    system.start = vec![("plant.gear", "Drive".into()), ("plant.note", "a < b".into())];
    let checked = system.check().unwrap();
    let (ssp, osp) = (directory.path().join("loop.ssp"), directory.path().join("osp"));
    checked.write_ssp(&ssp).unwrap();
    let (ssd, ssv) = (entry(&ssp, "SystemStructure.ssd"), entry(&ssp, "resources/plant.ssv"));
    assert_eq!(ssd.matches(r#"<ssc:Enumeration name="Gear"/>"#).count(), 2, "{ssd}");
    assert_eq!(ssd.matches(r#"<ssc:Enumeration name="Gear">"#).count(), 1, "{ssd}");
    assert!(ssd.contains(r#"<ssc:Item name="Drive" value="3"/>"#) && !ssd.contains("Other"), "{ssd}");
    assert!(ssv.contains(r#"<ssv:Enumeration value="Drive"/>"#), "{ssv}");
    assert!(ssv.contains(r#"<ssv:String value="a &lt; b"/>"#), "{ssv}");

    checked.write_osp(&osp).unwrap();
    let text = fs::read_to_string(osp.join("OspSystemStructure.xml")).unwrap();
    assert!(
        text.contains(r#"<Integer value="3"/>"#) && text.contains(r#"<String value="a &lt; b"/>"#),
        "{text}"
    );
}
