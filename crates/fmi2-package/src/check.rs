//! What a model says of itself must make sense before it is tried and described.

use crate::describe::Changes;
use crate::variant::Start;
use anyhow::{Context, Result, anyhow, bail, ensure};
use fmi2_export::{
    Causality, DisplayUnit, Initial, Interface, Kind, Model, ModelInfo, RealType, Variability, Variable,
};
use std::collections::HashSet;

/// The facts alone, whatever the model calculates.
///
/// Fails when a name is missing, taken or cannot be used, a range, nominal value, unit or start value is
/// impossible, a state has not exactly one derivative, or a value reference points nowhere.
pub(crate) fn check_info(info: &ModelInfo) -> Result<()> {
    ensure!(
        info.co_simulation.is_some() || info.model_exchange.is_some(),
        "{} offers neither Co-Simulation nor Model Exchange",
        info.name
    );
    ensure!(
        is_text(info.name),
        "the model's name '{}' is empty or more than one line",
        info.name.escape_debug()
    );
    ensure!(
        is_identifier(info.identifier),
        "the identifier '{}' must be one of C: letters, digits and underscores, no digit first",
        info.identifier.escape_debug()
    );
    ensure!(!info.guid.is_empty(), "{} has no guid", info.name);
    check_experiment(info)?;
    let mut names = HashSet::new();
    for variable in info.variables {
        let name = variable.name();
        ensure!(is_text(name), "the variable name '{}' is empty or more than one line", name.escape_debug());
        ensure!(names.insert(name), "there are two variables with the name {name}");
        check_kind(variable)?;
        check_references(info, variable)?;
    }
    for state in info.states() {
        let is_derivative = |v: &&Variable| v.is_state_derivative() && v.differentiates() == Some(state);
        let name = info.variables[state as usize].name();
        match info.variables.iter().filter(is_derivative).count() {
            0 => bail!("the state {name} has no derivative among the variables"),
            1 => {}
            count => bail!("the state {name} has {count} derivatives among the variables"),
        }
    }
    Ok(())
}

fn is_text(name: &str) -> bool {
    !name.is_empty() && !name.chars().any(char::is_control)
}

fn is_identifier(text: &str) -> bool {
    let is_letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    text.starts_with(is_letter) && text.chars().all(|c| is_letter(c) || c.is_ascii_digit())
}

fn check_experiment(info: &ModelInfo) -> Result<()> {
    let of = &info.default_experiment;
    for (name, value) in [("start time", of.start_time), ("stop time", of.stop_time)] {
        ensure!(value.is_finite(), "the {name} of the default experiment must be finite, it is {value}");
    }
    for (name, value) in [("step size", of.step_size), ("tolerance", of.tolerance)] {
        ensure!(is_positive(value), "the {name} of the default experiment must be > 0, it is {value}");
    }
    ensure!(of.start_time <= of.stop_time, "the default experiment stops before it starts");
    Ok(())
}

fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

fn check_kind(variable: &Variable) -> Result<()> {
    let name = variable.name();
    let start = format!("the start value of {name}");
    match (variable.causality(), variable.variability(), variable.kind()) {
        (_, _, Kind::Real { of, start: value }) => {
            check_type(of).with_context(|| format!("{name} cannot have the type {}", of.name))?;
            if has_start(variable) {
                check_real(&start, of, value)?;
            }
        }
        (
            Causality::Parameter,
            Variability::Fixed | Variability::Tunable,
            Kind::Integer { min, max, start: value },
        ) => {
            ensure!(min <= max, "the range of {name} is empty: min {min} is above max {max}");
            check_integer(&start, min, max, value)?;
        }
        (Causality::Parameter, Variability::Fixed | Variability::Tunable, Kind::Boolean { .. }) => {}
        (causality, variability, kind) => {
            bail!("{name} cannot be described: {causality:?}, {variability:?}, {:?}", kind.base_type())
        }
    }
    Ok(())
}

fn check_type(of: &RealType) -> Result<()> {
    for (what, limit) in [("min", of.min), ("max", of.max)] {
        ensure!(limit.is_none_or(f64::is_finite), "{what} must be a finite number");
    }
    if let (Some(min), Some(max)) = (of.min, of.max) {
        ensure!(min <= max, "its range is empty: min {min} is above max {max}");
    }
    if let Some(nominal) = of.nominal {
        ensure!(is_positive(nominal), "the nominal value must be > 0, it is {nominal}");
    }
    if let Some(DisplayUnit { name, factor }) = of.unit.display {
        ensure!(
            factor.is_finite() && factor != 0.0,
            "the factor of the display unit {name} must be finite and not 0, it is {factor}"
        );
    }
    Ok(())
}

