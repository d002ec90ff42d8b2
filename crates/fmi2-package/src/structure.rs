//! Which variable depends on which, and how (section 2.2.8).
//!
//! A live model is evaluated at points drawn around its start values, always the same ones. If its equations
//! are [smooth](ModelInfo::smooth), what does not react at any of them does not depend, and a factor that never
//! changes is constant. Of other models that proves nothing: there an unknown depends on what it
//! [declares](Variable::depends_on), else on everything, and trying only finds wrong declarations.

mod sample;

use crate::check::{check_info, has_start};
use anyhow::{Result, bail, ensure};
use fmi_schema::fmi2::DependenciesKind;
use fmi2_export::{Causality, Model, ModelInfo, Variable};
use sample::{Point, Sampler};

/// The lists of unknowns, each unknown with what it depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelStructure {
    /// The outputs, by value reference.
    pub outputs: Vec<(u32, Vec<Dependency>)>,
    /// The derivatives of the states, in the order of the states; empty if no importer can use them.
    pub derivatives: Vec<(u32, Vec<Dependency>)>,
    /// What is calculated during initialization, by value reference.
    pub initial_unknowns: Vec<(u32, Vec<Dependency>)>,
}

/// What an unknown depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Dependency {
    /// Value reference of the known.
    pub known: u32,
    /// How the known enters.
    pub kind: DependenciesKind,
}

impl ModelStructure {
    /// The structure of a model whose parameters are `tunable`, or are what its table says.
    ///
    /// # Errors
    /// When the model contradicts itself, reacts to what it has not declared, or refuses every set of
    /// parameters near its start values.
    pub fn of<M: Model>(tunable_parameters: bool) -> Result<Self> {
        let info = M::INFO;
        check_info(&info)?;
        let has_states = info.model_exchange.is_some()
            || info.co_simulation.is_some_and(|offer| offer.directional_derivative);
        let outputs = find(&info, |variable| variable.causality() == Causality::Output);
        let derivatives: Vec<u32> = if has_states { info.derivatives().collect() } else { Vec::new() };
        let knowns = find(&info, |variable| {
            variable.causality() == Causality::Input || (has_states && variable.is_state())
        });
        let mut initial_unknowns: Vec<u32> = outputs.iter().chain(&derivatives).copied().collect();
        initial_unknowns.retain(|vr| !has_start(&info.variables[*vr as usize]));
        initial_unknowns.sort_unstable();
        initial_unknowns.dedup();
        let initial_knowns = find(&info, has_start);

        let mut sampler = Sampler::<M>::new(tunable_parameters);
        let outputs = by_derivative(&mut sampler, &outputs, &knowns)?;
        let derivatives = by_derivative(&mut sampler, &derivatives, &knowns)?;
        let initial_unknowns = by_value(&mut sampler, &initial_unknowns, &initial_knowns)?;
        Ok(Self {
            outputs: with_declared(&info, outputs, &knowns)?,
            derivatives: with_declared(&info, derivatives, &knowns)?,
            initial_unknowns: with_declared(&info, initial_unknowns, &initial_knowns)?,
        })
    }
}

/// An unknown with what it depends on.
type Dependencies = (u32, Vec<Dependency>);

/// Adds to what was found by trying what the model declares, or what cannot be ruled out.
fn with_declared(info: &ModelInfo, found: Vec<Dependencies>, knowns: &[u32]) -> Result<Vec<Dependencies>> {
    let complete = |(unknown, found): Dependencies| {
        let variable = &info.variables[unknown as usize];
        if variable.is_state() {
            // It is what was set.
            let itself = knowns.iter().filter(|known| **known == unknown);
            let itself = itself.map(|known| Dependency { known: *known, kind: DependenciesKind::Constant });
            return Ok((unknown, itself.collect()));
        }
        let declared = variable.dependencies();
        let is_declared = |known: u32| declared.is_none_or(|declared| declared.contains(&known));
        if let Some(Dependency { known, .. }) = found.iter().find(|found| !is_declared(found.known)) {
            let known = info.variables[*known as usize].name();
            bail!("{} reacts to {known}, which its depends_on does not name", variable.name());
        }
        let kind = |known: u32| match found.iter().find(|found| found.known == known) {
            Some(found) if info.smooth => Some(found.kind.clone()),
            None if info.smooth && declared.is_none() => None,
            _ => is_declared(known).then_some(DependenciesKind::Dependent),
        };
        let all = knowns.iter().filter_map(|&known| Some(Dependency { known, kind: kind(known)? }));
        Ok((unknown, all.collect()))
    };
    found.into_iter().map(complete).collect()
}

fn find(info: &ModelInfo, is_it: impl Fn(&Variable) -> bool) -> Vec<u32> {
    (0..).zip(info.variables).filter(|(_, variable)| is_it(variable)).map(|(vr, _)| vr).collect()
}

