//! The dependencies between variables, and their kinds (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
//!
//! The model is evaluated at points near its start values, which are the same in every build. If its equations are `smooth`, an unknown
//! that does not react to a known at any point does not depend on it, unless its `depends_on` lists the known, and a factor that is the
//! same at all points is constant. For other models this proves nothing, so they are not evaluated: an unknown depends on the variables in
//! its `depends_on`, or on every known if it has no `depends_on`.

use crate::check::{Starts, check};
use crate::model::LoadedModel;
use crate::sample::{Point, Sampler, is_finite};
use crate::table::{Table, Variable};
use anyhow::{Result, bail, ensure};
use fmi_abi::{BaseType, Causality, DependencyKind, Initial, Standard, Value, Variability};
use std::collections::{HashMap, HashSet};

/// Returns the start values of a model. The first call checks the model.
///
/// # Errors
/// When the model contradicts itself.
pub(crate) fn checked_starts(model: &LoadedModel) -> Result<&Starts> {
    if let Some(starts) = model.starts.get() {
        return Ok(starts);
    }
    let starts = check(model)?;
    Ok(model.starts.get_or_init(|| starts))
}

/// The unknowns, each with its dependencies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelStructure {
    /// The outputs, sorted by index.
    pub outputs: Vec<Unknown>,
    /// The derivatives of the states, in the order of the states; empty if no importer can use them.
    pub derivatives: Vec<Unknown>,
    /// The variables that are calculated during initialization, sorted by index.
    pub initial_unknowns: Vec<Unknown>,
}

/// A variable that depends on others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Its index in the table, which is its value reference in FMI 2.0.
    pub index: u32,
    /// The indices of the variables that it depends on, each with the kind of dependency.
    pub dependencies: Vec<(u32, DependencyKind)>,
}

impl ModelStructure {
    /// Finds the structure of a model. All its parameters are taken as tunable if `tunable_parameters` is true.
    ///
    /// In FMI 3.0, unknowns also depend on parameters, and on the time even if the model does not declare it. An array is one unknown
    /// or known in FMI 3.0: it has the index of its first element and the dependencies of all its elements.
    ///
    /// # Errors
    /// When the model contradicts itself or rejects its start values. If the model is `smooth`, also when it rejects every change of a
    /// variable, and when an unknown reacts to a variable that its `depends_on` does not name.
    pub fn of(model: &LoadedModel, fmi: Standard, tunable_parameters: bool) -> Result<Self> {
        let starts = checked_starts(model)?;
        let table = &model.table;
        let Lists { outputs, derivatives, knowns, initial_unknowns, initial_knowns } = Lists::of(table, fmi);
        let unknowns = [&outputs[..], &derivatives].concat();
        let mut sampler = Sampler::new(model, starts.clone(), tunable_parameters);
        sampler.running = true;
        let running = found(&mut sampler, &unknowns, &knowns)?;
        sampler.running = false;
        let initial = found(&mut sampler, &initial_unknowns, &initial_knowns)?;
        let running = running.into_iter().enumerate().map(|(number, unknown)| {
            // An output that is a state depends only on itself, because its value was set or calculated by the last step.
            if number < outputs.len() && table.variables[unknown.index as usize].state {
                let itself = knowns.iter().filter(|known| **known == unknown.index);
                let dependencies = itself.map(|known| (*known, DependencyKind::Constant)).collect();
                return Ok(Unknown { dependencies, ..unknown });
            }
            with_declared(table, unknown, &knowns)
        });
        let mut running = running.collect::<Result<Vec<_>>>()?;
        let derivatives = running.split_off(outputs.len());
        let initial = initial.into_iter().map(|unknown| with_declared(table, unknown, &initial_knowns));
        let lists = [running, derivatives, initial.collect::<Result<_>>()?];
        let [outputs, derivatives, initial_unknowns] = match fmi {
            Standard::Fmi2 => lists,
            Standard::Fmi3 => lists.map(|list| of_arrays(table, list)),
        };
        Ok(Self { outputs, derivatives, initial_unknowns })
    }
}

