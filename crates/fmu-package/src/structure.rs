//! Which variable depends on which, and how (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
//!
//! A live model is evaluated at points drawn around its start values, always the same ones. If its equations
//! are smooth, what does not react at any of them does not depend, and a factor that
//! never changes is constant. Of other models that proves nothing: there an unknown depends on what it
//! declares (`depends_on`), else on everything, and trying only finds wrong declarations.

use crate::check::{Starts, check};
use crate::derivatives::check as check_derivatives;
use crate::memory;
use crate::model::LoadedModel;
use crate::sample::{Point, Sampler};
use crate::table::{Table, Variable};
use anyhow::{Result, bail, ensure};
use fmi_abi::{BaseType, Causality, Initial, Value, Variability};
use std::collections::{HashMap, HashSet};
use std::fmt;

/// The start values of a model, which the first call checks.
///
/// # Errors
/// When the model contradicts itself, or its saved states are incomplete.
pub(crate) fn checked_starts(model: &LoadedModel) -> Result<&Starts> {
    if let Some(starts) = model.starts.get() {
        return Ok(starts);
    }
    let starts = check(model)?;
    memory::check(model, &starts)?;
    Ok(model.starts.get_or_init(|| starts))
}

/// The lists of unknowns, each unknown with what it depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelStructure {
    /// The outputs, by value reference.
    pub outputs: Vec<Unknown>,
    /// The derivatives of the states, in the order of the states; empty if no importer can use them.
    pub derivatives: Vec<Unknown>,
    /// What is calculated during initialization, by value reference.
    pub initial_unknowns: Vec<Unknown>,
}

/// What depends on others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Its place in the table, which is its value reference in FMI 2.0.
    pub vr: u32,
    /// The places of what it depends on, and how each of them enters.
    pub dependencies: Vec<(u32, DependencyKind)>,
}

/// How a known enters an unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DependencyKind {
    /// Times a factor that never changes.
    Constant,
    /// Times a factor that does not change after the initialization.
    Fixed,
    /// Times a factor that changes with tunable parameters.
    Tunable,
    /// In some way.
    Dependent,
}

/// As `dependenciesKind` has it.
impl fmt::Display for DependencyKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Constant => "constant",
            Self::Fixed => "fixed",
            Self::Tunable => "tunable",
            Self::Dependent => "dependent",
        })
    }
}

impl ModelStructure {
    /// The structure of a model whose parameters are `tunable`, or are what its table says.
    ///
    /// # Errors
    /// When the model contradicts itself, reacts to what it has not declared, or rejects its start values; if it is
    /// `smooth`, also when it rejects every change of a variable.
    pub fn of(model: &LoadedModel, tunable_parameters: bool) -> Result<Self> {
        Self::with(model, tunable_parameters, None)
    }

    /// The same as FMI 3.0 wants it: outputs and derivatives of states depend on parameters, too, and everything on
    /// the time, also where that is no variable of the model; an array is one unknown or known, with the place of its
    /// first element, and depends on what any of its elements depends on.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn of_fmi3(model: &LoadedModel, tunable_parameters: bool) -> Result<Self> {
        let table = &model.table;
        let Self { outputs, derivatives, initial_unknowns } =
            Self::with(model, tunable_parameters, Some(table.time()))?;
        let [outputs, derivatives, initial_unknowns] =
            [outputs, derivatives, initial_unknowns].map(|list| of_arrays(table, list));
        Ok(Self { outputs, derivatives, initial_unknowns })
    }

    /// With `time`, its place, for FMI 3.0.
    fn with(model: &LoadedModel, tunable_parameters: bool, time: Option<u32>) -> Result<Self> {
        let starts = checked_starts(model)?;
        let table = &model.table;
        let Lists { outputs, derivatives, knowns, initial_unknowns, initial_knowns } = Lists::of(table, time);
        check_derivatives(model, starts, true, &[&outputs[..], &derivatives].concat(), &knowns)?;
        check_derivatives(model, starts, false, &initial_unknowns, &initial_knowns)?;

        let mut sampler = Sampler::new(model, starts.clone(), tunable_parameters);
        sampler.running = true;
        let count = outputs.len();
        let mut outputs = by_derivative(&mut sampler, &[outputs, derivatives].concat(), &knowns)?;
        let derivatives = outputs.split_off(count);
        sampler.running = false;
        let initial_unknowns = by_value(&mut sampler, &initial_unknowns, &initial_knowns)?;
        let itself = |unknown: Unknown| {
            // A state is what was set, or what the last step made of it.
            let dependencies = knowns.iter().filter(|known| **known == unknown.vr);
            Unknown {
                dependencies: dependencies.map(|known| (*known, DependencyKind::Constant)).collect(),
                ..unknown
            }
        };
        let outputs = outputs.into_iter().map(|unknown| match table.variables[unknown.vr as usize].state {
            true => Ok(itself(unknown)),
            false => with_declared(table, unknown, &knowns),
        });
        let derivatives = derivatives.into_iter().map(|unknown| with_declared(table, unknown, &knowns));
        let initial_unknowns =
            initial_unknowns.into_iter().map(|unknown| with_declared(table, unknown, &initial_knowns));
        Ok(Self {
            outputs: outputs.collect::<Result<_>>()?,
            derivatives: derivatives.collect::<Result<_>>()?,
            initial_unknowns: initial_unknowns.collect::<Result<_>>()?,
        })
    }
}

