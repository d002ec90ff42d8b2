//! The description of a model whose structure is known.

use fmi_schema::fmi2::DependenciesKind::{self, Constant, Dependent, Fixed, Tunable};
use fmi_schema::fmi2::{Fmi2ModelDescription, ScalarVariableElement};
use fmi_schema::traits::FmiModelDescription;
use fmi2_export::{
    CoSimulation, DefaultExperiment, Interface, Kind, Model, ModelError, ModelExchange, ModelInfo, RealType,
    Variable, units, variables,
};
use fmi2_package::structure::ModelStructure;
use fmi2_package::{Changes, Start, describe};

const NUMBER: RealType = RealType::new("Number", &units::ONE);
const SHARE: RealType = RealType { min: Some(0.0), max: Some(1.0), ..RealType::new("Share", &units::ONE) };

variables! {
    /// Input
    u = Variable::input(&NUMBER, 0.0);
    /// Input with <signs> & "quotes"
    v = Variable::input(&NUMBER, 0.0);
    /// State
    x = Variable::output(&NUMBER).state(2.0);
    /// 3 u - p x
    der_x = Variable::local(&NUMBER).derivative_of(vr::x).named("der(x)");
    /// 2 u + n x
    y = Variable::output(&NUMBER);
    /// x v, or x if not b
    z = Variable::output(&NUMBER);
    /// Five
    five = Variable::output(&NUMBER);
    /// Real parameter
    p = Variable::parameter(Kind::Real { of: &SHARE, start: 0.1 });
    /// Integer parameter
    n = Variable::parameter(Kind::Integer { min: -9, max: 3, start: 1 });
    /// Boolean parameter
    b = Variable::parameter(Kind::Boolean { start: true });
}

/// What a model offers: Co-Simulation, Model Exchange, derivatives, smooth equations.
trait Offer: Clone {
    const CO_SIMULATION: bool;
    const MODEL_EXCHANGE: bool;
    const DERIVATIVES: bool;
    const SMOOTH: bool;
}

macro_rules! offers {
    ($($name:ident: $co_simulation:literal, $model_exchange:literal, $derivatives:literal, $smooth:literal;)+) => { $(
        #[derive(Clone)]
        struct $name;
        impl Offer for $name {
            const CO_SIMULATION: bool = $co_simulation;
            const MODEL_EXCHANGE: bool = $model_exchange;
            const DERIVATIVES: bool = $derivatives;
            const SMOOTH: bool = $smooth;
        }
    )+ };
}

offers! {
    Everything: true, true, true, true;
    NoDerivatives: true, true, false, true;
    NotSmooth: true, true, true, false;
    StepsOnly: true, false, false, true;
    Nothing: false, false, false, false;
}

#[derive(Clone)]
struct Toy<O> {
    reals: [f64; 10],
    n: i32,
    b: bool,
    offer: std::marker::PhantomData<O>,
}

impl<O: Offer> Model for Toy<O> {
    const INFO: ModelInfo = ModelInfo {
        default_experiment: DefaultExperiment {
            start_time: 0.0,
            stop_time: 1.0,
            step_size: 1e-3,
            tolerance: 1e-7,
        },
        co_simulation: if O::CO_SIMULATION {
            Some(CoSimulation {
                variable_step_size: true,
                interpolates_inputs: false,
                max_output_derivative_order: 0,
                directional_derivative: O::DERIVATIVES,
                serializes_state: false,
            })
        } else {
            None
        },
        model_exchange: if O::MODEL_EXCHANGE {
            Some(ModelExchange { directional_derivative: O::DERIVATIVES, serializes_state: false })
        } else {
            None
        },
        smooth: O::SMOOTH,
        version: "1",
        ..ModelInfo::new("Toy", "toy", "{toy}", VARIABLES)
    };

