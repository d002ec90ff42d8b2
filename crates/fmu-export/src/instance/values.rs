//! Getting and setting values (section 2.1.7 of FMI 2.0, 2.2.7.2 of FMI 3.0).

use super::{Instance, Outcome, Reference, finite, implicit_value, reject, reject_with};
use crate::export::Exported;
use crate::settable::START_VALUE_MODES;
use crate::types::Attributes;
use crate::variable::Variable;
use fmi_abi::BaseType;
use fmi_abi::Value;
use fmi_abi::{Causality, Initial, Mode, Variability};
use std::mem::MaybeUninit;

impl<M: Exported> Instance<M> {
    #[inline]
    pub fn get_reals<R: Reference>(&mut self, vr: &[R], values: &mut [MaybeUninit<f64>]) -> Outcome {
        let in_table =
            |vr: &R| M::TABLE.get(vr.index() as usize).is_some_and(|of| of.base() == BaseType::Real);
        if !vr.iter().all(in_table) {
            return self.get_reals_one_by_one(vr, values);
        }
        if M::ARRAYS {
            return self.get_reals_of_arrays(|number| vr[number].index(), values);
        }
        let time = self.state.time;
        let model = self.calculated();
        let mut sum = 0.0;
        for (vr, value) in vr.iter().zip(&mut *values) {
            let mut read = model.real_in_place(vr.index());
            if read.is_nan() {
                read = M::TABLE[vr.index() as usize].real(model).unwrap_or(time);
            }
            sum += read;
            value.write(read);
        }
        if is_finite(sum) { Ok(()) } else { self.get_reals_one_by_one(vr, values) }
    }

    /// Gets Reals, if no calculation is needed, all are fields of the model, and all are finite. Returns false, and
    /// writes nothing, in all other cases.
    #[inline(always)]
    pub fn get_reals_fast<R: Reference, const N: usize>(
        &mut self,
        vr: &[R; N],
        values: &mut [MaybeUninit<f64>; N],
    ) -> bool {
        let lines: [usize; N] = std::array::from_fn(|number| vr[number].index() as usize);
        if M::ARRAYS || self.state.stale || !lines.iter().all(|line| *line < M::LINES.len()) {
            return false;
        }
        let read: [f64; N] =
            std::array::from_fn(|number| self.state.model.real_in_place(lines[number] as u32));
        if !is_finite(read.iter().sum()) {
            return false;
        }
        for (value, read) in values.iter_mut().zip(read) {
            value.write(read);
        }
        true
    }

    /// Gets Reals of a model with arrays. Consecutive elements of an array are read together, so that the model
    /// calculates the array only once for them.
    pub(super) fn get_reals_of_arrays(
        &mut self,
        index: impl Fn(usize) -> u32,
        values: &mut [MaybeUninit<f64>],
    ) -> Outcome {
        let time = self.state.time;
        let model = self.calculated();
        let mut done = 0;
        while done < values.len() {
            let first = index(done);
            let variable = &M::TABLE[first as usize];
            let rest = (variable.length() - variable.element()).min(values.len() - done);
            let follows = |number: &usize| index(done + number) as usize == first as usize + number;
            let run = 1 + (1..rest).take_while(follows).count();
            if variable.reals(model, time, &mut values[done..done + run]) != 0.0 {
                for variable in &M::TABLE[first as usize..][..run] {
                    finite(variable, variable.real(model).unwrap_or(time))?;
                }
            }
            done += run;
        }
        Ok(())
    }

    /// Gets Reals one by one, including the variables of FMI 3.0 after the table: the time and the event indicators. An
    /// error contains the name of the first variable that is not finite.
    #[cold]
    #[inline(never)]
    fn get_reals_one_by_one<R: Reference>(&mut self, vr: &[R], values: &mut [MaybeUninit<f64>]) -> Outcome {
        for vr in vr {
            self.variable(vr.index(), BaseType::Real)?;
        }
        let time = self.state.time;
        let model = self.calculated();
        for (vr, value) in vr.iter().zip(values) {
            let (variable, read) = match M::TABLE.get(vr.index() as usize) {
                Some(variable) => (variable, variable.real(model).unwrap_or(time)),
                None => (super::Implicit::<M>::INDICATOR, implicit_value::<M>(model, time, vr.index())),
            };
            value.write(finite(variable, read)?);
        }
        Ok(())
    }