fn check_real(what: &str, of: &RealType, value: f64) -> Result<()> {
    ensure!(value.is_finite(), "{what} must be a finite number, it is {value}");
    if let Some(min) = of.min {
        ensure!(value >= min, "{what} must be >= {min}, it is {value}");
    }
    if let Some(max) = of.max {
        ensure!(value <= max, "{what} must be <= {max}, it is {value}");
    }
    Ok(())
}

fn check_integer(what: &str, min: i32, max: i32, value: i32) -> Result<()> {
    ensure!((min..=max).contains(&value), "{what} must be between {min} and {max}, it is {value}");
    Ok(())
}

/// What the variable differentiates, and what it depends on.
fn check_references(info: &ModelInfo, variable: &Variable) -> Result<()> {
    let name = variable.name();
    if let Some(vr) = variable.differentiates() {
        let of = info.variables.get(vr as usize);
        let of =
            of.with_context(|| format!("{name} is the derivative of a variable {vr} that is not there"))?;
        ensure!(
            matches!(of.kind(), Kind::Real { .. }) && !std::ptr::eq(of, variable),
            "{name} cannot be the derivative of {}",
            of.name()
        );
    }
    for (place, &vr) in variable.dependencies().unwrap_or_default().iter().enumerate() {
        let known = info.variables.get(vr as usize);
        let known = known.with_context(|| format!("{name} depends on a variable {vr} that is not there"))?;
        ensure!(
            has_start(known),
            "{name} depends on {}, which is calculated; name the inputs, states and parameters that it follows from",
            known.name()
        );
        let before = &variable.dependencies().unwrap_or_default()[..place];
        ensure!(!before.contains(&vr), "{name} names {} twice among what it depends on", known.name());
    }
    Ok(())
}

/// Inputs and what is `exact` start from a value, what is `calculated` does not (section 2.2.7).
pub(crate) fn has_start(variable: &Variable) -> bool {
    variable.initial() != Some(Initial::Calculated)
}

fn offered<M: Model>() -> impl Iterator<Item = Interface> {
    let co_simulation = M::INFO.co_simulation.map(|_| Interface::CoSimulation);
    let model_exchange = M::INFO.model_exchange.map(|_| Interface::ModelExchange);
    [co_simulation, model_exchange].into_iter().flatten()
}

/// The model must start with what its table says, through each interface type.
pub(crate) fn check_starts<M: Model>() -> Result<()> {
    for interface in offered::<M>() {
        let model = M::new(interface);
        for (vr, variable) in (0..).zip(M::INFO.variables).filter(|(_, variable)| has_start(variable)) {
            let table = Start::of(&variable.kind());
            let actual = match table {
                Start::Real(_) => Start::Real(model.real(vr)),
                Start::Integer(_) => Start::Integer(model.integer(vr)),
                Start::Boolean(_) => Start::Boolean(model.boolean(vr)),
            };
            let name = variable.name();
            ensure!(
                table == actual,
                "{name} starts with {table:?} in the table and with {actual:?} in the model"
            );
        }
    }
    Ok(())
}

