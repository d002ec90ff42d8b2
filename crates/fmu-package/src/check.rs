//! What a model says of itself must make sense before it is tried and described.
//!
//! What concerns a single variable's causality, variability and place has been refused when the model was compiled.

use crate::changes::{Changes, read_value};
use anyhow::{Context, Result, anyhow, bail, ensure};
use fmu_export::{
    Attributes, BaseType, Causality, Exported, Info, Initial, Interface, Setup, Type, Unit, Value,
    Variability, Variable,
};
use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Start values by value reference; `None` for what has none.
pub(crate) type Starts = Vec<Option<Value>>;

/// Checks the model and tells its start values, those of `changes` before its own.
pub(crate) fn check<M: Exported>(changes: &Changes) -> Result<Starts> {
    check_info(&M::INFO)?;
    ensure!(
        interfaces::<M>().next().is_some(),
        "{} offers neither Co-Simulation nor Model Exchange",
        M::INFO.name
    );
    for variable in M::TABLE {
        let name = variable.name();
        ensure!(is_text(name), "the variable name '{}' is empty or more than one line", name.escape_debug());
        ensure!(is_line(variable.description()), "the description of {name} is more than one line");
        ensure!(
            !M::ARRAYS || is_structured(name),
            "the variable name '{}' is no name of the structured naming convention, which a model with arrays needs: \
             write names as in Modelica, such as motor.torque, der(x), or 'any text' (section 2.2.9 of FMI 2.0)",
            name.escape_debug()
        );
        let of = variable.variable_type();
        let named = if of.name.is_empty() {
            "its type".to_owned()
        } else {
            format!("the type {}", of.name.escape_debug())
        };
        check_type(of).with_context(|| format!("{name} cannot have {named}"))?;
        check_references::<M>(variable)?;
    }
    let is_time = |variable: &&Variable<M>| variable.causality() == Causality::Independent;
    ensure!(
        M::TABLE.iter().filter(is_time).count() <= 1,
        "there are two independent variables (section 2.2.7)"
    );
    check_derivatives::<M>()?;
    let mut starts = check_starts::<M>()?;
    check_indicators::<M>()?;
    check_changes::<M>(changes, &mut starts)?;
    Ok(starts)
}

/// The interface types that the model offers.
pub(crate) fn interfaces<M: Exported>() -> impl Iterator<Item = Interface> {
    let co_simulation = M::CO_SIMULATION.map(|_| Interface::CoSimulation);
    let model_exchange = M::MODEL_EXCHANGE.map(|_| Interface::ModelExchange);
    [co_simulation, model_exchange].into_iter().flatten()
}

/// Whether others may depend on it (section 2.2.8): inputs, states, the time, and what begins with an exact value.
pub(crate) fn is_known<M>(variable: &Variable<M>) -> bool {
    matches!(variable.causality(), Causality::Input | Causality::Independent)
        || variable.is_state()
        || is_exact(variable)
}

/// Whether it begins with exactly its start value, which may be changed.
pub(crate) fn is_exact<M>(variable: &Variable<M>) -> bool {
    variable.initial() == Some(Initial::Exact) && variable.variability() != Variability::Constant
}

fn is_line(text: &str) -> bool {
    !text.chars().any(char::is_control)
}

fn is_text(name: &str) -> bool {
    !name.is_empty() && is_line(name)
}

fn is_identifier(text: &str) -> bool {
    let is_letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    text.starts_with(is_letter) && text.chars().all(|c| is_letter(c) || c.is_ascii_digit())
}

/// Section 2.2.9 of FMI 2.0, 2.4.7.5 of FMI 3.0: `a.'b c'[1,2].d`, `der(a[1])`, `der(a, 2)`.
fn is_structured(name: &str) -> bool {
    if let Some(differentiated) = name.strip_prefix("der(").and_then(|name| name.strip_suffix(')')) {
        // A comma within brackets separates indices.
        return match differentiated.rsplit_once(',') {
            Some((of, order)) if is_number(order.trim()) => is_path(of),
            _ => is_path(differentiated),
        };
    }
    is_path(name)
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit())
}

