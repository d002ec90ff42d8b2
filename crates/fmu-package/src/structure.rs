//! Which variable depends on which, and how (section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0).
//!
//! A live model is evaluated at points drawn around its start values, always the same ones. If its equations
//! are [smooth](fmu_export::Info::smooth), what does not react at any of them does not depend, and a factor that
//! never changes is constant. Of other models that proves nothing: there an unknown depends on what it
//! [declares](Variable::depends_on), else on everything, and trying only finds wrong declarations.

use crate::changes::Changes;
use crate::check::{check, is_exact, is_known};
use crate::derivatives::check as check_derivatives;
use crate::sample::{FactorSample, Point, Sampler};
use anyhow::{Result, bail, ensure};
use fmu_export::fmi3::independent;
use fmu_export::{BaseType, Causality, Exported, Initial, Value, Variability, Variable};
use std::collections::{HashMap, HashSet};
use std::fmt;

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
    /// When the model contradicts itself, reacts to what it has not declared, or refuses every set of
    /// parameters near its start values.
    pub fn of<M: Exported>(tunable_parameters: bool) -> Result<Self> {
        Self::with::<M>(tunable_parameters, None)
    }

    /// The same as FMI 3.0 wants it: outputs and derivatives of states depend on parameters, too, and everything on
    /// the time, also where that is no variable of the model; an array is one unknown or known, with the place of its
    /// first element, and depends on what any of its elements depends on.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn of_fmi3<M: Exported>(tunable_parameters: bool) -> Result<Self> {
        let Self { outputs, derivatives, initial_unknowns } =
            Self::with::<M>(tunable_parameters, Some(independent::<M>().0))?;
        let [outputs, derivatives, initial_unknowns] =
            [outputs, derivatives, initial_unknowns].map(of_arrays::<M>);
        Ok(Self { outputs, derivatives, initial_unknowns })
    }

    /// With `time`, its value reference, for FMI 3.0.
    fn with<M: Exported>(tunable_parameters: bool, time: Option<u32>) -> Result<Self> {
        let starts = check::<M>(&Changes::default())?;
        // Others keep their states to themselves.
        let has_states = M::MODEL_EXCHANGE.is_some() || M::PARTIALS;
        let outputs = find::<M>(|variable| variable.causality() == Causality::Output);
        let states = if has_states { M::STATES } else { &[] };
        let derivatives: Vec<u32> = states.iter().map(|state| state.derivative).collect();
        let states: Vec<u32> = states.iter().map(|state| state.state).collect();
        let unlisted = time.filter(|time| known::<M>(*time).is_none());
        let mut knowns = find::<M>(|variable| {
            matches!(variable.causality(), Causality::Input | Causality::Independent)
                || has_states && variable.is_state()
                || time.is_some() && variable.causality() == Causality::Parameter
        });
        knowns.extend(unlisted);
        let calculated = find::<M>(|variable| variable.causality() == Causality::CalculatedParameter);
        let mut initial_unknowns = [&outputs[..], &calculated, &states, &derivatives].concat();
        initial_unknowns
            .retain(|vr| matches!(variable::<M>(*vr).initial(), Some(Initial::Approx | Initial::Calculated)));
        initial_unknowns.sort_unstable();
        initial_unknowns.dedup();
        let mut initial_knowns =
            find::<M>(|variable| is_known(variable) && (!variable.is_state() || is_exact(variable)));
        initial_knowns.extend(unlisted);

        check_derivatives::<M>(&starts, true, &[&outputs[..], &derivatives].concat(), &knowns)?;
        check_derivatives::<M>(&starts, false, &initial_unknowns, &initial_knowns)?;

        let mut sampler = Sampler::<M>::new(starts, tunable_parameters);
        sampler.running = true;
        let outputs = by_derivative(&mut sampler, &outputs, &knowns)?;
        let derivatives = by_derivative(&mut sampler, &derivatives, &knowns)?;
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
        let outputs = outputs.into_iter().map(|unknown| match variable::<M>(unknown.vr).is_state() {
            true => Ok(itself(unknown)),
            false => with_declared::<M>(unknown, &knowns),
        });
        let derivatives = derivatives.into_iter().map(|unknown| with_declared::<M>(unknown, &knowns));
        let initial_unknowns =
            initial_unknowns.into_iter().map(|unknown| with_declared::<M>(unknown, &initial_knowns));
        Ok(Self {
            outputs: outputs.collect::<Result<_>>()?,
            derivatives: derivatives.collect::<Result<_>>()?,
            initial_unknowns: initial_unknowns.collect::<Result<_>>()?,
        })
    }
}