/// Other start values must be possible for their variables, and together make a model, or the FMU could not
/// be instantiated.
pub(crate) fn check_changes<M: Model>(changes: &Changes) -> Result<()> {
    for (name, start) in &changes.start {
        let Some(variable) = M::INFO.variables.iter().find(|variable| variable.name() == name) else {
            bail!("there is no variable {name} to give a start value to");
        };
        ensure!(has_start(variable), "{name} is calculated and has no start value");
        match (variable.kind(), *start) {
            (Kind::Real { of, .. }, Start::Real(value)) => check_real(name, of, value)?,
            (Kind::Integer { min, max, .. }, Start::Integer(value)) => check_integer(name, min, max, value)?,
            (Kind::Boolean { .. }, Start::Boolean(_)) => {}
            (kind, _) => bail!("{name} is {:?}, the start value {start:?} is not", kind.base_type()),
        }
    }
    for interface in offered::<M>() {
        let mut model = M::new(interface);
        for (vr, variable) in (0..).zip(M::INFO.variables) {
            match changes.start_of(variable) {
                Some(Start::Real(value)) => model.set_real(vr, value),
                Some(Start::Integer(value)) => model.set_integer(vr, value),
                Some(Start::Boolean(value)) => model.set_boolean(vr, value),
                None => {}
            }
        }
        model.parameters_changed().map_err(|error| anyhow!("these start values make no model: {error}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::check_info;
    use fmi2_export::{CoSimulation, Kind, ModelInfo, RealType, Unit, Variable, units};

    const NUMBER: RealType = RealType::new("Number", &units::ONE);
    const SHARE: RealType = RealType { min: Some(0.0), max: Some(1.0), ..NUMBER };
    const EMPTY: RealType = RealType { min: Some(2.0), max: Some(1.0), ..NUMBER };
    const NO_NUMBER: RealType = RealType { max: Some(f64::NAN), ..NUMBER };
    const NO_SIZE: RealType = RealType { nominal: Some(0.0), ..NUMBER };
    const NO_FACTOR: RealType = RealType::new("Number", &INVISIBLE);
    const INVISIBLE: Unit = Unit {
        name: "m",
        base: units::ONE.base,
        display: Some(fmi2_export::DisplayUnit { name: "km", factor: 0.0 }),
    };

    fn info(variables: Vec<Variable>) -> ModelInfo {
        ModelInfo {
            co_simulation: Some(CoSimulation::PLAIN),
            ..ModelInfo::new("Toy", "toy", "{toy}", variables.leak())
        }
    }

    #[track_caller]
    fn refused(info: &ModelInfo, message: &str) {
        let error = format!("{:#}", check_info(info).expect_err(message));
        assert!(error.contains(message) && error.lines().count() == 1, "{error}");
    }

    fn input(of: &'static RealType, start: f64) -> Variable {
        Variable::input(of, start).named("u")
    }

    fn integer(min: i32, max: i32, start: i32) -> Variable {
        Variable::parameter(Kind::Integer { min, max, start }).named("n")
    }

    #[test]
    fn what_is_right_passes() {
        let x = Variable::output(&NUMBER).state(0.5).named("x");
        let der_x = Variable::local(&NUMBER).derivative_of(1).named("der(x)").depends_on(&[0, 1, 3]);
        check_info(&info(vec![input(&SHARE, 1.0), x, der_x, integer(1, 1, 1)])).unwrap();
    }

    #[test]
    fn impossible_types_and_start_values_are_named() {
        for (variable, message) in [
            (input(&SHARE, 1.5), "the start value of u must be <= 1, it is 1.5"),
            (input(&SHARE, -0.5), "the start value of u must be >= 0, it is -0.5"),
            (input(&NUMBER, f64::NAN), "the start value of u must be a finite number, it is NaN"),
            (input(&EMPTY, 1.0), "u cannot have the type Number: its range is empty: min 2 is above max 1"),
            (input(&NO_NUMBER, 1.0), "max must be a finite number"),
            (input(&NO_SIZE, 1.0), "the nominal value must be > 0, it is 0"),
            (input(&NO_FACTOR, 1.0), "the factor of the display unit km must be finite and not 0"),
            (integer(2, 1, 1), "the range of n is empty: min 2 is above max 1"),
            (integer(1, 3, 4), "the start value of n must be between 1 and 3, it is 4"),
        ] {
            refused(&info(vec![variable]), message);
        }
        // What has no start value needs none that fits.
        const ABOVE: RealType = RealType { min: Some(3.0), ..NUMBER };
        check_info(&info(vec![Variable::output(&ABOVE).named("y")])).unwrap();
    }

    #[test]
    fn impossible_names_are_named() {
        for identifier in ["", "7up", "my model", "a/b", "naïve"] {
            refused(&ModelInfo { identifier, ..info(vec![]) }, "must be one of C");
        }
        refused(&ModelInfo { name: "", ..info(vec![]) }, "the model's name");
        refused(&ModelInfo { guid: "", ..info(vec![]) }, "no guid");
        refused(
            &ModelInfo { co_simulation: None, ..info(vec![]) },
            "neither Co-Simulation nor Model Exchange",
        );
        refused(&info(vec![input(&NUMBER, 0.0), input(&NUMBER, 0.0)]), "two variables with the name u");
        for name in ["", "a\nb"] {
            refused(&info(vec![input(&NUMBER, 0.0).named(name)]), "the variable name '");
        }
        let mut backwards = info(vec![]);
        backwards.default_experiment.step_size = 0.0;
        refused(&backwards, "the step size of the default experiment must be > 0, it is 0");
    }

    #[test]
    fn references_to_nowhere_are_named() {
        let y = || Variable::output(&NUMBER).named("y");
        for (variables, message) in [
            (vec![y().state(0.0)], "the state y has no derivative"),
            (
                vec![y().state(0.0), y().derivative_of(0).named("a"), y().derivative_of(0).named("b")],
                "the state y has 2 derivatives",
            ),
            (vec![y().derivative_of(7)], "y is the derivative of a variable 7 that is not there"),
            (vec![y().derivative_of(0)], "y cannot be the derivative of y"),
            (vec![integer(0, 1, 0), y().derivative_of(0)], "y cannot be the derivative of n"),
            (vec![y().depends_on(&[7])], "y depends on a variable 7 that is not there"),
            (vec![y(), y().named("z").depends_on(&[0])], "z depends on y, which is calculated"),
            (vec![input(&NUMBER, 0.0), y().depends_on(&[0, 0])], "y names u twice"),
        ] {
            refused(&info(variables), message);
        }
    }
}