/// Names with indices or without, with dots between them.
fn is_path(mut rest: &str) -> bool {
    loop {
        rest = match rest.strip_prefix('\'') {
            Some(quoted) => {
                let mut escaped = false;
                let end = quoted.find(|c| {
                    let ends = c == '\'' && !escaped;
                    escaped = c == '\\' && !escaped;
                    ends
                });
                match end {
                    Some(end) if end > 0 => &quoted[end + 1..],
                    _ => return false,
                }
            }
            None => {
                let end = rest.find(['[', '.']).unwrap_or(rest.len());
                if !is_identifier(&rest[..end]) {
                    return false;
                }
                &rest[end..]
            }
        };
        if let Some(indices) = rest.strip_prefix('[') {
            let Some((indices, behind)) = indices.split_once(']') else { return false };
            if !indices.split(',').all(is_number) {
                return false;
            }
            rest = behind;
        }
        match rest.strip_prefix('.') {
            Some(behind) => rest = behind,
            None => return rest.is_empty(),
        }
    }
}

fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

fn check_info(info: &Info) -> Result<()> {
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
    ensure!(is_text(info.guid), "{} has no guid", info.name);
    for (what, text) in [
        ("description", info.description),
        ("author", info.author),
        ("version", info.version),
        ("license", info.license),
        ("copyright", info.copyright),
    ] {
        ensure!(is_line(text), "the {what} of {} is more than one line", info.name);
    }
    let of = &info.default_experiment;
    for (name, value) in [("start time", of.start_time), ("stop time", of.stop_time)] {
        ensure!(value.is_finite(), "the {name} of the default experiment must be finite, it is {value}");
    }
    for (name, value) in [("step size", of.step_size), ("tolerance", of.tolerance)] {
        ensure!(is_positive(value), "the {name} of the default experiment must be > 0, it is {value}");
    }
    ensure!(
        of.stop_time >= of.start_time,
        "the default experiment ends at {}, before its start at {}",
        of.stop_time,
        of.start_time
    );
    Ok(())
}

fn check_type(of: &Type) -> Result<()> {
    ensure!(is_line(of.name), "its name is more than one line");
    match of.attributes {
        Attributes::Real { quantity, unit, min, max, nominal } => {
            ensure!(is_line(quantity), "its quantity '{}' is more than one line", quantity.escape_debug());
            for (what, limit) in [("min", min), ("max", max)] {
                let limit = limit.map(|limit| rounded(of.base(), limit));
                ensure!(limit.is_none_or(f64::is_finite), "{what} must be a finite number");
            }
            if let (Some(min), Some(max)) = (min, max) {
                ensure!(min <= max, "its range is empty: min {min} is above max {max}");
            }
            if let Some(nominal) = nominal {
                ensure!(is_positive(nominal), "the nominal value must be > 0, it is {nominal}");
            }
            check_unit(unit)
        }
        Attributes::Integer { min, max } => {
            ensure!(min <= max, "its range is empty: min {min} is above max {max}");
            Ok(())
        }
        Attributes::Enumeration(items) => {
            ensure!(!of.name.is_empty(), "an Enumeration needs a name (section 2.2.7)");
            ensure!(!items.is_empty(), "it has no items");
            let (mut names, mut values) = (HashSet::new(), HashSet::new());
            for item in items {
                ensure!(
                    is_text(item.name),
                    "the item '{}' is empty or more than one line",
                    item.name.escape_debug()
                );
                ensure!(
                    is_line(item.description),
                    "the description of its item {} is more than one line",
                    item.name
                );
                ensure!(names.insert(item.name), "it has two items with the name {}", item.name);
                ensure!(values.insert(item.value), "it has two items with the value {}", item.value);
            }
            Ok(())
        }
        Attributes::Binary { mime_type, .. } => {
            ensure!(
                is_text(mime_type),
                "its MIME type '{}' is empty or more than one line",
                mime_type.escape_debug()
            );
            Ok(())
        }
        _ => Ok(()),
    }
}