/// The indices of the unknowns and of the knowns.
struct Lists {
    outputs: Vec<u32>,
    derivatives: Vec<u32>,
    knowns: Vec<u32>,
    initial_unknowns: Vec<u32>,
    initial_knowns: Vec<u32>,
}

impl Lists {
    fn of(table: &Table, fmi: Standard) -> Self {
        let is_fmi3 = fmi == Standard::Fmi3;
        // Without these capabilities, no importer can use the states.
        let has_states = table.model_exchange.is_some() || table.partials;
        let outputs = table.find(|variable| variable.causality == Causality::Output);
        let states = if has_states { &table.states[..] } else { &[] };
        let (states, derivatives): (Vec<u32>, Vec<u32>) = states.iter().copied().unzip();
        let unlisted = Some(table.time()).filter(|time| is_fmi3 && table.variable(*time).is_none());
        let mut knowns = table.find(|variable| {
            matches!(variable.causality, Causality::Input | Causality::Independent)
                || has_states && variable.state
                || is_fmi3 && variable.causality == Causality::Parameter
        });
        knowns.extend(unlisted);
        let calculated = table.find(|variable| variable.causality == Causality::CalculatedParameter);
        let mut initial_unknowns = [&outputs[..], &calculated, &states, &derivatives].concat();
        initial_unknowns.retain(|index| {
            matches!(table.variables[*index as usize].initial, Some(Initial::Approx | Initial::Calculated))
        });
        initial_unknowns.sort_unstable();
        initial_unknowns.dedup();
        let mut initial_knowns =
            table.find(|variable| variable.is_known() && (!variable.state || variable.is_exact()));
        initial_knowns.extend(unlisted);
        Self { outputs, derivatives, knowns, initial_unknowns, initial_knowns }
    }
}

/// Merges the elements of each array into one unknown.
fn of_arrays(table: &Table, unknowns: Vec<Unknown>) -> Vec<Unknown> {
    let first = |index: u32| table.variable(index).map_or(index, |variable| index - variable.element as u32);
    let mut list: Vec<Unknown> = Vec::new();
    for unknown in unknowns {
        let index = first(unknown.index);
        if list.last().is_none_or(|last| last.index != index) {
            list.push(Unknown { index, dependencies: Vec::new() });
        }
        let Some(Unknown { dependencies, .. }) = list.last_mut() else { continue };
        for (known, kind) in unknown.dependencies {
            let known = first(known);
            match dependencies.iter_mut().find(|(other, _)| *other == known) {
                Some((_, other)) => *other = kind.max(*other),
                None => dependencies.push((known, kind)),
            }
        }
        dependencies.sort_unstable();
    }
    list
}

/// Adds the dependencies that the model declares, or that the evaluations cannot rule out. Fails if the evaluations find a dependency that
/// is missing in `depends_on`.
fn with_declared(table: &Table, found: Unknown, knowns: &[u32]) -> Result<Unknown> {
    let unknown = &table.variables[found.index as usize];
    let declared: Option<HashSet<u32>> =
        unknown.dependencies.as_ref().map(|indices| indices.iter().copied().collect());
    let is_declared = |known: u32| {
        known == table.time() && unknown.depends_on_time
            || declared.as_ref().is_none_or(|declared| declared.contains(&known))
    };
    if let Some((hidden, _)) = found.dependencies.iter().find(|(index, _)| !is_declared(*index)) {
        bail!("{} reacts to {}, which its depends_on does not name", unknown.name, table.name(*hidden));
    }
    if unknown.variability == Variability::Constant {
        return Ok(found);
    }
    // Strings and bytes are not changed in the evaluations.
    let is_tried = |index: u32| {
        table.variable(index).is_none_or(|known| !matches!(known.base, BaseType::String | BaseType::Binary))
    };
    let kinds: HashMap<u32, DependencyKind> = found.dependencies.iter().copied().collect();
    let smooth = table.info.smooth;
    let kind = |known: u32| match kinds.get(&known) {
        Some(kind) if smooth => Some(*kind),
        None if smooth && declared.is_none() && is_tried(known) => None,
        _ => is_declared(known).then_some(DependencyKind::Dependent),
    };
    let dependencies = knowns.iter().filter_map(|&known| Some((known, kind(known)?))).collect();
    Ok(Unknown { dependencies, ..found })
}

