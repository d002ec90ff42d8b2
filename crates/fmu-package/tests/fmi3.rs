//! The description for FMI 3.0: every kind of variable, what only FMI 3.0 asks for, the structure.

mod common;

use common::{fmi2, fmi3};
use fmu_export::fmi3::{independent, indicator, reference};
use fmu_export::*;
use fmu_package::structure::DependencyKind::{Constant, Dependent};
use fmu_package::structure::{ModelStructure, Unknown};
use fmu_package::{Changes, Terminal, terminals};
use std::fs;
use std::path::Path;

enumeration! {
    /// What the heater does.
    pub enum Heater {
        /// Nothing
        Off = 0,
        /// Warms <gently>
        Low = 2,
    }
}

const HEATER: Type = Type::enumeration("Heater", <Heater as Enumeration>::ITEMS);
const CELSIUS: Unit = Unit::new("degC").K(1).offset(273.15).display("degF", 1.8, 32.0);
const TEMPERATURE: Type = Type::real("Temperature", &CELSIUS).nominal(20.0).min(-273.15);
const SINGLE: Type = Type::float32("Single", &units::ONE).max(0.1);
const BYTE: Type = Type::whole("Byte", BaseType::UInt8).max_integer(200);
const SMALL: Type = Type::whole("", BaseType::Int8);
const SHORT: Type = Type::whole("", BaseType::Int16);
const PORT: Type = Type::whole("", BaseType::UInt16);
const COUNT: Type = Type::whole("", BaseType::UInt32);
const LONG: Type = Type::whole("", BaseType::Int64);
const HUGE: Type = Type::whole("Huge", BaseType::UInt64).min_integer(1);
const PICTURE: Type = Type::binary("Picture", "image/png").max_size(4);

#[derive(Clone)]
struct Room {
    time: f64,
    outside: f64,
    temperature: f64,
    gain: f64,
    single: f32,
    small: i8,
    byte: u8,
    short: i16,
    port: u16,
    whole: i32,
    count: u32,
    long: i64,
    huge: u64,
    open: bool,
    label: String,
    picture: Vec<u8>,
    heater: Heater,
}

variables! { for Room;
    /// Outside temperature
    outside = input(&TEMPERATURE) in outside;
    /// Temperature
    temperature = output(&TEMPERATURE).state().reinit() in temperature;
    /// Its rate
    rate as "der(temperature)" = local(&NUMBER).derivative_of(temperature)
        by |room| room.gain * (room.outside - room.temperature);
    /// Sine of the time
    wave = output(&NUMBER) by |room| room.time.sin();
    /// Gain
    gain = parameter(&NUMBER) in gain;
    /// Single precision
    single = input(&SINGLE) in single;
    /// Twice that
    double = output(&SINGLE) by |room| 2.0 * room.single;
    /// Eight bits
    small = parameter(&SMALL) in small;
    /// Eight bits without sign
    byte = input(&BYTE) in byte;
    /// Sixteen bits
    short = parameter(&SHORT) in short;
    /// Sixteen bits without sign
    port = parameter(&PORT).tunable() in port;
    /// 32 bits
    whole = parameter(&INTEGER) in whole;
    /// 32 bits without sign
    count = output(&COUNT).exact() in count;
    /// 64 bits
    long = parameter(&LONG) in long;
    /// 64 bits without sign
    huge = parameter(&HUGE) in huge;
    /// Whether the window is open
    open = input(&BOOLEAN) in open;
    /// What stands on the door
    label = parameter(&STRING) in label;
    /// What hangs on the wall
    picture = input(&PICTURE) in picture;
    /// What hangs there now
    seen = output(&PICTURE) by |room| room.picture.clone();
    /// What the heater does
    heater = input(&HEATER) in heater;
    /// Version of the room
    version = output(&INTEGER).constant() by |_| 7;
}

impl Model for Room {
    const INFO: Info = Info { smooth: true, ..Info::new("Room", "room", "{room}") };

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self {
            time: 0.0,
            outside: 10.0,
            temperature: 20.0,
            gain: 0.5,
            single: 0.1,
            small: -128,
            byte: 3,
            short: -5,
            port: 65535,
            whole: -7,
            count: 4_000_000_000,
            long: i64::MIN,
            huge: u64::MAX,
            open: true,
            label: "a \"b\"\n< c".into(),
            picture: vec![0, 0xAB],
            heater: Heater::Low,
        })
    }

    fn calculate(&mut self, time: f64) {
        self.time = time;
    }
}

