//! The functions of an FMU in Continuous-Time Mode that the solver needs: derivatives, event indicators and the Jacobian.

use super::inputs::{Break, Signals};
use crate::description::Description;
use crate::selection::Selection;
use crate::system_instance::SystemInstance;
use fmi_abi::client::{Continuous, Rejection};
use fmi_abi::{Interface, Status, shown_number};
use ivp::ivp::FirstOrderSystem;
use ivp::matrix::Matrix;
use std::cell::{RefCell, RefMut};

/// Value that all derivatives get where the FMU cannot evaluate them, so that the solver rejects the step and takes a shorter one.
const FAR: f64 = 1e60;
/// Largest magnitude of a state with which the FMU is called. Larger states result from [`FAR`] or from a model that diverges.
const TOO_FAR: f64 = 1e40;
/// The run fails at this number of failed evaluations since the last successful step.
const MOST_MISSES: usize = 1000;

/// An FMU with its inputs, shared by the solver and the event handling.
pub(crate) struct Model<'a>(RefCell<Parts<'a>>);

/// State of a [`Model`].
pub(crate) struct Parts<'a> {
    pub instance: &'a mut SystemInstance,
    inputs: Signals<'a>,
    /// Continuous inputs.
    moving: &'a Selection,
    held: &'a Selection,
    /// Value references of derivatives and states for the Jacobian, if the FMU provides directional derivatives.
    jacobian: Option<(Vec<u32>, Vec<u32>)>,
    pub nominals: Vec<f64>,
    /// Whether the solver can take a shorter step after a failed evaluation.
    retries: bool,
    /// Time that was last set in the FMU, s; `None` if time, inputs and states must be set again.
    at: Option<f64>,
    x: Vec<f64>,
    /// Buffer for inputs.
    row: Vec<f64>,
    /// The derivatives that were read last, and whether they are those at `at` and `x`.
    values: Vec<f64>,
    are_known: bool,
    /// Number of failed evaluations since the last step.
    misses: usize,
    /// Reason for the last failed evaluation, except evaluations with states beyond [`TOO_FAR`].
    miss: Option<Rejection>,
    /// Error after which the FMU is not called any more.
    fault: Option<Rejection>,
}

impl<'a> Model<'a> {
    pub fn new(
        instance: &'a mut SystemInstance,
        description: &Description,
        inputs: Signals<'a>,
        [moving, held]: [&'a Selection; 2],
        retries: bool,
    ) -> Self {
        Self(RefCell::new(Parts {
            instance,
            inputs,
            moving,
            held,
            jacobian: jacobian_of(description),
            nominals: vec![1.0; description.states],
            retries,
            at: None,
            x: Vec::new(),
            row: Vec::new(),
            values: Vec::new(),
            are_known: false,
            misses: 0,
            miss: None,
            fault: None,
        }))
    }

    pub fn parts(&self) -> RefMut<'_, Parts<'a>> {
        self.0.borrow_mut()
    }
}

/// Returns the value references of the state derivatives and of the states, if the FMU provides directional derivatives and none of them
/// is an array without elements here.
fn jacobian_of(description: &Description) -> Option<(Vec<u32>, Vec<u32>)> {
    description.offer(Interface::ModelExchange).filter(|offer| offer.directional_derivatives)?;
    let derivatives = description.elements(&description.derivatives);
    let pairs = derivatives.map(|derivative| {
        Some((derivative.reference, description.variables[derivative.derivative_of?].reference))
    });
    let pairs = pairs.collect::<Option<Vec<_>>>()?;
    (pairs.len() == description.states).then(|| pairs.into_iter().unzip())
}

impl Parts<'_> {
    /// Sets the inputs at the start time, s, in Initialization Mode.
    pub fn begin(&mut self, time: f64) -> Result<(), Rejection> {
        self.inputs.begin(time);
        self.set_inputs(time)
    }

    /// Sets all inputs to their values at this time, s, in Initialization Mode or Event Mode.
    pub fn set_inputs(&mut self, time: f64) -> Result<(), Rejection> {
        self.at = None;
        let Self { instance, inputs, moving, held, row, .. } = self;
        if !moving.is_empty() {
            inputs.moving(time, row);
            instance.set(moving, row)?;
        }
        if !held.is_empty() {
            inputs.held(time, row);
            instance.set(held, row)?;
        }
        Ok(())
    }

    /// Returns the time of the next break of the inputs, s.
    pub fn until(&self) -> f64 {
        self.inputs.until()
    }

