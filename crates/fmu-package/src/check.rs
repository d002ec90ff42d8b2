//! Rejects malformed models before they are evaluated and described.
//!
//! The compiler has already checked the causality, variability and field of each variable.

use crate::instance::Instance;
use crate::model::LoadedModel;
use crate::table::{Info, Start, Table, Variable};
use anyhow::{Context, Result, anyhow, bail, ensure};
use fmi_abi::{
    BaseType, BaseUnit, Causality, Standard, Unit, Value, Variability, empty_range, ends_too_early,
    is_c_identifier, is_structured_name,
};
use std::collections::HashSet;
use std::fmt::Display;

/// Start values by index; `None` for a variable without start value.
pub(crate) type Starts = Vec<Option<Value>>;

/// Checks the model and returns its start values.
pub(crate) fn check(model: &LoadedModel) -> Result<Starts> {
    let table = &model.table;
    check_info(&table.info)?;
    ensure!(
        table.interfaces().next().is_some(),
        "{} offers neither Co-Simulation nor Model Exchange",
        table.info.name
    );
    check_smooth(table)?;
    for variable in &table.variables {
        let name = &variable.name;
        check_name("the variable name", name)?;
        check_line(format_args!("the description of {name}"), &variable.description)?;
        ensure!(
            !table.arrays || is_structured_name(name),
            "the variable name '{}' is not a name of the structured naming convention, which a model with arrays needs: \
             write names as in Modelica, such as motor.torque, der(x), or 'any text' (section 2.2.9 of FMI 2.0)",
            name.escape_debug()
        );
        let named = match &variable.declared_type {
            None => "its type".to_owned(),
            Some(declared) => format!("the type {}", declared.escape_debug()),
        };
        check_type(variable).with_context(|| format!("{name} cannot have {named}"))?;
        check_references(table, variable)?;
    }
    let is_time = |variable: &Variable| variable.causality == Causality::Independent;
    ensure!(table.find(is_time).len() <= 1, "there are two independent variables (section 2.2.7 of FMI 2.0)");
    check_derivatives(table)?;
    check_units(table)?;
    let starts = check_starts(table)?;
    check_model(model, &starts)?;
    Ok(starts)
}

/// Rejects `smooth` for a model with events, because its dependencies are searched near the start values only, where a branch that an
/// event selects later has no effect.
fn check_smooth(table: &Table) -> Result<()> {
    let exchange = table.model_exchange.as_ref();
    let stops = table.co_simulation.as_ref().is_some_and(|offer| offer.event_mode);
    let found = match table.indicators() {
        0 if exchange.is_some_and(|offer| offer.step_completed) => "STEP_COMPLETED",
        0 if stops => "EVENTS",
        0 => return Ok(()),
        _ => "INDICATORS",
    };
    ensure!(
        !table.info.smooth,
        "{} has events ({found}), so its equations are not smooth, and dependencies that show only after an event would be missing; \
         leave `smooth` out of INFO and name what each output and derivative follows from with `depends_on`",
        table.info.name
    );
    Ok(())
}

/// Fails if a text is not a single line, because an importer shows it as one.
pub(crate) fn check_line(label: impl Display, text: &str) -> Result<()> {
    ensure!(!text.contains(char::is_control), "{label} has a line break or another control character");
    Ok(())
}

/// Fails if a name is empty or not a single line. The message has the name after the label.
pub(crate) fn check_name(label: impl Display, name: &str) -> Result<()> {
    ensure!(
        !name.is_empty() && !name.contains(char::is_control),
        "{label} '{}' is empty or has a line break or another control character",
        name.escape_debug()
    );
    Ok(())
}

fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

fn check_info(info: &Info) -> Result<()> {
    check_name("the model's name", &info.name)?;
    ensure!(
        is_c_identifier(&info.identifier),
        "the identifier '{}' must be a C identifier: letters, digits and underscores, and not a digit first",
        info.identifier.escape_debug()
    );
    for (fact, text) in [
        ("description", &info.about.description),
        ("author", &info.about.author),
        ("version", &info.about.version),
        ("license", &info.about.license),
        ("copyright", &info.about.copyright),
    ] {
        check_line(format_args!("the {fact} of {}", info.name), text)?;
    }
    for (name, value) in [("start time", info.start_time), ("stop time", info.stop_time)] {
        ensure!(value.is_finite(), "the {name} of the default experiment must be finite, it is {value}");
    }
    for (name, value) in [("step size", info.step_size), ("tolerance", info.tolerance)] {
        ensure!(
            is_positive(value),
            "the {name} of the default experiment must be finite and > 0, it is {value}"
        );
    }
    none(ends_too_early(info.start_time, info.stop_time))
}

/// Fails with the reason, if there is one.
fn none(reason: Option<String>) -> Result<()> {
    reason.map_or(Ok(()), |why| Err(anyhow!(why)))
}