impl ModelExchange for Room {
    const INDICATORS: usize = 2;
    const STEP_COMPLETED: bool = true;

    fn indicators(&self, indicators: &mut [f64]) {
        indicators.fill(0.0);
    }
}

impl CoSimulation for Room {
    const EVENTS: Events = Events::Stop;

    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        Ok(Stepped::Done)
    }
}

impl OutputDerivatives for Room {
    const HIGHEST: u32 = 2;

    fn output_derivative(&self, _: Name, _: u32) -> f64 {
        0.0
    }
}

offer!(Room: ModelExchange + CoSimulation + OutputDerivatives);

fn text() -> String {
    fmi3::describe::<Room>(&Changes::default()).unwrap()
}

#[track_caller]
fn has(text: &str, part: &str) {
    assert_eq!(text.matches(part).count(), 1, "{part}\n is not once in\n{text}");
}

#[test]
fn every_kind_of_variable_is_described() {
    // What fmi-sim 0.7 does not read at a variable is in the types only.
    let text = text();
    // For validators that are not in Rust.
    fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join("room-fmi3.xml"), &text).unwrap();
    for part in [
        "<fmiModelDescription\n  fmiVersion=\"3.0\"\n  modelName=\"Room\"\n  instantiationToken=\"{room}\"\n",
        r#"  <ModelExchange modelIdentifier="room" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="false" providesAdjointDerivatives="false" needsCompletedIntegratorStep="true"/>"#,
        r#"  <CoSimulation modelIdentifier="room" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="false" providesAdjointDerivatives="false" canHandleVariableCommunicationStepSize="true" maxOutputDerivativeOrder="2" providesIntermediateUpdate="false" canReturnEarlyAfterIntermediateUpdate="false" mightReturnEarlyFromDoStep="true" hasEventMode="true"/>"#,
        r#"
    <Unit name="degC">
      <BaseUnit K="1" offset="273.15"/>
      <DisplayUnit name="degF" factor="1.8" offset="32"/>
    </Unit>"#,
        r#"
  <TypeDefinitions>
    <Float64Type name="Temperature" quantity="Temperature" unit="degC" displayUnit="degF" min="-273.15" nominal="20"/>
    <Float64Type name="Number" quantity="Number" unit="1"/>
    <Float32Type name="Single" quantity="Single" unit="1" max="0.1"/>
    <UInt8Type name="Byte" max="200"/>
    <UInt64Type name="Huge" min="1"/>
    <BinaryType name="Picture"/>
    <EnumerationType name="Heater">
      <Item name="Off" value="0" description="Nothing"/>
      <Item name="Low" value="2" description="Warms &lt;gently&gt;"/>
    </EnumerationType>
  </TypeDefinitions>
"#,
        r#"    <Category name="logStatusWarning""#,
        r#"  <DefaultExperiment startTime="0" stopTime="1" tolerance="0.000001" stepSize="0.001"/>"#,
        r#"
    <Float64 name="outside" valueReference="1" description="Outside temperature" causality="input" variability="continuous" declaredType="Temperature" start="10" min="-273.15"/>
    <Float64 name="temperature" valueReference="2" description="Temperature" causality="output" variability="continuous" initial="exact" declaredType="Temperature" start="20" reinit="true" min="-273.15"/>"#,
        r#"
    <Float64 name="der(temperature)" valueReference="3" description="Its rate" causality="local" variability="continuous" initial="calculated" declaredType="Number" derivative="2"/>"#,
        r#"<Float32 name="single" valueReference="6" description="Single precision" causality="input" variability="continuous" declaredType="Single" start="0.1" max="0.1"/>"#,
        r#"<Int8 name="small" valueReference="8" description="Eight bits" causality="parameter" variability="fixed" initial="exact" start="-128"/>"#,
        r#"causality="input" variability="discrete" declaredType="Byte" start="3" max="200"/>"#,
        r#"<Int16 name="short" valueReference="10" description="Sixteen bits" causality="parameter" variability="fixed" initial="exact" start="-5"/>"#,
        r#"causality="parameter" variability="tunable" initial="exact" start="65535"/>"#,
        r#"<Int32 name="whole" valueReference="12" description="32 bits" causality="parameter" variability="fixed" initial="exact" start="-7"/>"#,
        r#"causality="output" variability="discrete" initial="exact" start="4000000000"/>"#,
        r#"start="-9223372036854775808"/>"#,
        r#"declaredType="Huge" start="18446744073709551615" min="1"/>"#,
        r#"<Boolean name="open" valueReference="16" description="Whether the window is open" causality="input" variability="discrete" start="true"/>"#,
        r#"causality="parameter" variability="fixed" initial="exact">
      <Start value="a &quot;b&quot;&#10;&lt; c"/>
    </String>"#,
        r#"declaredType="Picture" mimeType="image/png" maxSize="4">
      <Start value="00AB"/>
    </Binary>"#,
        r#"initial="calculated" declaredType="Picture" mimeType="image/png" maxSize="4"/>"#,
        r#"<Enumeration name="heater" valueReference="20" description="What the heater does" causality="input" variability="discrete" declaredType="Heater" start="2"/>"#,
        r#"causality="output" variability="constant" initial="exact" start="7"/>"#,
        // What is not in the table.
        r#"
    <Float64 name="time" valueReference="22" description="Simulation time" causality="independent" variability="continuous"/>
    <Float64 name="eventIndicator[1]" valueReference="23" description="An event happens where it changes its sign" causality="local" variability="continuous" initial="calculated"/>
    <Float64 name="eventIndicator[2]" valueReference="24" description="An event happens where it changes its sign" causality="local" variability="continuous" initial="calculated"/>
  </ModelVariables>"#,
        r#"
  <ModelStructure>
    <Output valueReference="2" dependencies="2" dependenciesKind="constant"/>
    <Output valueReference="4" dependencies="17 18 22" dependenciesKind="dependent dependent dependent"/>"#,
        r#"
    <ContinuousStateDerivative valueReference="3" dependencies="1 2 5 17 18" dependenciesKind="dependent dependent dependent dependent dependent"/>
    <InitialUnknown valueReference="3" "#,
        r#"
    <EventIndicator valueReference="23"/>
    <EventIndicator valueReference="24"/>
  </ModelStructure>"#,
    ] {
        has(&text, part);
    }
    assert_eq!(text, self::text(), "made twice");
    let references = [independent::<Room>().0, indicator::<Room>(1)].map(reference);
    assert_eq!(references, [22, 24]);
}