/// Returns the unknowns with the dependencies that the evaluations of a smooth model find: from the partial derivatives if the model
/// provides them and is running, else from changes of the values.
fn found(sampler: &mut Sampler, unknowns: &[u32], knowns: &[u32]) -> Result<Vec<Unknown>> {
    let table = &sampler.model.table;
    let unknown = |index: &u32| Unknown { index: *index, dependencies: Vec::new() };
    let mut list: Vec<Unknown> = unknowns.iter().map(unknown).collect();
    if list.is_empty() || !table.info.smooth {
        return Ok(list);
    }
    let is_real = |index: u32| table.variable(index).is_some_and(|variable| variable.base == BaseType::Real);
    let reals: Vec<u32> = unknowns.iter().copied().filter(|index| is_real(*index)).collect();
    // During initialization, the kinds `fixed` and `tunable` are not allowed.
    let with_partials = table.partials && sampler.running;
    let mut samples = if with_partials { sampler.factor_samples()? } else { Vec::new() };
    // Derivatives with respect to parameters are available only in Initialization Mode, which is not sampled here.
    let is_differentiable = |index: u32| {
        let causality = table.variable(index).map(|variable| variable.causality);
        is_real(index) && !matches!(causality, Some(Causality::Independent | Causality::Parameter))
    };
    let bases = sampler.bases()?;
    for (number, &known) in knowns.iter().enumerate() {
        sampler.model.monitor.progress("finds what depends on each variable", number, knowns.len());
        let differentiable = is_differentiable(known) && !reals.is_empty();
        let partials: Vec<_> = samples
            .iter_mut()
            .filter(|_| differentiable)
            .map(|sample| ((sample.fixed, sample.tunable), sample.instance.partials(&reals, known)))
            .collect();
        let mut others = Vec::new();
        for unknown in &mut list {
            let position = reals.iter().position(|real| *real == unknown.index);
            let factors = partials.iter().map(|(numbers, factors)| Some((*numbers, factors[position?]?)));
            match factors.collect::<Option<Vec<_>>>().filter(|factors| !factors.is_empty()) {
                Some(factors) => {
                    unknown.dependencies.extend(factor_kind(&factors).map(|kind| (known, kind)));
                }
                None => others.push(unknown),
            }
        }
        let indices: Vec<u32> = others.iter().map(|unknown| unknown.index).collect();
        let reactions = sampler.reactions(&bases, known, &indices)?;
        for (number, unknown) in others.into_iter().enumerate() {
            let Some(ratios) = reactions.of(number) else { continue };
            let is_constant = |ratios: Vec<f64>| ratios.iter().all(|ratio| close(*ratio, ratios[0], 1e-7));
            let kind = match ratios.is_some_and(is_constant) && !sampler.running {
                true => DependencyKind::Constant,
                false => DependencyKind::Dependent,
            };
            unknown.dependencies.push((known, kind));
        }
    }
    Ok(list)
}

/// Returns the kind of a dependency with these factors; `None` if they are all zero. Each factor is given with the numbers `fixed` and
/// `tunable` of its sample.
fn factor_kind(factors: &[((usize, usize), f64)]) -> Option<DependencyKind> {
    if factors.iter().all(|(_, factor)| *factor == 0.0) {
        return None;
    }
    // Whether samples that have these numbers in common have the same factor.
    let steady = |in_common: fn(&(usize, usize)) -> (usize, usize)| {
        factors.iter().all(|(numbers, factor)| {
            let like = |(other, _): &&((usize, usize), f64)| in_common(other) == in_common(numbers);
            factors.iter().filter(like).all(|(_, other)| close(*factor, *other, 1e-12))
        })
    };
    Some(if steady(|_| (0, 0)) {
        DependencyKind::Constant
    } else if steady(|(fixed, _)| (*fixed, 0)) {
        DependencyKind::Fixed
    } else if steady(|numbers| *numbers) {
        DependencyKind::Tunable
    } else {
        DependencyKind::Dependent
    })
}