    /// Passes the breaks of inputs up to this time, s.
    pub(super) fn pass(&mut self, time: f64, is_end: bool) -> Break {
        let found = self.inputs.pass(time, is_end);
        if found != Break::None {
            self.at = None;
        }
        found
    }

    /// Sets time, continuous inputs and states, unless the FMU has these values already.
    #[inline]
    pub fn set(&mut self, time: f64, x: &[f64]) -> Result<(), Rejection> {
        if self.at == Some(time) && self.x == x {
            return Ok(());
        }
        self.are_known = false;
        let Self { instance, inputs, moving, row, .. } = self;
        instance.sole().set_time(time)?;
        if !moving.is_empty() && (self.at.is_none() || inputs.is_moving()) {
            inputs.moving(time, row);
            instance.set(moving, row)?;
        }
        if !x.is_empty() {
            instance.sole().set_continuous_states(x)?;
        }
        self.at = Some(time);
        self.x.clear();
        self.x.extend_from_slice(x);
        Ok(())
    }

    /// Reads the derivatives, or copies them if they were read last at this time and these states.
    #[inline]
    pub(super) fn derivatives(&mut self, time: f64, x: &[f64], values: &mut [f64]) -> Result<(), Rejection> {
        self.read_derivatives(time, x)?;
        values.copy_from_slice(&self.values);
        Ok(())
    }

    /// Sets time, inputs and states, and evaluates the derivatives, so that outputs can be read. Some FMUs, such as those of
    /// OpenModelica 1.12, calculate other variables only when the derivatives are read, and would otherwise return old values. Others,
    /// such as those of OpenModelica 1.21, calculate them when they are read after time or states have been set, but not if the
    /// derivatives were read in between, so both are set once more. Derivatives that the FMU cannot evaluate here are not an error,
    /// because the solver does not use them.
    pub fn observe(&mut self, time: f64, x: &[f64]) -> Result<&mut SystemInstance, Rejection> {
        if x.is_empty() {
            self.at = None;
            self.set(time, x)?;
            return Ok(self.instance);
        }
        match self.read_derivatives(time, x) {
            Err(rejection) if rejection.status() != Status::Discard => return Err(rejection),
            _ => {
                self.instance.sole().set_time(time)?;
                self.instance.sole().set_continuous_states(x)?;
            }
        }
        Ok(self.instance)
    }

    /// Notifies the FMU of a completed step. Returns whether it requests an event, and whether it requests the end of the simulation.
    pub fn complete_step(&mut self, time: f64, x: &[f64]) -> Result<[bool; 2], Rejection> {
        self.set(time, x)?;
        self.are_known = false;
        self.instance.sole().completed_integrator_step()
    }

