//! The dependencies of models with branches and memory, where no trying near the start values can find them.

use fmi_schema::fmi2::DependenciesKind::Dependent;
use fmi2_export::{
    CoSimulation, Interface, Kind, Model, ModelError, ModelInfo, RealType, Variable, units, variables,
};
use fmi2_package::structure::ModelStructure;
use fmi2_package::{Changes, describe};

const NUMBER: RealType = RealType::new("Number", &units::ONE);

variables! {
    /// Input
    u = Variable::input(&NUMBER, 0.0);
    /// Input
    v = Variable::input(&NUMBER, 0.0);
    /// u where it is above 10, else 0
    above = Variable::output(&NUMBER);
    /// u within 100, v after the first step
    limited = Variable::output(&NUMBER);
    /// The same as above
    declared = Variable::output(&NUMBER).depends_on(&[vr::u]);
    /// The sum of u at the steps before, times the gain
    sum = Variable::output(&NUMBER).depends_on(&[vr::gain]);
    /// Factor
    gain = Variable::parameter(Kind::Real { of: &NUMBER, start: 1.0 });
}

#[derive(Clone)]
struct Branches {
    inputs: [f64; 2],
    sum: f64,
    gain: f64,
    stepped: bool,
}

impl Model for Branches {
    const INFO: ModelInfo = ModelInfo {
        co_simulation: Some(CoSimulation { directional_derivative: true, ..CoSimulation::PLAIN }),
        ..ModelInfo::new("Branches", "branches", "{branches}", VARIABLES)
    };

    fn new(_: Interface) -> Self {
        Self { inputs: [0.0; 2], sum: 0.0, gain: 1.0, stepped: false }
    }

    fn real(&self, variable: u32) -> f64 {
        let [u, v] = self.inputs;
        match variable {
            vr::u => u,
            vr::v => v,
            vr::above | vr::declared if u > 10.0 => u,
            vr::above | vr::declared => 0.0,
            vr::limited => u.clamp(-100.0, 100.0) + if self.stepped { v } else { 0.0 },
            vr::sum => self.gain * (1.0 + self.sum),
            _ => self.gain,
        }
    }

    fn set_real(&mut self, variable: u32, value: f64) {
        match variable {
            vr::gain => self.gain = value,
            input => self.inputs[input as usize] = value,
        }
    }

    fn do_step(&mut self, _: f64, _: f64) -> Result<(), ModelError> {
        self.sum += self.inputs[0];
        self.stepped = true;
        Ok(())
    }

    /// Exact where the model is, and 0 all around the start values.
    fn partial_derivative(&self, unknown: u32, known: u32) -> Option<f64> {
        let [u, _] = self.inputs;
        Some(match (unknown, known) {
            (vr::above | vr::declared, vr::u) => f64::from(u > 10.0),
            (vr::limited, vr::u) => f64::from(u.abs() < 100.0),
            (vr::limited, vr::v) => f64::from(self.stepped),
            _ => 0.0,
        })
    }
}

#[test]
fn what_cannot_be_ruled_out_is_listed_and_what_is_declared_narrows_it() {
    let structure = ModelStructure::of::<Branches>(false).unwrap();
    let known = |list: Vec<(u32, Vec<fmi2_package::structure::Dependency>)>| {
        list.into_iter()
            .map(|(unknown, list)| {
                assert!(list.iter().all(|dependency| dependency.kind == Dependent), "{list:?}");
                (unknown, list.iter().map(|dependency| dependency.known).collect())
            })
            .collect::<Vec<(u32, Vec<u32>)>>()
    };
    let (u, v, gain) = (vr::u, vr::v, vr::gain);
    assert_eq!(
        known(structure.outputs),
        [(vr::above, vec![u, v]), (vr::limited, vec![u, v]), (vr::declared, vec![u]), (vr::sum, vec![])]
    );
    assert_eq!(
        known(structure.initial_unknowns),
        [
            (vr::above, vec![u, v, gain]),
            (vr::limited, vec![u, v, gain]),
            (vr::declared, vec![u]),
            (vr::sum, vec![gain])
        ]
    );
}

/// Says that its output depends on nothing.
#[derive(Clone)]
struct Liar<const SMOOTH: bool>(f64);

impl<const SMOOTH: bool> Model for Liar<SMOOTH> {
    const INFO: ModelInfo = ModelInfo {
        co_simulation: Some(CoSimulation::PLAIN),
        smooth: SMOOTH,
        ..ModelInfo::new("Liar", "liar", "{liar}", LIES)
    };

    fn new(_: Interface) -> Self {
        Self(0.0)
    }

    fn real(&self, _: u32) -> f64 {
        self.0
    }

    fn set_real(&mut self, _: u32, value: f64) {
        self.0 = value;
    }
}

const LIES: &[Variable] =
    &[Variable::input(&NUMBER, 0.0).named("u"), Variable::output(&NUMBER).named("y").depends_on(&[])];

#[test]
fn a_declaration_that_the_model_contradicts_is_refused() {
    for error in [
        describe::<Liar<false>>(&Changes::default()).unwrap_err(),
        describe::<Liar<true>>(&Changes::default()).unwrap_err(),
    ] {
        assert_eq!(error.to_string(), "y reacts to u, which its depends_on does not name");
    }
}

/// A model that would make the sampler panic.
#[derive(Clone)]
struct Impossible;

impl Model for Impossible {
    const INFO: ModelInfo = ModelInfo {
        co_simulation: Some(CoSimulation::PLAIN),
        ..ModelInfo::new("Impossible", "impossible", "{impossible}", IMPOSSIBLE)
    };

    fn new(_: Interface) -> Self {
        Self
    }

    fn real(&self, _: u32) -> f64 {
        0.0
    }

    fn set_real(&mut self, _: u32, _: f64) {}
}

const EMPTY: RealType = RealType { min: Some(2.0), max: Some(1.0), ..NUMBER };
const IMPOSSIBLE: &[Variable] = &[Variable::input(&EMPTY, 0.0).named("u")];

#[test]
fn what_makes_no_sense_is_refused_before_it_is_tried() {
    let message = "u cannot have the type Number: its range is empty: min 2 is above max 1";
    assert_eq!(format!("{:#}", describe::<Impossible>(&Changes::default()).unwrap_err()), message);
    assert_eq!(format!("{:#}", ModelStructure::of::<Impossible>(false).unwrap_err()), message);
}