    fn new(_interface: Interface) -> Self {
        let mut reals = [0.0; 10];
        reals[vr::x as usize] = 2.0;
        reals[vr::p as usize] = 0.1;
        Self { reals, n: 1, b: true, offer: std::marker::PhantomData }
    }

    fn real(&self, vr: u32) -> f64 {
        let [u, v, x, .., p, _, _] = self.reals;
        match vr {
            vr::der_x => 3.0 * u - p * x,
            vr::y => 2.0 * u + f64::from(self.n) * x,
            vr::z => x * if self.b { v } else { 1.0 },
            // The input cancels, up to rounding.
            vr::five => (u / 3.0 + 5.0) - u / 3.0,
            other => self.reals[other as usize],
        }
    }

    fn set_real(&mut self, vr: u32, value: f64) {
        self.reals[vr as usize] = value;
    }

    fn integer(&self, _: u32) -> i32 {
        self.n
    }

    fn set_integer(&mut self, _: u32, value: i32) {
        self.n = value;
    }

    fn boolean(&self, _: u32) -> bool {
        self.b
    }

    fn set_boolean(&mut self, _: u32, value: bool) {
        self.b = value;
    }

    fn parameters_changed(&mut self) -> Result<(), ModelError> {
        if self.reals[vr::p as usize] < f64::from(self.n) / 20.0 {
            return Err(ModelError::new("p is too small for n"));
        }
        Ok(())
    }

    fn partial_derivative(&self, unknown: u32, known: u32) -> Option<f64> {
        let [_, v, x, .., p, _, _] = self.reals;
        O::DERIVATIVES.then_some(match (unknown, known) {
            (vr::der_x, vr::u) => 3.0,
            (vr::der_x, vr::x) => -p,
            (vr::y, vr::u) => 2.0,
            (vr::y, vr::x) => f64::from(self.n),
            (vr::z, vr::x) => v,
            (vr::z, vr::v) => x,
            (vr::x, vr::x) => 1.0,
            _ => 0.0,
        })
    }
}

type Lists = Vec<(u32, Vec<(u32, DependenciesKind)>)>;

fn lists<O: Offer>(tunable: bool) -> [Lists; 3] {
    let structure = ModelStructure::of::<Toy<O>>(tunable).unwrap();
    [structure.outputs, structure.derivatives, structure.initial_unknowns].map(|list| {
        list.into_iter()
            .map(|(unknown, knowns)| (unknown, knowns.into_iter().map(|d| (d.known, d.kind)).collect()))
            .collect()
    })
}

fn initial_unknowns() -> Lists {
    vec![
        (vr::der_x, vec![(vr::u, Constant), (vr::x, Dependent), (vr::p, Dependent)]),
        (vr::y, vec![(vr::u, Constant), (vr::x, Dependent), (vr::n, Dependent)]),
        (vr::z, vec![(vr::v, Dependent), (vr::x, Dependent), (vr::b, Dependent)]),
        (vr::five, vec![]),
    ]
}

#[test]
fn kinds_say_what_a_factor_is_made_of() {
    for (tunable, kind) in [(false, Fixed), (true, Tunable)] {
        let [outputs, derivatives, initial] = lists::<Everything>(tunable);
        let expected: Lists = vec![
            (vr::x, vec![(vr::x, Constant)]),
            (vr::y, vec![(vr::u, Constant), (vr::x, kind.clone())]),
            (vr::z, vec![(vr::v, Dependent), (vr::x, Dependent)]),
            (vr::five, vec![]),
        ];
        assert_eq!(outputs, expected);
        assert_eq!(derivatives, [(vr::der_x, vec![(vr::u, Constant), (vr::x, kind)])]);
        assert_eq!(initial, initial_unknowns());
    }
}