fn check_type(variable: &Variable) -> Result<()> {
    let of = &variable.attributes;
    variable.declared_type.iter().try_for_each(|name| check_line("its name", name))?;
    if let Some(quantity) = &of.quantity {
        check_line(format_args!("its quantity '{}'", quantity.escape_debug()), quantity)?;
    }
    if variable.is_float() {
        let limits = [("min", variable.min()), ("max", variable.max())];
        for (name, limit) in limits {
            let limit = limit.map(|limit| rounded(variable.base, limit));
            ensure!(limit.is_none_or(f64::is_finite), "{name} must be a finite number");
        }
        if let [(_, Some(min)), (_, Some(max))] = limits {
            none(empty_range(min, max)).context("its range is empty")?;
        }
    }
    if let Some((min, max)) = variable.range() {
        none(empty_range(min, max)).context("its range is empty")?;
    }
    if let Some(nominal) = of.nominal {
        ensure!(is_positive(nominal), "the nominal value must be finite and > 0, it is {nominal}");
    }
    if let (Some(name), Some(unit)) = (&of.unit, &variable.unit) {
        check_unit(name, unit)?;
    }
    if variable.base == BaseType::Enumeration {
        check_items(variable)?;
    }
    of.mime_type.iter().try_for_each(|mime_type| check_name("its MIME type", mime_type))
}

fn check_items(variable: &Variable) -> Result<()> {
    let is_declared = variable.declared_type.is_some();
    ensure!(is_declared, "an Enumeration needs a name (section 2.2.7 of FMI 2.0)");
    ensure!(!variable.items.is_empty(), "it has no items");
    let (mut names, mut values) = (HashSet::new(), HashSet::new());
    for item in &variable.items {
        check_name("the item", &item.name)?;
        check_line(format_args!("the description of its item {}", item.name), &item.description)?;
        ensure!(names.insert(&item.name), "it has two items with the name {}", item.name);
        ensure!(values.insert(item.value), "it has two items with the value {}", item.value);
    }
    Ok(())
}

/// Rounds a number to the precision of the type.
pub(crate) fn rounded(base: BaseType, number: f64) -> f64 {
    match base {
        BaseType::Float32 => f64::from(number as f32),
        _ => number,
    }
}

fn check_unit(name: &str, unit: &Unit) -> Result<()> {
    let displays = unit.display_units.iter().map(|of| ("display unit", &*of.name, of.factor, of.offset));
    let own = unit.base.iter().map(|base| ("unit", name, base.factor, base.offset));
    for (kind, name, factor, offset) in own.chain(displays) {
        check_name(format_args!("the name of its {kind}"), name)?;
        ensure!(
            factor.is_finite() && factor != 0.0,
            "the factor of the {kind} {name} must be finite and not 0, it is {factor}"
        );
        ensure!(offset.is_finite(), "the offset of the {kind} {name} must be finite, it is {offset}");
    }
    Ok(())
}

/// Checks the variables that a variable refers to: the variable whose derivative it is, and the variables in its `depends_on`.
fn check_references(table: &Table, variable: &Variable) -> Result<()> {
    let name = &variable.name;
    if let Some(index) = variable.derivative_of {
        let other = &table.variables[index];
        ensure!(
            other.base == BaseType::Real
                && other.variability == Variability::Continuous
                && other.name != *name,
            "{name} cannot be the derivative of {}",
            other.name
        );
    }
    if let Some(other) = name.strip_prefix("der(").and_then(|name| name.strip_suffix(')'))
        && variable.derivative_of.is_none()
    {
        ensure!(
            !table.variables.iter().any(|variable| variable.name == other),
            "{name} is the name of the derivative of {other}; add `.derivative_of({other})`, or rename it"
        );
    }
    let mut before = HashSet::new();
    for known in variable.dependencies.iter().flatten() {
        let known = &table.variables[*known as usize];
        ensure!(
            known.is_known(),
            "{name} depends on {}, which is calculated or constant; name the inputs, states and parameters from which it \
             is calculated",
            known.name
        );
        ensure!(before.insert(&known.name), "{name} names {} twice in its depends_on", known.name);
    }
    Ok(())
}

/// Checks that each state has exactly one derivative.
fn check_derivatives(table: &Table) -> Result<()> {
    for &(state, _) in &table.states {
        let count = table.find(|variable| variable.derivative_of == Some(state as usize)).len();
        let name = table.name(state);
        ensure!(count == 1, "the state {name} has {count} derivatives among the variables");
    }
    Ok(())
}

/// Index in `fmi_abi::BASE_UNITS`.
const SECOND: usize = 2;

/// Rejects a derivative whose unit is not the unit of its state per second. A variable without a unit is not checked, and the radian
/// may be left out.
fn check_units(table: &Table) -> Result<()> {
    for &(state, rate) in &table.states {
        let of = |index: u32| {
            let variable = table.variable(index)?;
            Some((variable.attributes.unit.as_deref()?, variable.unit.as_ref()?.base?))
        };
        let (Some((unit, of_state)), Some((unit_of_rate, of_rate))) = (of(state), of(rate)) else { continue };
        let has_unit = |unit: BaseUnit| unit.exponents.iter().any(|exponent| *exponent != 0);
        if !has_unit(of_rate) || !has_unit(of_state) && of_state.factor == 1.0 && unit != "1" {
            continue;
        }
        let mut per_second = of_state;
        per_second.exponents[SECOND] -= 1;
        let [expected, found] = [per_second, of_rate].map(without_radian);
        let [name, name_of_rate] = [state, rate].map(|index| table.name(index));
        ensure!(
            expected == found,
            "{name_of_rate} is in {} ({found}), but {name} is in {}, so the unit of its derivative has the exponents {expected}",
            unit_of_rate,
            unit
        );
        ensure!(
            (of_state.factor - of_rate.factor).abs() <= 1e-9 * of_state.factor.abs(),
            "{name_of_rate} is in {}, whose factor is {}, but {name} is in {}, whose factor is {}; importers integrate the numbers, so \
             both factors must be equal",
            unit_of_rate,
            of_rate.factor,
            unit,
            of_state.factor
        );
    }
    Ok(())
}