    #[inline]
    pub fn set_reals<R: Reference>(&mut self, vr: &[R], values: &[f64]) -> Outcome {
        let fmi_state = self.fmi_state();
        let simple = |(vr, value): (&R, &f64)| {
            let variable = M::TABLE.get(vr.index() as usize);
            variable.is_some_and(|variable| fmi_state.is_in(variable.takes_reals)) && value.is_finite()
        };
        if !vr.iter().zip(values).all(simple) {
            return self.set_reals_and_parameters(vr, values);
        }
        self.state.stale = true;
        for (vr, value) in vr.iter().zip(values) {
            M::TABLE[vr.index() as usize].set_real(&mut self.state.model, *value);
            if !self.state.started {
                self.state.model.calculate_start();
            }
        }
        Ok(())
    }

    /// Sets Reals, if the model has started, all are plain fields that may be set, and all values are finite. Otherwise
    /// returns false; the caller must then set all of them with [`set_reals`](Self::set_reals).
    #[inline(always)]
    pub fn set_reals_fast<R: Reference, const N: usize>(&mut self, vr: &[R; N], values: &[f64; N]) -> bool {
        let fmi_state = self.fmi_state();
        // Copies the arrays, because the compiler must assume that they may overlap the model.
        let lines: [usize; N] = std::array::from_fn(|number| vr[number].index() as usize);
        let values: [f64; N] = std::array::from_fn(|number| values[number]);
        let is_taken = |line: &usize| {
            let variable = M::TABLE.get(*line);
            variable.is_some_and(|variable| fmi_state.is_in(variable.takes_fast))
        };
        if M::ARRAYS || !self.state.started || !lines.iter().all(is_taken) || !is_finite(values.iter().sum())
        {
            return false;
        }
        self.state.stale = true;
        for (line, value) in lines.into_iter().zip(values) {
            self.state.model.set_in_place(line as u32, value);
        }
        !self.state.model.missed()
    }

    #[cold]
    #[inline(never)]
    fn set_reals_and_parameters<R: Reference>(&mut self, vr: &[R], values: &[f64]) -> Outcome {
        self.set(vr, &[BaseType::Real], &|index| Value::Real(values[index]))
    }

    /// Gets values of any type in `bases`. First checks all variables, then passes each value to `each`, with its
    /// index in `vr`.
    #[inline(never)]
    pub fn get<R: Reference>(
        &mut self,
        vr: &[R],
        bases: &[BaseType],
        each: &mut dyn FnMut(usize, Value),
    ) -> Outcome {
        self.check_types(vr, bases)?;
        let time = self.state.time;
        let model = self.calculated();
        for (index, vr) in vr.iter().enumerate() {
            let variable = M::TABLE.get(vr.index() as usize);
            let value = variable.and_then(|of| of.value(model)).unwrap_or(Value::Real(time));
            if let (Some(variable), Value::Real(value)) = (variable, &value) {
                finite(variable, *value)?;
            }
            each(index, value);
        }
        Ok(())
    }

    /// Fails unless each reference belongs to a variable whose type is one of `bases`.
    pub fn check_types<R: Reference>(&self, vr: &[R], bases: &[BaseType]) -> Outcome {
        vr.iter().try_for_each(|vr| self.variable_of(vr.index(), bases).map(drop))
    }

