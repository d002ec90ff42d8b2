//! An FMU in Continuous-Time Mode, as the solver needs it: derivatives, event indicators and the Jacobian.

use super::inputs::{Break, Signals};
use crate::description::Description;
use crate::running::Running;
use crate::selection::Selection;
use fmi_abi::{Interface, Status};
use fmi_client::{Continuous, Rejection};
use ivp::ivp::FirstOrderSystem;
use ivp::matrix::Matrix;
use std::cell::{RefCell, RefMut};

/// Value of all derivatives where the FMU has none, so that the solver takes a shorter step.
const FAR: f64 = 1e60;
/// States beyond this result from [`FAR`]; the FMU is not called with them.
const TOO_FAR: f64 = 1e40;
/// Number of evaluations without a value after which the run fails, unless a step succeeds before.
const MOST_MISSES: usize = 1000;

/// An FMU with its inputs. The solver and the march share it.
pub(crate) struct Model<'a>(RefCell<Parts<'a>>);

/// State of a [`Model`].
pub(crate) struct Parts<'a> {
    pub running: &'a mut Running,
    inputs: Signals<'a>,
    /// Continuous inputs, and those that change only at events.
    moving: &'a Selection,
    held: &'a Selection,
    /// Value references of derivatives and states, if the FMU provides directional derivatives.
    jacobian: Option<(Vec<u32>, Vec<u32>)>,
    pub nominals: Vec<f64>,
    /// Whether the solver can take a shorter step.
    retries: bool,
    /// Time and states that the FMU has.
    at: Option<f64>,
    x: Vec<f64>,
    row: Vec<f64>,
    /// Number of evaluations without a value since the last step, and the reason of the last.
    misses: usize,
    miss: Option<Rejection>,
    /// Error after which the FMU is not called any more.
    fault: Option<Rejection>,
}

impl<'a> Model<'a> {
    pub fn new(
        running: &'a mut Running,
        description: &Description,
        inputs: Signals<'a>,
        [moving, held]: [&'a Selection; 2],
        retries: bool,
    ) -> Self {
        Self(RefCell::new(Parts {
            running,
            inputs,
            moving,
            held,
            jacobian: jacobian_of(description),
            nominals: vec![1.0; description.states],
            retries,
            at: None,
            x: Vec::new(),
            row: Vec::new(),
            misses: 0,
            miss: None,
            fault: None,
        }))
    }

    pub fn parts(&self) -> RefMut<'_, Parts<'a>> {
        self.0.borrow_mut()
    }
}

/// Returns the value references for directional derivatives of the derivatives with respect to the states.
fn jacobian_of(description: &Description) -> Option<(Vec<u32>, Vec<u32>)> {
    description.offer(Interface::ModelExchange).filter(|offer| offer.directional_derivatives)?;
    let derivatives = description.elements(&description.derivatives);
    let pairs = derivatives.map(|derivative| {
        let state = description.variable(derivative.derivative_of.as_ref()?)?;
        Some((derivative.reference, state.reference))
    });
    pairs.collect::<Option<Vec<_>>>().map(|pairs| pairs.into_iter().unzip())
}

impl Parts<'_> {
    /// Begins at this time, before the initialization: sets the inputs.
    pub fn begin(&mut self, time: f64) -> Result<(), Rejection> {
        self.inputs.begin(time);
        self.set_inputs(time)
    }

    /// Sets all inputs, in Initialization Mode or Event Mode.
    pub fn set_inputs(&mut self, time: f64) -> Result<(), Rejection> {
        self.at = None;
        let Self { running, inputs, moving, held, row, .. } = self;
        if !moving.is_empty() {
            inputs.moving(time, row);
            running.set(moving, row)?;
        }
        if !held.is_empty() {
            inputs.held(time, row);
            running.set(held, row)?;
        }
        Ok(())
    }

    /// Returns the time of the next break of the inputs, s.
    pub fn until(&self) -> f64 {
        self.inputs.until()
    }

    pub(super) fn pass(&mut self, time: f64, is_end: bool) -> Break {
        let found = self.inputs.pass(time, is_end);
        if found != Break::None {
            self.at = None;
        }
        found
    }

    /// Sets time, continuous inputs and states, unless the FMU has them.
    #[inline]
    pub fn set(&mut self, time: f64, x: &[f64]) -> Result<(), Rejection> {
        if self.at == Some(time) && self.x == x {
            return Ok(());
        }
        let Self { running, inputs, moving, row, .. } = self;
        running.sole().set_time(time)?;
        if !moving.is_empty() && (self.at.is_none() || inputs.is_moving()) {
            inputs.moving(time, row);
            running.set(moving, row)?;
        }
        if !x.is_empty() {
            running.sole().set_continuous_states(x)?;
        }
        self.at = Some(time);
        self.x.clear();
        self.x.extend_from_slice(x);
        Ok(())
    }

