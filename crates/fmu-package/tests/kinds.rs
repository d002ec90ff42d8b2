//! All that a variable can be in FMI 2.0 comes out as the standard has it.

mod common;

use common::fmi2::describe;
use fmu_export::*;
use fmu_package::Changes;
use fmu_package::structure::DependencyKind::{Constant, Dependent};
use fmu_package::structure::Unknown;

enumeration! {
    /// What the heater does.
    pub enum Heater {
        /// Nothing
        Off = 0,
        /// Warms <gently>
        Low = 2,
        /// Warms
        High = 5,
    }
}

const HEATER: Type = Type::enumeration("Heater", <Heater as Enumeration>::ITEMS);
const CELSIUS: Unit = Unit::new("degC").K(1).offset(273.15).display("degF", 1.8, 32.0);
const TEMPERATURE: Type = Type::real("ThermodynamicTemperature", &CELSIUS).nominal(20.0);
const BASES: Unit = Unit::new("all").kg(1).m(-2).s(3).A(-4).K(5).mol(-6).cd(7).rad(-8).factor(0.001);
const STRANGE: Type = Type { name: "", ..Type::real("Strange", &BASES) };
const SHARE: Type = Type::integer("Share").max_integer(100);
const ALARMS: Type = Type::integer("Alarms").min_integer(0);

#[derive(Clone)]
struct Room {
    time: f64,
    outside: f64,
    setpoint: f64,
    heater: Heater,
    open: bool,
    comment: String,
    temperature: f64,
    guess: f64,
    alarms: i32,
    power: f64,
    label: String,
    share: i32,
}

variables! { for Room;
    /// Time
    time = independent(&TIME);
    /// Outside temperature
    outside = input(&TEMPERATURE) in outside;
    /// What the heater is told to do
    heater = input(&HEATER) in heater;
    /// Whether the window is open
    open = input(&BOOLEAN) in open;
    /// What the operator says
    comment = input(&STRING) in comment;
    /// Setpoint that changes at communication points only
    setpoint = input(&TEMPERATURE).discrete() in setpoint;
    /// Temperature
    temperature = output(&TEMPERATURE).state().reinit() in temperature;
    /// Its rate
    rate as "der(temperature)" = local(&NUMBER).derivative_of(temperature)
        by |room| room.power * f64::from(room.heater.number()) - room.temperature + room.outside;
    /// Temperature of the wall, found from a guess
    wall = local(&TEMPERATURE).state().approx() in guess;
    /// Its rate
    wall_rate as "der(wall)" = local(&NUMBER).derivative_of(wall) by |room| room.temperature - room.guess;
    /// Alarms so far
    alarms = output(&ALARMS).exact() in alarms;
    /// Whether it is too warm
    warm = output(&BOOLEAN) by |room| room.temperature > 25.0;
    /// What the heater does now
    heater_now = output(&HEATER) by |room| room.heater;
    /// What the display says
    display = output(&STRING) by |room| format!("{} {}", room.label, room.comment);
    /// Sine of the time
    wave = output(&NUMBER) by |room| room.time.sin();
    /// Version of the room
    version = output(&INTEGER).constant() by |_| 7;
    /// All base units
    strange = local(&STRANGE).constant() by |_| 0.5;
    /// Power per stage
    power = parameter(&NUMBER) in power;
    /// Double the power
    double = calculated_parameter(&NUMBER) by |room| 2.0 * room.power;
    /// What stands on the display
    label = parameter(&STRING).tunable() in label;
    /// Half the share, as it was in the beginning
    half = local(&INTEGER).fixed() by |room| room.share / 2;
    /// Share of the heat that comes back, %
    share = parameter(&SHARE) in share;
}