    fn variable_of(&self, index: u32, bases: &[BaseType]) -> Outcome<&'static Variable<M>> {
        match self.find(index) {
            Some(variable) if bases.contains(&variable.base()) => Ok(variable),
            other => self.reject_variable(index, other, bases[0]),
        }
    }

    /// Sets values of any type in `bases`; `value` returns the value for an index in `vr`. First checks all values,
    /// then sets all. One function serves all types, because this keeps libraries small.
    #[inline(never)]
    pub fn set<R: Reference>(
        &mut self,
        vr: &[R],
        bases: &[BaseType],
        value: &dyn Fn(usize) -> Value,
    ) -> Outcome {
        for (index, vr) in vr.iter().enumerate() {
            let variable = self.variable_of(vr.index(), bases)?;
            if !self.changes_nothing(variable, || value(index)) {
                self.check_settable(variable)?;
            }
        }
        let to_blame = vr.iter().enumerate().find_map(|(index, vr)| {
            let rejection = check_value(&M::TABLE[vr.index() as usize], &value(index)).err()?;
            Some((*vr, rejection))
        });
        match to_blame {
            Some((blamed, rejection)) => self.record_rejection(vr, Some(blamed.index()), Err(rejection)),
            None => {
                let set = self.set_settable(vr, value);
                self.record_rejection(vr, None, set)
            }
        }
    }

    /// Rejects a call that sets variables, because the value at `index` is not valid in its C type. `why` returns the
    /// message for the name of the variable.
    #[cold]
    pub fn reject_value<R: Reference>(
        &mut self,
        vr: &[R],
        bases: &[BaseType],
        index: usize,
        why: impl FnOnce(&str) -> String,
    ) -> Outcome {
        self.check_all_settable(vr, bases)?;
        let blamed = vr[index].index();
        let rejection = reject(why(M::TABLE[blamed as usize].name()));
        self.record_rejection(vr, Some(blamed), rejection)
    }

    fn check_all_settable<R: Reference>(&self, vr: &[R], bases: &[BaseType]) -> Outcome {
        vr.iter().try_for_each(|vr| self.check_settable(self.variable_of(vr.index(), bases)?))
    }

    /// Records rejected start values, so that the initialization fails until the variables are set to valid values.
    /// Otherwise, importers that continue after the error would simulate with other start values than the user wants.
    /// All variables of the call are recorded, because none of them was set; `blamed` is the index of the one whose
    /// value was rejected; `None` if the model rejected the combination of values. After a success, removes the records
    /// of the variables.
    fn record_rejection<R: Reference>(&mut self, vr: &[R], blamed: Option<u32>, set: Outcome) -> Outcome {
        if self.fmi_state().is_in(START_VALUE_MODES) {
            for vr in vr.iter().map(|vr| vr.index()) {
                let Err(rejection) = &set else {
                    self.rejected.remove(vr);
                    continue;
                };
                let message = match blamed.filter(|blamed| *blamed != vr) {
                    None => rejection.message.clone(),
                    Some(blamed) => {
                        let [name, other] = [vr, blamed].map(|vr| M::TABLE[vr as usize].name());
                        format!(
                            "{name} was not set, because {other} in the same call was rejected: set it again"
                        )
                    }
                };
                self.rejected.insert(vr, message);
            }
        }
        set
    }

    pub(super) fn check_start_values(&self) -> Outcome {
        let mut reasons: Vec<&str> = Vec::new();
        for reason in self.rejected.values() {
            if !reasons.contains(&reason.as_str()) {
                reasons.push(reason);
            }
        }
        if reasons.is_empty() { Ok(()) } else { reject(reasons.join("; ")) }
    }

    fn set_settable<R: Reference>(&mut self, vr: &[R], value: &dyn Fn(usize) -> Value) -> Outcome {
        let parameters =
            vr.iter().any(|vr| M::TABLE[vr.index() as usize].causality() == Causality::Parameter);
        let (started, fmi_state) = (self.state.started, self.fmi_state());
        let set = |model: &mut M| {
            for (index, vr) in vr.iter().enumerate() {
                let variable = &M::TABLE[vr.index() as usize];
                if !fmi_state.is_in(variable.settable) {
                    continue;
                }
                variable.set(model, &value(index));
                if !started {
                    model.calculate_start();
                }
            }
        };
        if !parameters {
            self.state.stale = true;
            set(&mut self.state.model);
            return Ok(());
        }
        self.try_change(|model| {
            set(model);
            model.update()
        })
    }

    /// Returns the name of a variable, or an error if its type is not `base`.
    pub fn name(&self, vr: impl Reference, base: BaseType) -> Outcome<&'static str> {
        Ok(self.variable(vr.index(), base)?.name())
    }

    /// Returns whether setting a variable is forbidden by the FMI standard but has no effect. Such calls are
    /// tolerated, because FMPy sets discrete inputs in Continuous-Time Mode to the values that they already have.
    fn changes_nothing(&self, variable: &Variable<M>, value: impl FnOnce() -> Value) -> bool {
        self.mode() == Mode::ContinuousTime
            && variable.causality() == Causality::Input
            && variable.variability() == Variability::Discrete
            && variable.value(&self.state.model) == Some(value())
    }

    fn check_settable(&self, variable: &Variable<M>) -> Outcome {
        if self.fmi_state().is_in(variable.settable) {
            return Ok(());
        }
        let (standard, interface, mode) = (self.standard(), self.interface(), self.mode());
        let calculated = variable.initial() == Some(Initial::Calculated);
        let sources = variable.dependencies().filter(|_| calculated).into_iter().flatten();
        let sources: Vec<_> = sources.map(|known| M::TABLE[known as usize].name()).collect();
        reject_with(|| {
            let instead = match &sources[..] {
                [] => String::new(),
                sources => format!("; its start follows from {}: set these", sources.join(", ")),
            };
            format!(
                "{} cannot be set in state '{mode}' of {interface}; it can be set in: {}{instead}",
                variable.name(),
                variable.settable.names(standard, interface)
            )
        })
    }
}