/// The unknowns and the knowns, by place.
struct Lists {
    outputs: Vec<u32>,
    derivatives: Vec<u32>,
    knowns: Vec<u32>,
    initial_unknowns: Vec<u32>,
    initial_knowns: Vec<u32>,
}

impl Lists {
    fn of(table: &Table, time: Option<u32>) -> Self {
        // Others keep their states to themselves.
        let has_states = table.model_exchange.is_some() || table.partials;
        let outputs = table.find(|of| of.causality == Causality::Output);
        let states = if has_states { &table.states[..] } else { &[] };
        let (states, derivatives): (Vec<u32>, Vec<u32>) = states.iter().copied().unzip();
        let unlisted = time.filter(|time| table.variable(*time).is_none());
        let mut knowns = table.find(|of| {
            matches!(of.causality, Causality::Input | Causality::Independent)
                || has_states && of.state
                || time.is_some() && of.causality == Causality::Parameter
        });
        knowns.extend(unlisted);
        let calculated = table.find(|of| of.causality == Causality::CalculatedParameter);
        let mut initial_unknowns = [&outputs[..], &calculated, &states, &derivatives].concat();
        initial_unknowns.retain(|place| {
            matches!(table.variables[*place as usize].initial, Some(Initial::Approx | Initial::Calculated))
        });
        initial_unknowns.sort_unstable();
        initial_unknowns.dedup();
        let mut initial_knowns = table.find(|of| of.is_known() && (!of.state || of.is_exact()));
        initial_knowns.extend(unlisted);
        Self { outputs, derivatives, knowns, initial_unknowns, initial_knowns }
    }
}