/// Returns the exponents of a unit as tools write them, without the radian.
fn without_radian(unit: BaseUnit) -> String {
    Some(unit.without_radian().symbol()).filter(|symbol| !symbol.is_empty()).unwrap_or("none".to_owned())
}

/// Returns the start values of a new model, after checking that they fit their types and are the same for each interface type. Also checks
/// that the model calculates all event indicators.
fn check_starts(table: &Table) -> Result<Starts> {
    let (mut all, mut forgotten) = (Vec::new(), None);
    for (interface, start) in &table.starts {
        match start {
            Start::Values { values, forgotten_indicator } => {
                all.push((interface, values));
                forgotten = forgotten.or(*forgotten_indicator);
            }
            Start::Unreadable(index) => bail!(
                "{} cannot be read from a new model: the code behind its `in` or `by` panics, for example because of an \
                 index out of bounds",
                table.variables[*index].name
            ),
            Start::Error(error) => bail!("the model cannot be instantiated for {interface}: {error}"),
        }
    }
    for (_, starts) in &all {
        for (variable, start) in table.variables.iter().zip(*starts) {
            if let Some(start) = start {
                check_value(&format!("the start value of {}", variable.name), variable, start)?;
            }
        }
    }
    if let [(one, starts), (other, others)] = all.as_slice() {
        for (variable, pair) in table.variables.iter().zip(starts.iter().zip(*others)) {
            if let (Some(start), Some(another)) = pair {
                let name = &variable.name;
                ensure!(
                    start == another,
                    "{name} starts with {start} in {one} and with {another} in {other}"
                );
            }
        }
    }
    // An indicator that `indicators()` never writes would never cause an event.
    if let Some(number) = forgotten {
        bail!("{}: indicators() does not fill in indicator {number}", table.info.name);
    }
    Ok(all.swap_remove(0).1.clone())
}

/// Checks that a value fits its type: the range, the items of an Enumeration, the size of bytes, and the characters of a string.
fn check_value(label: &str, variable: &Variable, value: &Value) -> Result<()> {
    match value {
        Value::Real(real) => {
            ensure!(real.is_finite(), "{label} must be a finite number, it is {value}");
            if let Some(min) = variable.min() {
                let fits = *real >= rounded(variable.base, min);
                ensure!(fits, "{label} must be >= {}, it is {value}", Value::Real(min));
            }
            if let Some(max) = variable.max() {
                let fits = *real <= rounded(variable.base, max);
                ensure!(fits, "{label} must be <= {}, it is {value}", Value::Real(max));
            }
        }
        Value::Integer(value) if variable.base == BaseType::Enumeration => {
            let items = &variable.items;
            let known: Vec<_> = items.iter().map(|item| format!("{} ({})", item.value, item.name)).collect();
            let is_known = items.iter().any(|item| i128::from(item.value) == *value);
            ensure!(is_known, "{label} must be one of {}, it is {value}", known.join(", "));
        }
        Value::Integer(value) => {
            let Some((min, max)) = variable.range() else { return Ok(()) };
            ensure!((min..=max).contains(value), "{label} must be between {min} and {max}, it is {value}");
        }
        Value::Binary(bytes) => {
            let (size, max_size) = (bytes.len() as u64, variable.attributes.max_size);
            if let Some(max_size) = max_size.filter(|max_size| size > *max_size) {
                bail!("{label} must have at most {max_size} bytes, it has {size}");
            }
        }
        Value::String(text) => {
            // XML 1.0 forbids most other control characters, and discourages the rest (U+007F to U+009F).
            let is_possible = |c: char| !c.is_control() || matches!(c, '\t' | '\n' | '\r');
            ensure!(
                text.chars().all(is_possible),
                "{label} has a control character that must not be in XML: {text:?}"
            );
        }
        Value::Boolean(_) => {}
    }
    Ok(())
}

/// Checks that the model accepts its start values when an importer sets them.
fn check_model(model: &LoadedModel, starts: &Starts) -> Result<()> {
    for interface in model.table.interfaces() {
        let mut instance =
            Instance::new(model, interface, Standard::Fmi3, false).map_err(|error| anyhow!("{error}"))?;
        let is_set =
            |variable: &Variable| variable.has_start() && variable.variability != Variability::Constant;
        instance
            .set(starts, is_set)
            .map_err(|error| anyhow!("the model rejects its start values: {error}"))?;
    }
    Ok(())
}