/// Dependencies at communication points and in Continuous-Time Mode, from the partial derivatives; where
/// the model has none, from its values.
fn by_derivative<M: Model>(
    sampler: &mut Sampler<M>,
    unknowns: &[u32],
    knowns: &[u32],
) -> Result<Vec<Dependencies>> {
    let samples = sampler.factor_samples()?;
    let mut list = Vec::new();
    for &unknown in unknowns {
        let mut dependencies = Vec::new();
        for &known in knowns {
            let factors: Option<Vec<_>> = samples
                .iter()
                .map(|sample| Some((sample, sample.model.partial_derivative(unknown, known)?)))
                .collect();
            let kind = match factors {
                Some(factors) => factor_kind(&factors),
                None => sampler.reactions(known, &[unknown])?.of(0).map(|_| DependenciesKind::Dependent),
            };
            dependencies.extend(kind.map(|kind| Dependency { known, kind }));
        }
        list.push((unknown, dependencies));
    }
    Ok(list)
}

/// The kind of dependency that has these factors; `None` if they are all zero.
fn factor_kind<M>(factors: &[(&sample::FactorSample<M>, f64)]) -> Option<DependenciesKind> {
    if factors.iter().all(|(_, factor)| *factor == 0.0) {
        return None;
    }
    // Whether the factor is the same wherever the samples have this in common.
    let steady = |in_common: fn(&sample::FactorSample<M>) -> (usize, usize)| {
        factors.iter().all(|(sample, factor)| {
            let like = |(other, _): &&(&sample::FactorSample<M>, f64)| in_common(other) == in_common(sample);
            factors.iter().filter(like).all(|(_, other)| close(*factor, *other, 1e-12))
        })
    };
    Some(if steady(|_| (0, 0)) {
        DependenciesKind::Constant
    } else if steady(|sample| (sample.fixed, 0)) {
        DependenciesKind::Fixed
    } else if steady(|sample| (sample.fixed, sample.tunable)) {
        DependenciesKind::Tunable
    } else {
        DependenciesKind::Dependent
    })
}

/// Dependencies during initialization, from the values; `fixed` and `tunable` are not allowed there.
fn by_value<M: Model>(
    sampler: &mut Sampler<M>,
    unknowns: &[u32],
    knowns: &[u32],
) -> Result<Vec<Dependencies>> {
    let mut list: Vec<Dependencies> = unknowns.iter().map(|unknown| (*unknown, Vec::new())).collect();
    for &known in knowns {
        let reactions = sampler.reactions(known, unknowns)?;
        for (place, (_, dependencies)) in list.iter_mut().enumerate() {
            let Some(ratios) = reactions.of(place) else { continue };
            let constant =
                ratios.is_some_and(|ratios| ratios.iter().all(|ratio| close(*ratio, ratios[0], 1e-7)));
            let kind = if constant { DependenciesKind::Constant } else { DependenciesKind::Dependent };
            dependencies.push(Dependency { known, kind });
        }
    }
    Ok(list)
}

/// How unknowns changed when a known was changed, at several points.
struct Reactions {
    /// The change of the known where it is a number with a unit; `None` for Integer and Boolean.
    changes: Vec<Option<f64>>,
    /// Per point and unknown, the value before and after.
    values: Vec<Vec<(f64, f64)>>,
}

impl Reactions {
    /// `None` if the unknown at this place did not react; else the change of the unknown over that of the
    /// known at every point, if there is such a thing.
    fn of(&self, place: usize) -> Option<Option<Vec<f64>>> {
        let pairs: Vec<(f64, f64)> = self.values.iter().map(|values| values[place]).collect();
        let scale = pairs.iter().fold(0.0, |scale: f64, (a, b)| scale.max(a.abs()).max(b.abs()));
        // Less is rounding: a model may calculate with terms that cancel.
        if pairs.iter().all(|(before, after)| (after - before).abs() <= 1e-10 * scale) {
            return None;
        }
        let ratio =
            |(change, (before, after)): (&Option<f64>, &(f64, f64))| Some((after - before) / (*change)?);
        Some(self.changes.iter().zip(&pairs).map(ratio).collect())
    }
}

impl<M: Model> Sampler<M> {
    /// Changes one known at many points and looks at the unknowns.
    fn reactions(&mut self, known: u32, unknowns: &[u32]) -> Result<Reactions> {
        let mut reactions = Reactions { changes: Vec::new(), values: Vec::new() };
        for _ in 0..16 {
            let (point, before) = self.draw(None, |_| true)?;
            let (changed, after) = self.draw(Some(&point), |vr| vr == known)?;
            if changed == point {
                continue;
            }
            reactions.changes.push(Point::difference(&point, &changed, known));
            reactions.values.push(unknowns.iter().map(|vr| (before.real(*vr), after.real(*vr))).collect());
        }
        for (place, unknown) in unknowns.iter().enumerate() {
            let finite =
                reactions.values.iter().all(|row| row[place].0.is_finite() && row[place].1.is_finite());
            ensure!(
                finite,
                "{} is not finite near the start values",
                M::INFO.variables[*unknown as usize].name()
            );
        }
        Ok(reactions)
    }
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}