/// The list with each array for its elements.
fn of_arrays<M: Exported>(unknowns: Vec<Unknown>) -> Vec<Unknown> {
    let first = |place: u32| known::<M>(place).map_or(place, |of| place - of.element() as u32);
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

fn variable<M: Exported>(vr: u32) -> &'static Variable<M> {
    &M::TABLE[vr as usize]
}

/// `None` for a time that is no variable of the model.
fn known<M: Exported>(vr: u32) -> Option<&'static Variable<M>> {
    M::TABLE.get(vr as usize)
}

fn find<M: Exported>(is_it: impl Fn(&Variable<M>) -> bool) -> Vec<u32> {
    (0..).zip(M::TABLE).filter(|(_, variable)| is_it(variable)).map(|(vr, _)| vr).collect()
}

/// Adds to what was found by trying what the model declares, or what cannot be ruled out.
fn with_declared<M: Exported>(found: Unknown, knowns: &[u32]) -> Result<Unknown> {
    let unknown = variable::<M>(found.vr);
    let declared: Option<HashSet<u32>> = unknown.dependencies().map(Iterator::collect);
    let (time, of_time) = independent::<M>();
    let names_time = unknown.depends_on_time() == Some(true);
    let is_declared = |known: u32| {
        known == time && names_time || declared.as_ref().is_none_or(|declared| declared.contains(&known))
    };
    if let Some((hidden, _)) = found.dependencies.iter().find(|(vr, _)| !is_declared(*vr)) {
        let hidden = known::<M>(*hidden).unwrap_or(of_time).name();
        bail!("{} reacts to {hidden}, which its depends_on does not name", unknown.name());
    }
    if unknown.variability() == Variability::Constant {
        return Ok(found);
    }
    // Texts and bytes are not tried.
    let is_tried = |vr: u32| {
        known::<M>(vr).is_none_or(|known| !matches!(known.base(), BaseType::String | BaseType::Binary))
    };
    let kinds: HashMap<u32, DependencyKind> = found.dependencies.iter().copied().collect();
    let kind = |known: u32| match kinds.get(&known) {
        Some(kind) if M::INFO.smooth => Some(*kind),
        None if M::INFO.smooth && declared.is_none() && is_tried(known) => None,
        _ => is_declared(known).then_some(DependencyKind::Dependent),
    };
    let dependencies = knowns.iter().filter_map(|&known| Some((known, kind(known)?))).collect();
    Ok(Unknown { dependencies, ..found })
}