/// The changes of unknowns after a known was changed, at several points.
struct Reactions {
    /// The change of the known at each point; `None` unless the known is a Real that is set.
    changes: Vec<Option<f64>>,
    /// For each point and unknown, the value before and after.
    values: Vec<Vec<[Value; 2]>>,
}

impl Reactions {
    /// Returns `None` if the unknown with this number did not react, and `Some(None)` if it did but is not a Real or the known is not.
    /// If both are Reals, returns the change of the unknown divided by the change of the known at each point.
    fn of(&self, number: usize) -> Option<Option<Vec<f64>>> {
        let pairs = || self.values.iter().map(|values| &values[number]);
        let real = |pair: &[Value; 2]| match *pair {
            [Value::Real(before), Value::Real(after)] => Some([before, after]),
            _ => None,
        };
        let Some(reals) = pairs().map(real).collect::<Option<Vec<_>>>() else {
            return pairs().any(|[before, after]| before != after).then_some(None);
        };
        let scale = reals.iter().flatten().fold(0.0, |scale: f64, value| scale.max(value.abs()));
        // Smaller changes are taken as rounding errors, which occur if the model adds terms that cancel.
        if reals.iter().all(|[before, after]| (after - before).abs() <= 1e-10 * scale) {
            return None;
        }
        let ratio =
            |(change, [before, after]): (&Option<f64>, &[f64; 2])| Some((after - before) / (*change)?);
        Some(self.changes.iter().zip(&reals).map(ratio).collect())
    }
}

/// A point, and the values of all variables at it.
struct Base {
    point: Point,
    values: Vec<Value>,
}

impl Sampler<'_> {
    /// Draws the points around which each known is changed.
    fn bases(&mut self) -> Result<Vec<Base>> {
        let mut base = || {
            let (point, mut instance) = self.draw(None, true, |_| true)?;
            Ok(Base { point, values: instance.values() })
        };
        (0..16).map(|_| base()).collect()
    }

    /// Changes one known at many points and reads the unknowns.
    fn reactions(&mut self, bases: &[Base], known: u32, unknowns: &[u32]) -> Result<Reactions> {
        let table = &self.model.table;
        let mut reactions = Reactions { changes: Vec::new(), values: Vec::new() };
        let variable = table.variable(known);
        let is_known = |other: &Variable| variable.is_some_and(|known| known.name == other.name);
        for base in bases.iter().filter(|_| !unknowns.is_empty()) {
            let (changed, mut after) = self.draw(Some(&base.point), known == table.time(), is_known)?;
            if changed == base.point {
                continue;
            }
            reactions.changes.push(difference(&base.point, &changed, known));
            let after = after.values();
            let pair = |index: &u32| [&base.values, &after].map(|values| values[*index as usize].clone());
            reactions.values.push(unknowns.iter().map(pair).collect());
        }
        if let Some(message) = self.stuck.get(&known)
            && reactions.changes.is_empty()
        {
            let name = table.name(known);
            bail!(
                "{name} cannot be tried separately: the model rejects every other value that is near, from 50 % of it down to \
                 0.0008 %: {message}; let `update` accept some, or leave `smooth` out of INFO and name what follows from \
                 {name} with `depends_on`"
            );
        }
        for (number, unknown) in unknowns.iter().enumerate() {
            let mut values = reactions.values.iter().flat_map(|row| &row[number]);
            let name = table.name(*unknown);
            ensure!(values.all(is_finite), "{name} is not finite near the start values");
        }
        Ok(reactions)
    }
}

/// Returns the change of a variable between two points, if it is a Real and set at both.
fn difference(before: &Point, after: &Point, index: u32) -> Option<f64> {
    match (before.values.get(index as usize)?, after.values.get(index as usize)?) {
        (Some(Value::Real(before)), Some(Value::Real(after))) => Some(after - before),
        _ => None,
    }
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}