#[test]
fn without_derivatives_the_values_tell() {
    let [outputs, derivatives, initial] = lists::<NoDerivatives>(false);
    let expected: Lists = vec![
        (vr::x, vec![(vr::x, Constant)]),
        (vr::y, vec![(vr::u, Dependent), (vr::x, Dependent)]),
        (vr::z, vec![(vr::v, Dependent), (vr::x, Dependent)]),
        (vr::five, vec![]),
    ];
    assert_eq!(outputs, expected);
    assert_eq!(derivatives, [(vr::der_x, vec![(vr::u, Dependent), (vr::x, Dependent)])]);
    assert_eq!(initial, initial_unknowns());
}

/// Trying a few points proves nothing then, whatever the derivatives are there.
#[test]
fn without_smooth_equations_nothing_is_ruled_out() {
    let [outputs, derivatives, initial] = lists::<NotSmooth>(false);
    let all = |knowns: &[u32]| knowns.iter().map(|known| (*known, Dependent)).collect::<Vec<_>>();
    let of_all = |unknown| (unknown, all(&[vr::u, vr::v, vr::x]));
    let itself = (vr::x, vec![(vr::x, Constant)]);
    assert_eq!(outputs, [itself, of_all(vr::y), of_all(vr::z), of_all(vr::five)]);
    assert_eq!(derivatives, [of_all(vr::der_x)]);
    let initial_knowns = all(&[vr::u, vr::v, vr::x, vr::p, vr::n, vr::b]);
    assert_eq!(initial, [vr::der_x, vr::y, vr::z, vr::five].map(|unknown| (unknown, initial_knowns.clone())));
}

/// Section 2.2.8: then neither state derivatives nor dependencies on states are listed.
#[test]
fn co_simulation_without_derivatives_keeps_its_states_to_itself() {
    let [outputs, derivatives, initial] = lists::<StepsOnly>(false);
    let expected: Lists = vec![
        (vr::x, vec![]),
        (vr::y, vec![(vr::u, Dependent)]),
        (vr::z, vec![(vr::v, Dependent)]),
        (vr::five, vec![]),
    ];
    assert_eq!(outputs, expected);
    assert_eq!(derivatives, []);
    assert_eq!(initial, initial_unknowns()[1..]);
}

fn text<O: Offer>(changes: &Changes) -> String {
    describe::<Toy<O>>(changes).unwrap()
}

#[test]
fn the_text_is_what_the_schema_wants() {
    let text = text::<Everything>(&Changes::default());
    assert!(text.starts_with(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription\n  fmiVersion=\"2.0\"\n"
    ));
    for line in [
        r#"  <CoSimulation modelIdentifier="toy" canHandleVariableCommunicationStepSize="true" canInterpolateInputs="false" maxOutputDerivativeOrder="0" canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="false" providesDirectionalDerivative="true"/>"#,
        r#"      <BaseUnit/>"#,
        r#"      <Integer min="-9" max="3"/>"#,
        r#"      <Real quantity="Share" unit="1" min="0" max="1"/>"#,
        r#"  <DefaultExperiment startTime="0" stopTime="1" tolerance="0.0000001" stepSize="0.001"/>"#,
        r#"    <ScalarVariable name="v" valueReference="1" description="Input with &lt;signs&gt; &amp; &quot;quotes&quot;" causality="input" variability="continuous">"#,
        r#"      <Real declaredType="Number" start="2" quantity="Number" unit="1"/>"#,
        r#"      <Real declaredType="Number" derivative="3" quantity="Number" unit="1"/>"#,
        r#"    <ScalarVariable name="n" valueReference="8" description="Integer parameter" causality="parameter" variability="fixed" initial="exact">"#,
        r#"      <Integer declaredType="Integer_from_-9_to_3" start="1" min="-9" max="3"/>"#,
        r#"      <Boolean start="true"/>"#,
        r#"      <Unknown index="7" dependencies="" dependenciesKind=""/>"#,
    ] {
        assert!(text.lines().any(|other| other == line), "{line}\n is not in\n{text}");
    }
    let place = |element: &str| text.find(&format!("<{element}")).unwrap();
    let order = [
        "ModelExchange",
        "CoSimulation",
        "UnitDefinitions",
        "TypeDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "ModelVariables",
        "ModelStructure",
        "Outputs",
        "Derivatives",
        "InitialUnknowns",
    ];
    assert!(order.is_sorted_by_key(|element| place(element)), "{text}");
}