/// Parameters and the time are among what outputs depend on.
#[test]
fn every_output_has_its_dependencies() {
    let of = |list: &[Unknown], name: Name| {
        let is_text = |vr: u32| [Name::label as u32, Name::picture as u32].contains(&vr);
        let unknown = list.iter().find(|unknown| unknown.vr == name as u32).unwrap();
        let tried = unknown.dependencies.iter().filter(|(known, _)| !is_text(*known));
        tried.copied().collect::<Vec<_>>()
    };
    let structure = ModelStructure::of_fmi3(&common::model::<Room>(), false).unwrap();
    let place = |name: Name| name as u32;
    let time = independent::<Room>().0;
    assert_eq!(of(&structure.outputs, Name::temperature), [(place(Name::temperature), Constant)]);
    assert_eq!(of(&structure.outputs, Name::wave), [(time, Dependent)]);
    assert_eq!(of(&structure.outputs, Name::double), [(place(Name::single), Dependent)]);
    assert_eq!(of(&structure.outputs, Name::version), []);
    let rate = [Name::outside, Name::temperature, Name::gain].map(|name| (place(name), Dependent));
    assert_eq!(of(&structure.derivatives, Name::rate), rate);
    assert_eq!(of(&structure.initial_unknowns, Name::wave), [(time, Dependent)]);

    // FMI 2.0 has neither.
    let structure = common::structure::<Room>(false).unwrap();
    assert_eq!(of(&structure.outputs, Name::wave), []);
    assert_eq!(of(&structure.derivatives, Name::rate), rate[..2]);
}