/// The list with each array for its elements.
fn of_arrays(table: &Table, unknowns: Vec<Unknown>) -> Vec<Unknown> {
    let first = |place: u32| table.variable(place).map_or(place, |of| place - of.element as u32);
    let mut list: Vec<Unknown> = Vec::new();
    for of in unknowns {
        let vr = first(of.vr);
        if list.last().is_none_or(|last| last.vr != vr) {
            list.push(Unknown { vr, dependencies: Vec::new() });
        }
        let Some(Unknown { dependencies, .. }) = list.last_mut() else { continue };
        for (known, kind) in of.dependencies {
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

/// Adds to what was found by trying what the model declares, or what cannot be ruled out.
fn with_declared(table: &Table, found: Unknown, knowns: &[u32]) -> Result<Unknown> {
    let unknown = &table.variables[found.vr as usize];
    let declared: Option<HashSet<u32>> =
        unknown.dependencies.as_ref().map(|places| places.iter().copied().collect());
    let is_declared = |known: u32| {
        known == table.time() && unknown.depends_on_time
            || declared.as_ref().is_none_or(|declared| declared.contains(&known))
    };
    if let Some((hidden, _)) = found.dependencies.iter().find(|(place, _)| !is_declared(*place)) {
        bail!("{} reacts to {}, which its depends_on does not name", unknown.name, table.name(*hidden));
    }
    if unknown.variability == Variability::Constant {
        return Ok(found);
    }
    // Texts and bytes are not tried.
    let is_tried = |place: u32| {
        table.variable(place).is_none_or(|known| !matches!(known.base(), BaseType::String | BaseType::Binary))
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

/// Dependencies at communication points and in Continuous-Time Mode, from the partial derivatives; where
/// the model has none, from its values.
fn by_derivative(sampler: &mut Sampler, unknowns: &[u32], knowns: &[u32]) -> Result<Vec<Unknown>> {
    let table = &sampler.of.table;
    let mut samples = if table.partials { sampler.factor_samples()? } else { Vec::new() };
    let is_real = |place: u32| table.variable(place).is_some_and(|of| of.base() == BaseType::Real);
    // By parameters, models know their derivatives while initializing.
    let is_variable = |place: u32| {
        is_real(place)
            && !matches!(
                table.variables[place as usize].causality,
                Causality::Independent | Causality::Parameter
            )
    };
    let reals: Vec<u32> = unknowns.iter().copied().filter(|place| is_real(*place)).collect();
    let mut list: Vec<Unknown> = unknowns.iter().map(none_known).collect();
    let bases = if list.is_empty() { Vec::new() } else { sampler.bases()? };
    for &known in knowns {
        let differentiable = table.partials && is_variable(known) && !reals.is_empty();
        let partials: Vec<_> = samples
            .iter_mut()
            .filter(|_| differentiable)
            .map(|sample| ((sample.fixed, sample.tunable), sample.model.partials(&reals, known)))
            .collect();
        let mut others = Vec::new();
        for unknown in &mut list {
            let place = reals.iter().position(|real| *real == unknown.vr);
            let factors = partials.iter().map(|(parameters, factors)| Some((*parameters, factors[place?]?)));
            match factors.collect::<Option<Vec<_>>>().filter(|factors| !factors.is_empty()) {
                Some(factors) => {
                    unknown.dependencies.extend(factor_kind(&factors).map(|kind| (known, kind)));
                }
                None => others.push(unknown),
            }
        }
        let places: Vec<u32> = others.iter().map(|unknown| unknown.vr).collect();
        let reactions = sampler.reactions(&bases, known, &places)?;
        for (place, unknown) in others.into_iter().enumerate() {
            let kind = reactions.of(place).map(|_| DependencyKind::Dependent);
            unknown.dependencies.extend(kind.map(|kind| (known, kind)));
        }
    }
    Ok(list)
}

fn none_known(vr: &u32) -> Unknown {
    Unknown { vr: *vr, dependencies: Vec::new() }
}

/// The kind of dependency that has these factors, each with the numbers of its sample's fixed and tunable parameters; `None`
/// if they are all zero.
fn factor_kind(factors: &[((usize, usize), f64)]) -> Option<DependencyKind> {
    if factors.iter().all(|(_, factor)| *factor == 0.0) {
        return None;
    }
    // Whether the factor is the same wherever the samples have this in common.
    let steady = |in_common: fn(&(usize, usize)) -> (usize, usize)| {
        factors.iter().all(|(parameters, factor)| {
            let like = |(other, _): &&((usize, usize), f64)| in_common(other) == in_common(parameters);
            factors.iter().filter(like).all(|(_, other)| close(*factor, *other, 1e-12))
        })
    };
    Some(if steady(|_| (0, 0)) {
        DependencyKind::Constant
    } else if steady(|(fixed, _)| (*fixed, 0)) {
        DependencyKind::Fixed
    } else if steady(|parameters| *parameters) {
        DependencyKind::Tunable
    } else {
        DependencyKind::Dependent
    })
}

/// Dependencies during initialization, from the values; `fixed` and `tunable` are not allowed there.
fn by_value(sampler: &mut Sampler, unknowns: &[u32], knowns: &[u32]) -> Result<Vec<Unknown>> {
    let mut list: Vec<Unknown> = unknowns.iter().map(none_known).collect();
    let bases = if list.is_empty() { Vec::new() } else { sampler.bases()? };
    for &known in knowns {
        let reactions = sampler.reactions(&bases, known, unknowns)?;
        for (place, unknown) in list.iter_mut().enumerate() {
            let Some(ratios) = reactions.of(place) else { continue };
            let constant =
                ratios.is_some_and(|ratios| ratios.iter().all(|ratio| close(*ratio, ratios[0], 1e-7)));
            let kind = if constant { DependencyKind::Constant } else { DependencyKind::Dependent };
            unknown.dependencies.push((known, kind));
        }
    }
    Ok(list)
}

/// How unknowns changed when a known was changed, at several points.
struct Reactions {
    /// The change of the known where it is a Real that is set, else `None`.
    changes: Vec<Option<f64>>,
    /// Per point and unknown, the value before and after.
    values: Vec<Vec<[Value; 2]>>,
}

impl Reactions {
    /// `None` if the unknown at this place did not react; else the change of the unknown over that of the
    /// known at every point, if there is such a thing.
    fn of(&self, place: usize) -> Option<Option<Vec<f64>>> {
        let pairs = || self.values.iter().map(|values| &values[place]);
        let real = |pair: &[Value; 2]| match *pair {
            [Value::Real(before), Value::Real(after)] => Some([before, after]),
            _ => None,
        };
        let Some(reals) = pairs().map(real).collect::<Option<Vec<_>>>() else {
            return pairs().any(|[before, after]| before != after).then_some(None);
        };
        let scale = reals.iter().flatten().fold(0.0, |scale: f64, value| scale.max(value.abs()));
        // Less is rounding: a model may calculate with terms that cancel.
        if reals.iter().all(|[before, after]| (after - before).abs() <= 1e-10 * scale) {
            return None;
        }
        let ratio =
            |(change, [before, after]): (&Option<f64>, &[f64; 2])| Some((after - before) / (*change)?);
        Some(self.changes.iter().zip(&reals).map(ratio).collect())
    }
}

/// A point, and the values of all variables there.
struct Base {
    point: Point,
    values: Vec<Value>,
}

impl Sampler<'_> {
    /// The points around which each known is changed.
    fn bases(&mut self) -> Result<Vec<Base>> {
        let mut base = || {
            let (point, mut instance) = self.draw(None, true, |_| true)?;
            Ok(Base { point, values: instance.values() })
        };
        (0..16).map(|_| base()).collect()
    }

    /// Changes one known at many points and reads the unknowns.
    fn reactions(&mut self, bases: &[Base], known: u32, unknowns: &[u32]) -> Result<Reactions> {
        let table = &self.of.table;
        let mut reactions = Reactions { changes: Vec::new(), values: Vec::new() };
        let variable = table.variable(known);
        let is_known = |of: &Variable| variable.is_some_and(|known| known.name == of.name);
        for base in bases.iter().filter(|_| !unknowns.is_empty()) {
            let (changed, mut after) = self.draw(Some(&base.point), known == table.time(), is_known)?;
            if changed == base.point {
                continue;
            }
            reactions.changes.push(difference(&base.point, &changed, known));
            let after = after.values();
            let pair = |place: &u32| [&base.values, &after].map(|values| values[*place as usize].clone());
            reactions.values.push(unknowns.iter().map(pair).collect());
        }
        if let Some(message) =
            self.stuck.get(&known).filter(|_| table.info.smooth && reactions.changes.is_empty())
        {
            let name = table.name(known);
            bail!(
                "{name} cannot be tried separately: the model rejects every other value that is near, from 50 % of it down to \
                 0.0008 %: {message}; let `update` accept some, or leave `smooth` out of INFO and name what follows from \
                 {name} with `depends_on`"
            );
        }
        for (place, unknown) in unknowns.iter().enumerate() {
            let values = reactions.values.iter().flat_map(|row| &row[place]);
            let is_finite = |value: &Value| !matches!(value, Value::Real(value) if !value.is_finite());
            let name = table.name(*unknown);
            ensure!(values.into_iter().all(is_finite), "{name} is not finite near the start values");
        }
        Ok(reactions)
    }
}

/// By how much a Real that is set differs.
fn difference(from: &Point, to: &Point, vr: u32) -> Option<f64> {
    match (from.values.get(vr as usize)?, to.values.get(vr as usize)?) {
        (Some(Value::Real(from)), Some(Value::Real(to))) => Some(to - from),
        _ => None,
    }
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}