    /// Evaluates the derivatives at the beginning of an interval and fails if one is not finite, because a shorter step would not
    /// help.
    pub fn check_derivatives(&mut self, time: f64, x: &[f64]) -> Result<(), Rejection> {
        self.read_derivatives(time, x)?;
        match self.values.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(index) => Err(missing("the derivative of state", index, self.values[index], time)),
        }
    }

    /// Reads the derivatives into the buffer `values`, unless they are there already.
    #[inline]
    fn read_derivatives(&mut self, time: f64, x: &[f64]) -> Result<(), Rejection> {
        self.set(time, x)?;
        if !self.are_known {
            self.values.resize(x.len(), 0.0);
            self.instance.sole().get_continuous(Continuous::Derivatives, &mut self.values)?;
            self.are_known = true;
        }
        Ok(())
    }

    /// Reads the event indicators. Fails if one is NaN.
    pub fn indicators(&mut self, time: f64, x: &[f64], values: &mut [f64]) -> Result<(), Rejection> {
        self.set(time, x)?;
        self.instance.sole().get_continuous(Continuous::EventIndicators, values)?;
        match values.iter().position(|value| value.is_nan()) {
            None => Ok(()),
            Some(index) => Err(missing("event indicator", index, values[index], time)),
        }
    }

    /// Reads the states.
    pub fn states(&mut self, x: &mut [f64]) -> Result<(), Rejection> {
        self.at = None;
        if x.is_empty() {
            return Ok(());
        }
        self.instance.sole().get_continuous(Continuous::States, x)
    }

    /// Reads the magnitudes of the nominal values of the states. Values that are 0 or not finite are replaced by 1.
    pub fn read_nominals(&mut self) -> Result<(), Rejection> {
        if self.nominals.is_empty() {
            return Ok(());
        }
        self.instance.sole().get_continuous(Continuous::Nominals, &mut self.nominals)?;
        for nominal in &mut self.nominals {
            *nominal = nominal.abs();
            if !(*nominal > 0.0 && nominal.is_finite()) {
                *nominal = 1.0;
            }
        }
        Ok(())
    }

    /// Clears the record of failed evaluations after a successful step.
    pub fn accepted(&mut self) {
        (self.misses, self.miss) = (0, None);
    }

    /// Returns the reason for the last failed evaluation since the last step, except evaluations with states beyond [`TOO_FAR`].
    pub fn take_miss(&mut self) -> Option<Rejection> {
        self.miss.take()
    }

    /// Returns the error after which the FMU is not called any more, if there was one.
    pub fn take_fault(&mut self) -> Option<Rejection> {
        self.fault.take()
    }

    pub fn has_failed(&self) -> bool {
        self.fault.is_some()
    }

    /// Evaluates the derivatives. If the FMU cannot evaluate them but a shorter step may help, the solver gets [`FAR`]. After an
    /// error it gets 0, so that its step succeeds and `solout` can stop it.
    fn evaluate(&mut self, time: f64, x: &[f64], values: &mut [f64]) {
        if self.has_failed() {
            return values.fill(0.0);
        }
        let far = x.iter().position(|x| x.is_nan() || x.abs() > TOO_FAR);
        let result = far.map_or_else(|| Ok(self.derivatives(time, x, values)), Err);
        let index = values.iter().position(|value| !value.is_finite());
        let why = match (result, index) {
            (Ok(Ok(())), None) => return,
            (Ok(Ok(())), Some(index)) => missing("the derivative of state", index, values[index], time),
            (Err(index), _) => missing("the solver's estimate of state", index, x[index], time),
            (Ok(Err(rejection)), _) if rejection.status() == Status::Discard => rejection,
            (Ok(Err(rejection)), _) => {
                self.fault = Some(rejection);
                return values.fill(0.0);
            }
        };
        self.at = None;
        self.misses += 1;
        if self.retries && self.misses < MOST_MISSES {
            values.fill(FAR);
            // States that are too large usually result from an earlier failure, so the reason for that failure is kept.
            if far.is_none() {
                self.miss = Some(why);
            }
        } else {
            self.fault = Some(why);
            values.fill(0.0);
        }
    }

    /// Evaluates the Jacobian with directional derivatives if the FMU has them, otherwise with finite differences.
    fn jacobian(&mut self, time: f64, x: &[f64], j: &mut Matrix) {
        let n = x.len();
        let (mut before, mut after, mut moved) = (vec![0.0; n], vec![0.0; n], x.to_vec());
        if let Some((derivatives, states)) = self.jacobian.take() {
            self.are_known = false;
            let columns = self.set(time, x).and_then(|()| {
                (0..n).try_for_each(|column| {
                    let state = &states[column..=column];
                    self.instance.sole().directional_derivative(&derivatives, state, &[1.0], &mut after)?;
                    (0..n).for_each(|row| j[(row, column)] = after[row]);
                    Ok::<_, Rejection>(())
                })
            });
            if columns.is_ok() {
                self.jacobian = Some((derivatives, states));
                return;
            }
            // The FMU declares directional derivatives, but a call has failed. From here on, finite differences replace them.
            self.instance.forget_log();
        }
        self.evaluate(time, x, &mut before);
        for column in 0..n {
            let size = f64::EPSILON.sqrt() * x[column].abs().max(self.nominals[column]);
            moved[column] = x[column] + size;
            self.evaluate(time, &moved, &mut after);
            (0..n)
                .for_each(|row| j[(row, column)] = (after[row] - before[row]) / (moved[column] - x[column]));
            moved[column] = x[column];
        }
    }
}

/// Returns the error for a value that is not finite or is too large.
fn missing(what: &str, index: usize, value: f64, time: f64) -> Rejection {
    let [value, time] = [value, time].map(shown_number);
    Rejection::without_fmu("Model Exchange", &format!("{what} {} is {value} at t = {time} s", index + 1))
}

impl FirstOrderSystem for Model<'_> {
    #[inline]
    fn derivative(&self, time: f64, x: &[f64], values: &mut [f64]) {
        self.parts().evaluate(time, x, values);
    }

    fn jac(&self, time: f64, x: &[f64], j: &mut Matrix) {
        self.parts().jacobian(time, x, j);
    }
}