#[test]
fn fmi_2_refuses_what_it_lacks_by_name() {
    let error = fmi2::describe::<Room>(&Changes::default()).unwrap_err().to_string();
    assert!(error.starts_with("single is Float32, which FMI 2.0 lacks; add --fmi 3"), "{error}");
}

/// Models whose steps always reach their end, may end early, or stop at events.
macro_rules! steps {
    ($($case:ident: $($fact:ident: $type:ty = $value:expr)?;)+) => { $(
        mod $case {
            use super::*;

            #[derive(Clone)]
            pub struct Steps {
                u: f64,
            }

            variables! { for Steps;
                /// Input
                u = input(&NUMBER) in u;
            }

            impl Model for Steps {
                const INFO: Info = Info::new("Steps", "steps", "{steps}");

                fn new(_: &Setup) -> Result<Self, Error> {
                    Ok(Self { u: 0.0 })
                }
            }

            impl CoSimulation for Steps {
                $(const $fact: $type = $value;)?

                fn step(&mut self, _: Step) -> Result<Stepped, Error> {
                    Ok(Stepped::Done)
                }
            }

            impl ModelExchange for Steps {}

            offer!(Steps: CoSimulation + ModelExchange);
        }
    )+ };
}

steps! {
    whole:;
    early: ENDS_EARLY: bool = true;
    eventful: EVENTS: Events = Events::StopIfHandled;
}

#[test]
fn whether_steps_end_early_is_told() {
    let says = |text: anyhow::Result<String>, early: bool, events: bool| {
        let part = format!("mightReturnEarlyFromDoStep=\"{early}\" hasEventMode=\"{events}\"");
        has(&text.unwrap(), &part);
    };
    says(fmi3::describe::<whole::Steps>(&Changes::default()), false, false);
    says(fmi3::describe::<early::Steps>(&Changes::default()), true, false);
    says(fmi3::describe::<eventful::Steps>(&Changes::default()), true, true);
}

/// A model with a time of its own, or something else of that name.
macro_rules! clocks {
    ($($case:ident: { $($table:tt)+ })+) => { $(
        mod $case {
            use super::*;

            #[derive(Clone)]
            pub struct Clock {
                pub u: f64,
            }

            variables! { for Clock; $($table)+ }

            impl Model for Clock {
                const INFO: Info = Info::new("Clock", "clock", "{clock}");

                fn new(_: &Setup) -> Result<Self, Error> {
                    Ok(Self { u: 0.0 })
                }
            }

            impl ModelExchange for Clock {
                const INDICATORS: usize = 1;

                fn indicators(&self, indicators: &mut [f64]) {
                    indicators.fill(0.0);
                }
            }

            offer!(Clock: ModelExchange);
        }
    )+ };
}

clocks! {
    with_time: {
        /// Input
        u = input(&NUMBER) in u;
        /// Time
        t = independent(&TIME);
        /// Output
        y = output(&NUMBER).depends_on(&[u]) by |clock| clock.u;
    }
    without_time: {
        /// Input
        u = input(&NUMBER) in u;
        /// Output
        y = output(&NUMBER).depends_on(&[u]) by |clock| clock.u;
        /// Output
        z = output(&NUMBER).depends_on(&[Index::TIME]) by |_| 1.0;
        /// Output
        anything = output(&NUMBER) by |_| 1.0;
    }
    other_time: {
        /// Time of arrival
        time = input(&NUMBER) in u;
    }
    other_indicator: {
        /// An indicator
        of as "eventIndicator[1]" = local(&NUMBER) by |clock| clock.u;
    }
}