/// Dependencies at communication points and in Continuous-Time Mode, from the partial derivatives; where
/// the model has none, from its values.
fn by_derivative<M: Exported>(
    sampler: &mut Sampler<M>,
    unknowns: &[u32],
    knowns: &[u32],
) -> Result<Vec<Unknown>> {
    let samples = if M::PARTIALS { sampler.factor_samples()? } else { Vec::new() };
    // By parameters, models know their derivatives while initializing.
    let is_variable = |of: &Variable<M>| {
        of.base() == BaseType::Real
            && !matches!(of.causality(), Causality::Independent | Causality::Parameter)
    };
    let partials = |unknown: u32, known: u32| {
        let differentiable = M::PARTIALS
            && variable::<M>(unknown).base() == BaseType::Real
            && self::known::<M>(known).is_some_and(is_variable);
        let partial = |sample: &FactorSample<M>| {
            sample.model.exported_partials(Some(M::element(known)), false)(M::element(unknown))
        };
        let samples = samples.iter().filter(|_| differentiable);
        let factors: Option<Vec<_>> = samples.map(|sample| Some((sample, partial(sample)?))).collect();
        factors.filter(|factors| !factors.is_empty())
    };
    let mut list: Vec<Unknown> = unknowns.iter().map(none_known).collect();
    for &known in knowns {
        let mut others = Vec::new();
        for unknown in &mut list {
            match partials(unknown.vr, known) {
                Some(factors) => {
                    unknown.dependencies.extend(factor_kind(&factors).map(|kind| (known, kind)));
                }
                None => others.push(unknown),
            }
        }
        let places: Vec<u32> = others.iter().map(|unknown| unknown.vr).collect();
        let reactions = sampler.reactions(known, &places)?;
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

/// The kind of dependency that has these factors; `None` if they are all zero.
fn factor_kind<M>(factors: &[(&FactorSample<M>, f64)]) -> Option<DependencyKind> {
    if factors.iter().all(|(_, factor)| *factor == 0.0) {
        return None;
    }
    // Whether the factor is the same wherever the samples have this in common.
    let steady = |in_common: fn(&FactorSample<M>) -> (usize, usize)| {
        factors.iter().all(|(sample, factor)| {
            let like = |(other, _): &&(&FactorSample<M>, f64)| in_common(other) == in_common(sample);
            factors.iter().filter(like).all(|(_, other)| close(*factor, *other, 1e-12))
        })
    };
    Some(if steady(|_| (0, 0)) {
        DependencyKind::Constant
    } else if steady(|sample| (sample.fixed, 0)) {
        DependencyKind::Fixed
    } else if steady(|sample| (sample.fixed, sample.tunable)) {
        DependencyKind::Tunable
    } else {
        DependencyKind::Dependent
    })
}

/// Dependencies during initialization, from the values; `fixed` and `tunable` are not allowed there.
fn by_value<M: Exported>(sampler: &mut Sampler<M>, unknowns: &[u32], knowns: &[u32]) -> Result<Vec<Unknown>> {
    let mut list: Vec<Unknown> = unknowns.iter().map(none_known).collect();
    for &known in knowns {
        let reactions = sampler.reactions(known, unknowns)?;
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

impl<M: Exported> Sampler<M> {
    /// Changes one known at many points and looks at the unknowns.
    fn reactions(&mut self, known: u32, unknowns: &[u32]) -> Result<Reactions> {
        let mut reactions = Reactions { changes: Vec::new(), values: Vec::new() };
        let known_of = self::known::<M>(known);
        let time = known_of.is_none_or(|known| known.causality() == Causality::Independent);
        let is_known = |of: &Variable<M>| known_of.is_some_and(|known| known.name() == of.name());
        let value = |model: &M, vr: u32| variable::<M>(vr).value(model).unwrap_or(Value::Real(0.0));
        let points = if unknowns.is_empty() { 0 } else { 16 };
        for _ in 0..points {
            let (point, before) = self.draw(None, true, |_| true)?;
            let (changed, after) = self.draw(Some(&point), time, is_known)?;
            if changed == point {
                continue;
            }
            reactions.changes.push(difference(&point, &changed, known));
            let pair = |vr: &u32| [value(&before, *vr), value(&after, *vr)];
            reactions.values.push(unknowns.iter().map(pair).collect());
        }
        for (place, unknown) in unknowns.iter().enumerate() {
            let values = reactions.values.iter().flat_map(|row| &row[place]);
            let is_finite = |value: &Value| !matches!(value, Value::Real(value) if !value.is_finite());
            let name = variable::<M>(*unknown).name();
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