impl Model for Room {
    const INFO: Info = Info { smooth: true, ..Info::new("Room", "room", "{room}") };

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self {
            time: 0.0,
            outside: 10.0,
            setpoint: 21.0,
            heater: Heater::Low,
            open: false,
            comment: String::new(),
            temperature: 20.0,
            guess: 15.0,
            alarms: 3,
            power: 1.5,
            label: "a \"b\"\n< c".into(),
            share: 50,
        })
    }

    fn initialize(&mut self, _: &Experiment) -> Result<(), Error> {
        self.guess = 0.5 * (self.temperature + self.outside);
        Ok(())
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
    const VARIABLE_STEP_SIZE: bool = false;

    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        Ok(Stepped::Done)
    }
}

impl InputDerivatives for Room {
    fn set_input_derivative(&mut self, _: Name, _: u32, _: f64) {}
}

impl OutputDerivatives for Room {
    const HIGHEST: u32 = 2;

    fn output_derivative(&self, _: Name, _: u32) -> f64 {
        0.0
    }
}

offer!(Room: ModelExchange + CoSimulation + InputDerivatives + OutputDerivatives);

#[test]
fn every_kind_of_variable_is_described() {
    let text = describe::<Room>(&Changes::default()).unwrap();
    for part in [
        r#"
  numberOfEventIndicators="2">
  <ModelExchange modelIdentifier="room" completedIntegratorStepNotNeeded="false" canNot"#,
        r#"
  <CoSimulation modelIdentifier="room" canHandleVariableCommunicationStepSize="false" canInterpolateInputs="true" maxOutputDerivativeOrder="2" canNot"#,
        r#"
  <UnitDefinitions>
    <Unit name="s">
      <BaseUnit s="1"/>
    </Unit>
    <Unit name="degC">
      <BaseUnit K="1" offset="273.15"/>
      <DisplayUnit name="degF" factor="1.8" offset="32"/>
    </Unit>
    <Unit name="1">
      <BaseUnit/>
    </Unit>
    <Unit name="all">
      <BaseUnit kg="1" m="-2" s="3" A="-4" K="5" mol="-6" cd="7" rad="-8" factor="0.001"/>
    </Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Time">
      <Real quantity="Time" unit="s"/>
    </SimpleType>
    <SimpleType name="ThermodynamicTemperature">
      <Real quantity="ThermodynamicTemperature" unit="degC" displayUnit="degF" nominal="20"/>
    </SimpleType>
    <SimpleType name="Heater">
      <Enumeration>
        <Item name="Off" value="0" description="Nothing"/>
        <Item name="Low" value="2" description="Warms &lt;gently&gt;"/>
        <Item name="High" value="5" description="Warms"/>
      </Enumeration>
    </SimpleType>
    <SimpleType name="Number">
      <Real quantity="Number" unit="1"/>
    </SimpleType>
    <SimpleType name="Alarms">
      <Integer min="0"/>
    </SimpleType>
    <SimpleType name="Share">
      <Integer max="100"/>
    </SimpleType>
  </TypeDefinitions>
"#,
        r#"name="time" valueReference="0" description="Time" causality="independent" variability="continuous">
      <Real declaredType="Time" quantity="Time" unit="s"/>"#,
        r#"causality="input" variability="discrete">
      <Enumeration declaredType="Heater" start="2"/>"#,
        r#"causality="input" variability="discrete">
      <Boolean start="false"/>"#,
        r#"causality="input" variability="discrete">
      <String start=""/>"#,
        r#"name="setpoint" valueReference="5" description="Setpoint that changes at communication points only" causality="input" variability="discrete">
      <Real declaredType="ThermodynamicTemperature" start="21" quantity"#,
        r#"name="temperature" valueReference="6" description="Temperature" causality="output" variability="continuous" initial="exact">
      <Real declaredType="ThermodynamicTemperature" start="20" reinit="true" quantity"#,
        r#"name="wall" valueReference="8" description="Temperature of the wall, found from a guess" causality="local" variability="continuous" initial="approx">
      <Real declaredType="ThermodynamicTemperature" start="15" quantity"#,
        r#"causality="output" variability="discrete" initial="exact">
      <Integer declaredType="Alarms" start="3" min="0"/>"#,
        r#"causality="output" variability="discrete" initial="calculated">
      <Boolean/>"#,
        r#"causality="output" variability="discrete" initial="calculated">
      <Enumeration declaredType="Heater"/>"#,
        r#"causality="output" variability="discrete" initial="calculated">
      <String/>"#,
        r#"causality="output" variability="constant" initial="exact">
      <Integer start="7"/>"#,
        r#"causality="local" variability="constant" initial="exact">
      <Real start="0.5" quantity="Strange" unit="all"/>"#,
        r#"causality="calculatedParameter" variability="fixed" initial="calculated">
      <Real declaredType="Number" quantity="Number" unit="1"/>"#,
        r#"causality="parameter" variability="tunable" initial="exact">
      <String start="a &quot;b&quot;&#10;&lt; c"/>"#,
        r#"causality="local" variability="fixed" initial="calculated">
      <Integer/>"#,
        r#"causality="parameter" variability="fixed" initial="exact">
      <Integer declaredType="Share" start="50" max="100"/>"#,
    ] {
        assert_eq!(text.matches(part).count(), 1, "{part}\n is not once in\n{text}");
    }
}