#[test]
fn a_time_in_the_table_is_the_only_one() {
    let text = fmi3::describe::<with_time::Clock>(&Changes::default()).unwrap();
    has(&text, "independent");
    has(&text, r#"<Float64 name="t" valueReference="2" description="Time" causality="independent" "#);
    has(&text, r#"<Float64 name="eventIndicator[1]" valueReference="4" "#);
    has(&text, r#"<Output valueReference="3" dependencies="1" dependenciesKind="dependent"/>"#);
}

/// The time is a known like others: declared by its name, or possible where nothing is said.
#[test]
fn what_may_depend_on_the_time_does() {
    let text = fmi3::describe::<without_time::Clock>(&Changes::default()).unwrap();
    has(&text, r#"<Output valueReference="2" dependencies="1" dependenciesKind="dependent"/>"#);
    has(&text, r#"<Output valueReference="3" dependencies="5" dependenciesKind="dependent"/>"#);
    has(&text, r#"<Output valueReference="4" dependencies="1 5" dependenciesKind="dependent dependent"/>"#);
}

#[test]
fn names_that_fmi_3_needs_are_refused() {
    for (error, name) in [
        (fmi3::describe::<other_time::Clock>(&Changes::default()), "time"),
        (fmi3::describe::<other_indicator::Clock>(&Changes::default()), "eventIndicator[1]"),
    ] {
        let error = error.unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("{name} is the name of a variable that FMI 3.0 asks for")),
            "{error}"
        );
    }
    fmi2::describe::<other_time::Clock>(&Changes::default()).unwrap();
}

#[test]
fn terminals_are_written() {
    let door = Terminal::plug("door")
        .kind("org.example.Door")
        .description("Where people <enter>")
        .signal("warmth", "outside")
        .inflow("people", "count");
    let content = [icon("door.png")];
    let all = [
        door.icon("door", [-110.0, -10.0, -90.0, 10.5]),
        Terminal::bus("bus").outflow("a", "outside"),
        Terminal::sequence("row").member("gain", "gain", "org.example.gain"),
    ];
    let text = terminals(&common::model::<Room>(), &all, &content).unwrap().unwrap();
    fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join("room-terminals.xml"), &text).unwrap();
    assert_eq!(
        text,
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiTerminalsAndIcons
  fmiVersion="3.0">
  <Terminals>
    <Terminal name="door" matchingRule="plug" terminalKind="org.example.Door" description="Where people &lt;enter&gt;">
      <TerminalMemberVariable variableName="outside" memberName="warmth" variableKind="signal"/>
      <TerminalMemberVariable variableName="count" memberName="people" variableKind="inflow"/>
      <TerminalGraphicalRepresentation x1="-110" y1="-10" x2="-90" y2="10.5" iconBaseName="door"/>
    </Terminal>
    <Terminal name="bus" matchingRule="bus">
      <TerminalMemberVariable variableName="outside" memberName="a" variableKind="outflow"/>
    </Terminal>
    <Terminal name="row" matchingRule="sequence">
      <TerminalMemberVariable variableName="gain" memberName="gain" variableKind="org.example.gain"/>
    </Terminal>
  </Terminals>
</fmiTerminalsAndIcons>
"#
    );
    assert_eq!(terminals(&common::model::<Room>(), &[], &content).unwrap(), None);
}

fn icon(name: &str) -> fmu_package::ContentFile {
    fmu_package::ContentFile { name: format!("terminalsAndIcons/{name}"), path: name.into() }
}

#[test]
fn terminals_that_cannot_be_are_refused() {
    let door = || Terminal::plug("door");
    for (all, message) in [
        (vec![door(), door()], "there are two terminals with the name door"),
        (vec![Terminal::plug("")], "the terminal '' is empty or more than one line"),
        (vec![door().description("a\nb")], "the terminal door: 'a\\nb' is more than one line"),
        (vec![door().signal("", "gain")], "the terminal door: '' is empty or more than one line"),
        (
            vec![door().signal("a", "gain").signal("a", "outside")],
            "the terminal door: it has two members with the name a",
        ),
        (vec![door().signal("a", "b")], "the terminal door: its member a is b, which is no variable"),
        (
            vec![door().signal("a", "der(temperature)")],
            "the terminal door: its member a is der(temperature), which is no input, output or parameter",
        ),
        (
            vec![door().icon("door", [0.0; 4])],
            "the terminal door: its icon terminalsAndIcons/door.png is missing",
        ),
        (vec![door().icon("door", [f64::NAN; 4])], "the terminal door: its icon has no place"),
    ] {
        assert_eq!(
            format!("{:#}", terminals(&common::model::<Room>(), &all, &[icon("door.svg")]).unwrap_err()),
            message
        );
    }
}