#[test]
fn it_reads_back() {
    let text = text::<Everything>(&Changes::default());
    let read = Fmi2ModelDescription::deserialize(&text).unwrap();
    assert_eq!(read.model_variables.variables.len(), VARIABLES.len());
    assert_eq!(read.model_variables.variables[1].description.as_deref(), Some(VARIABLES[1].description()));
    assert_eq!(read.number_of_event_indicators, Some(0));
    let unknowns = &read.model_structure.initial_unknowns.unknowns;
    assert_eq!(unknowns.iter().map(|unknown| unknown.index).collect::<Vec<_>>(), [4, 5, 6, 7]);
    assert_eq!(unknowns[0].dependencies, [1, 3, 8]);
    assert_eq!(unknowns[0].dependencies_kind, [Constant, Dependent, Dependent]);
}

#[test]
fn lists_that_would_be_empty_are_left_out() {
    let text = text::<StepsOnly>(&Changes::default());
    for absent in ["<Derivatives", "<ModelExchange", "numberOfEventIndicators"] {
        assert!(!text.contains(absent), "{text}");
    }
}

#[test]
fn changes_are_made_and_nothing_else() {
    let changes = Changes {
        guid: Some("{other}".into()),
        start: vec![
            ("p".into(), Start::Real(0.30000000000000004)),
            ("n".into(), Start::Integer(-2)),
            ("b".into(), Start::Boolean(false)),
        ],
        tunable_parameters: true,
    };
    let (before, after) = (text::<Everything>(&Changes::default()), text::<Everything>(&changes));
    let read = Fmi2ModelDescription::deserialize(&after).unwrap();
    assert_eq!(read.guid, "{other}");
    let Ok(variable) = read.model_variable_by_name("p") else { panic!("{after}") };
    let ScalarVariableElement::Real(p) = &variable.elem else { panic!("{variable:?}") };
    assert_eq!(p.start, Some(0.30000000000000004));

    let mut expected =
        before.replace("{toy}", "{other}").replace("variability=\"fixed\"", "variability=\"tunable\"");
    for (from, to) in [
        (
            "<Real declaredType=\"Share\" start=\"0.1\"",
            "<Real declaredType=\"Share\" start=\"0.30000000000000004\"",
        ),
        ("to_3\" start=\"1\"", "to_3\" start=\"-2\""),
        ("<Boolean start=\"true\"", "<Boolean start=\"false\""),
        ("\"constant fixed\"", "\"constant tunable\""),
    ] {
        expected = expected.replace(from, to);
    }
    assert_eq!(after, expected);
}

#[test]
fn impossible_changes_are_refused() {
    for (name, start, message) in [
        ("q", Start::Real(1.0), "there is no variable q"),
        ("y", Start::Real(1.0), "y is calculated"),
        ("p", Start::Integer(1), "p is Real"),
        ("p", Start::Real(1.5), "p must be <= 1, it is 1.5"),
        ("p", Start::Real(-0.5), "p must be >= 0, it is -0.5"),
        ("u", Start::Real(f64::INFINITY), "u must be a finite number, it is inf"),
        ("n", Start::Integer(4), "n must be between -9 and 3, it is 4"),
    ] {
        let changes = Changes { start: vec![(name.into(), start)], ..Changes::default() };
        let error = describe::<Toy<Everything>>(&changes).unwrap_err().to_string();
        assert!(error.starts_with(message), "{error}");
    }
    let error = describe::<Toy<Nothing>>(&Changes::default()).unwrap_err().to_string();
    assert!(error.contains("neither"), "{error}");
}