/// The number as variables of the type have it.
pub(crate) fn rounded(base: BaseType, number: f64) -> f64 {
    match base {
        BaseType::Float32 => f64::from(number as f32),
        _ => number,
    }
}

fn check_unit(unit: &Unit) -> Result<()> {
    let display = unit.display.map(|display| ("display unit", display.name, display.factor, display.offset));
    let own = ("unit", unit.name, unit.base.factor, unit.base.offset);
    for (what, name, factor, offset) in [own].into_iter().chain(display) {
        ensure!(
            is_text(name),
            "the name '{}' of its {what} is empty or more than one line",
            name.escape_debug()
        );
        ensure!(
            factor.is_finite() && factor != 0.0,
            "the factor of the {what} {name} must be finite and not 0, it is {factor}"
        );
        ensure!(offset.is_finite(), "the offset of the {what} {name} must be finite, it is {offset}");
    }
    Ok(())
}

/// What the variable differentiates, and what it depends on.
fn check_references<M: Exported>(variable: &Variable<M>) -> Result<()> {
    let name = variable.name();
    if let Some(of) = variable.differentiates() {
        let of = &M::TABLE[of as usize];
        ensure!(
            of.base() == BaseType::Real && of.variability() == Variability::Continuous && of.name() != name,
            "{name} cannot be the derivative of {}",
            of.name()
        );
    }
    let mut before = HashSet::new();
    for known in variable.dependencies().into_iter().flatten() {
        let known = &M::TABLE[known as usize];
        ensure!(
            is_known(known),
            "{name} depends on {}, which is calculated or constant; name the inputs, states and parameters that it \
             follows from",
            known.name()
        );
        ensure!(before.insert(known.name()), "{name} names {} twice among what it depends on", known.name());
    }
    Ok(())
}

/// A state without derivative is refused when the model is compiled.
fn check_derivatives<M: Exported>() -> Result<()> {
    for state in M::STATES.iter().map(|state| state.state) {
        let is_derivative = |v: &&Variable<M>| v.differentiates() == Some(state);
        let count = M::TABLE.iter().filter(is_derivative).count();
        let name = M::TABLE[state as usize].name();
        ensure!(count == 1, "the state {name} has {count} derivatives among the variables");
    }
    Ok(())
}

/// The start values are those of a new model, the same for each interface type.
fn check_starts<M: Exported>() -> Result<Starts> {
    let mut all: Vec<(Interface, Starts)> = Vec::new();
    for interface in interfaces::<M>() {
        let model = new_model::<M>(interface)?;
        let start = |variable: &Variable<M>| {
            let value = catch_unwind(AssertUnwindSafe(|| variable.value(&model))).map_err(|_| {
                anyhow!(
                    "{} cannot be read from a new model: what stands behind its `in` or `by` panics, as with an index that \
                     is not there",
                    variable.name()
                )
            })?;
            Ok(value.filter(|_| variable.has_start()))
        };
        all.push((interface, M::TABLE.iter().map(start).collect::<Result<_>>()?));
    }
    for (_, starts) in &all {
        for (variable, start) in M::TABLE.iter().zip(starts) {
            if let Some(start) = start {
                check_value(
                    &format!("the start value of {}", variable.name()),
                    variable.variable_type(),
                    start,
                )?;
            }
        }
    }
    if let [(one, starts), (other, others)] = all.as_slice() {
        for (variable, pair) in M::TABLE.iter().zip(starts.iter().zip(others)) {
            if let (Some(start), Some(another)) = pair {
                let name = variable.name();
                ensure!(
                    start == another,
                    "{name} starts with {start} in {one} and with {another} in {other}"
                );
            }
        }
    }
    Ok(all.swap_remove(0).1)
}