    /// Reads the derivatives.
    #[inline]
    fn derivatives(&mut self, time: f64, x: &[f64], values: &mut [f64]) -> Result<(), Rejection> {
        self.set(time, x)?;
        self.running.sole().get_continuous(Continuous::Derivatives, values)
    }

    /// Evaluates the derivatives at the beginning of a step, where a shorter one does not help.
    pub fn check_derivatives(&mut self, time: f64, x: &[f64]) -> Result<(), Rejection> {
        let mut values = vec![0.0; x.len()];
        self.derivatives(time, x, &mut values)?;
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(index) => Err(missing("the derivative of state", index, values[index], time)),
        }
    }

    /// Reads the event indicators.
    pub fn indicators(&mut self, time: f64, x: &[f64], values: &mut [f64]) -> Result<(), Rejection> {
        self.set(time, x)?;
        self.running.sole().get_continuous(Continuous::EventIndicators, values)?;
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
        self.running.sole().get_continuous(Continuous::States, x)
    }

    /// Reads the nominal values of the states. Values that are not above 0 count as 1.
    pub fn read_nominals(&mut self) -> Result<(), Rejection> {
        if self.nominals.is_empty() {
            return Ok(());
        }
        self.running.sole().get_continuous(Continuous::Nominals, &mut self.nominals)?;
        for nominal in &mut self.nominals {
            *nominal = nominal.abs();
            if !(*nominal > 0.0 && nominal.is_finite()) {
                *nominal = 1.0;
            }
        }
        Ok(())
    }

    /// Records an accepted step.
    pub fn accepted(&mut self) {
        (self.misses, self.miss) = (0, None);
    }

    /// Returns the reason why the FMU had no derivatives since the last step.
    pub fn take_miss(&mut self) -> Option<Rejection> {
        self.miss.take()
    }

    /// Returns the reason why derivatives could not be evaluated.
    pub fn take_fault(&mut self) -> Option<Rejection> {
        self.fault.take()
    }

    pub fn has_failed(&self) -> bool {
        self.fault.is_some()
    }

    /// Evaluates the derivatives. If the FMU cannot, the solver gets [`FAR`] and takes a shorter step. After an error it gets 0, so
    /// that its step succeeds and the march observes the error.
    fn evaluate(&mut self, time: f64, x: &[f64], values: &mut [f64]) {
        if self.has_failed() {
            return values.fill(0.0);
        }
        let is_far = x.iter().any(|x| x.is_nan() || x.abs() > TOO_FAR);
        let result = if is_far { None } else { Some(self.derivatives(time, x, values)) };
        let index = values.iter().position(|value| !value.is_finite());
        let why = match (result, index) {
            (Some(Ok(())), None) => return,
            (Some(Ok(())), Some(index)) => missing("the derivative of state", index, values[index], time),
            (None, _) => missing("the solver's estimate of state", 0, f64::INFINITY, time),
            (Some(Err(rejection)), _) if rejection.status() == Status::Discard => rejection,
            (Some(Err(rejection)), _) => {
                self.fault = Some(rejection);
                return values.fill(0.0);
            }
        };
        self.at = None;
        self.misses += 1;
        if self.retries && self.misses < MOST_MISSES {
            values.fill(FAR);
            // An estimate that is too far off is not a reason, but a consequence of one.
            if !is_far {
                self.miss = Some(why);
            }
        } else {
            self.fault = Some(why);
            values.fill(0.0);
        }
    }

    /// Evaluates the Jacobian: by directional derivatives, else by differences.
    fn jacobian(&mut self, time: f64, x: &[f64], j: &mut Matrix) {
        let n = x.len();
        let (mut before, mut after, mut moved) = (vec![0.0; n], vec![0.0; n], x.to_vec());
        if let Some((derivatives, states)) = self.jacobian.take() {
            let columns = self.set(time, x).and_then(|()| {
                (0..n).try_for_each(|column| {
                    let state = &states[column..=column];
                    self.running.sole().directional_derivative(&derivatives, state, &[1.0], &mut after)?;
                    (0..n).for_each(|row| j[(row, column)] = after[row]);
                    Ok::<_, Rejection>(())
                })
            });
            if columns.is_ok() {
                self.jacobian = Some((derivatives, states));
                return;
            }
            // An FMU may promise directional derivatives that it does not have; differences replace them from here on.
            self.running.forget_log();
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

fn missing(what: &str, index: usize, value: f64, time: f64) -> Rejection {
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