/// Returns whether a sum is finite. If it is, all its terms are finite, so one check replaces a check of each term.
#[inline(always)]
pub(super) fn is_finite(sum: f64) -> bool {
    // This takes half as many instructions as `f64::is_finite`.
    !(sum * 0.0).is_nan()
}

/// Returns the message for a Binary of `size` bytes, if the variable must be shorter.
pub(crate) fn too_long<M>(variable: &Variable<M>, size: usize) -> Option<String> {
    let Attributes::Binary { max_size, .. } = variable.variable_type().attributes else { return None };
    let name = variable.name();
    (size > max_size).then(|| format!("{name} must not have more than {max_size} bytes, it has {size}"))
}

/// Checks that a number is finite, that a parameter is in the range of its type, that an enumeration has the item,
/// and that a Binary is not too long.
pub(super) fn check_value<M>(variable: &Variable<M>, value: &Value) -> Outcome {
    let name = variable.name();
    let enforced = variable.causality() == Causality::Parameter;
    match (&variable.variable_type().attributes, value) {
        (_, Value::Real(value)) if !value.is_finite() => {
            reject(format!("{name} must be a finite number, it is {value}"))
        }
        (Attributes::Real { min: Some(min), .. }, Value::Real(real)) if enforced && real < min => {
            reject(format!("{name} must not be below {}, it is {value}", Value::Real(*min)))
        }
        (Attributes::Real { max: Some(max), .. }, Value::Real(real)) if enforced && real > max => {
            reject(format!("{name} must not be above {}, it is {value}", Value::Real(*max)))
        }
        (Attributes::Integer { min, max }, Value::Integer(value))
            if enforced && !(min..=max).contains(&value) =>
        {
            reject(format!("{name} must be between {min} and {max}, it is {value}"))
        }
        (Attributes::Enumeration(items), Value::Integer(value))
            if items.iter().all(|item| i128::from(item.value) != *value) =>
        {
            let known: Vec<_> = items.iter().map(|item| format!("{} ({})", item.value, item.name)).collect();
            reject(format!("{name} must be one of {}, it is {value}", known.join(", ")))
        }
        (_, Value::Binary(value)) => match too_long(variable, value.len()) {
            Some(why) => reject(why),
            None => Ok(()),
        },
        _ => Ok(()),
    }
}