/// Section 2.2.8: the time is a known, constants depend on nothing, what is approx is calculated.
#[test]
fn every_kind_of_variable_has_its_dependencies() {
    let place = |name: Name| name as u32;
    let unknowns =
        |list: Vec<Unknown>| list.into_iter().map(|of| (of.vr, of.dependencies)).collect::<Vec<_>>();
    let structure = common::structure::<Room>(false).unwrap();
    use Name::*;
    // Strings are not tried, so what is not declared may follow from them.
    let comment_and = |others: &[(Name, _)]| {
        let mut all: Vec<_> = others.iter().map(|(name, kind)| (place(*name), *kind)).collect();
        all.push((place(comment), Dependent));
        all.sort_by_key(|(vr, _)| *vr);
        all
    };
    assert_eq!(
        unknowns(structure.outputs),
        [
            (place(temperature), vec![(place(temperature), Constant)]),
            (place(alarms), comment_and(&[])),
            (place(warm), comment_and(&[(temperature, Dependent)])),
            (place(heater_now), comment_and(&[(heater, Dependent)])),
            (place(display), comment_and(&[])),
            (place(wave), comment_and(&[(time, Dependent)])),
            (place(version), vec![]),
        ]
    );
    assert_eq!(
        unknowns(structure.derivatives),
        [
            (
                place(rate),
                comment_and(&[(outside, Dependent), (heater, Dependent), (temperature, Dependent)])
            ),
            // Also of a state whose start is calculated.
            (place(wall_rate), comment_and(&[(temperature, Dependent), (wall, Dependent)])),
        ]
    );
    let all = unknowns(structure.initial_unknowns);
    let vrs: Vec<u32> = all.iter().map(|(vr, _)| *vr).collect();
    let expected = [rate, wall, wall_rate, warm, heater_now, display, wave, double];
    assert_eq!(vrs, expected.map(place), "sorted, with calculated parameters and what is approx");
    let of = |name| {
        let (_, list) = all.iter().find(|(vr, _)| *vr == place(name)).unwrap();
        let not_text = |(vr, _): &&(u32, _)| *vr != place(comment) && *vr != place(label);
        list.iter().filter(not_text).copied().collect::<Vec<_>>()
    };
    assert_eq!(of(double), [(place(power), Constant)]);
    // Its guess does not count.
    assert_eq!(
        of(wall_rate).iter().map(|(vr, _)| *vr).collect::<Vec<_>>(),
        [outside, temperature].map(place)
    );
    assert_eq!(of(heater_now), [(place(heater), Dependent)]);
}

/// What follows from tunable parameters is tunable, too.
#[test]
fn calculated_parameters_are_as_tunable_as_parameters() {
    let text = describe::<Room>(&Changes { tunable_parameters: true, ..Changes::default() }).unwrap();
    assert!(text.contains(r#"causality="calculatedParameter" variability="tunable""#), "{text}");
    assert_eq!(text.matches(r#"variability="fixed""#).count(), 1, "{text}");
}