/// An indicator that is never filled in would be an event that never happens.
fn check_indicators<M: Exported>() -> Result<()> {
    let Some(offer) = M::MODEL_EXCHANGE else { return Ok(()) };
    let mut model = new_model::<M>(Interface::ModelExchange)?;
    model.calculate(0.0);
    let fill = |mark: f64| {
        let mut indicators = vec![mark; offer.indicators];
        model.exported_indicators(&mut indicators);
        indicators
    };
    let forgotten = fill(1.0).iter().zip(fill(2.0)).position(|(one, two)| (*one, two) == (1.0, 2.0));
    match forgotten {
        Some(place) => bail!("{}: indicators() does not fill in indicator {place}", M::INFO.name),
        None => Ok(()),
    }
}

fn new_model<M: Exported>(interface: Interface) -> Result<M> {
    M::new(&Setup::new(interface))
        .map_err(|error| anyhow!("the model cannot be made for {interface}: {error}"))
}

/// Whether the type has the value.
fn check_value(what: &str, of: &Type, value: &Value) -> Result<()> {
    match (of.attributes, value) {
        (Attributes::Real { min, max, .. }, Value::Real(real)) => {
            ensure!(real.is_finite(), "{what} must be a finite number, it is {value}");
            if let Some(min) = min {
                let fits = *real >= rounded(of.base(), min);
                ensure!(fits, "{what} must be >= {}, it is {value}", Value::Real(min));
            }
            if let Some(max) = max {
                let fits = *real <= rounded(of.base(), max);
                ensure!(fits, "{what} must be <= {}, it is {value}", Value::Real(max));
            }
        }
        (Attributes::Integer { min, max }, Value::Integer(value)) => {
            ensure!((min..=max).contains(value), "{what} must be between {min} and {max}, it is {value}");
        }
        (Attributes::Enumeration(items), Value::Integer(value)) => {
            let known: Vec<_> = items.iter().map(|item| format!("{} ({})", item.value, item.name)).collect();
            let is_known = items.iter().any(|item| i128::from(item.value) == *value);
            ensure!(is_known, "{what} must be one of {}, it is {value}", known.join(", "));
        }
        (Attributes::Binary { max_size, .. }, Value::Binary(bytes)) => {
            let size = bytes.len();
            ensure!(size <= max_size, "{what} must have at most {max_size} bytes, it has {size}");
        }
        (Attributes::String, Value::String(text)) => {
            // Lines and tabs are all that XML 1.0 has of them.
            let is_possible = |c: char| !c.is_control() || matches!(c, '\t' | '\n' | '\r');
            ensure!(text.chars().all(is_possible), "{what} has a character that XML has not: {text:?}");
        }
        _ => {}
    }
    Ok(())
}

/// Other start values must be possible for their variables, and together make a model, or the FMU could not
/// be instantiated.
fn check_changes<M: Exported>(changes: &Changes, starts: &mut Starts) -> Result<()> {
    for (name, text) in &changes.start {
        let Some(place) = M::TABLE.iter().position(|variable| variable.name() == name) else {
            bail!("there is no variable {name} to give a start value to");
        };
        let variable = &M::TABLE[place];
        ensure!(
            variable.has_start() && variable.variability() != Variability::Constant,
            "{name} is calculated or constant: it takes no start value"
        );
        let value = read_value(variable.base(), text)
            .with_context(|| format!("the start value of {name} cannot be"))?;
        check_value(name, variable.variable_type(), &value)?;
        starts[place] = Some(value);
    }
    for interface in interfaces::<M>() {
        let mut model = new_model::<M>(interface)?;
        for (variable, start) in M::TABLE.iter().zip(&*starts) {
            if let Some(start) = start {
                variable.set(&mut model, start);
                model.calculate_start();
            }
        }
        model.update().map_err(|error| anyhow!("these start values make no model: {error}"))?;
    }
    Ok(())
}
