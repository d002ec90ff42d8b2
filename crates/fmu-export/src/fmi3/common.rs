//! Functions of both interface types (sections 2.2 and 2.3 of FMI 3.0), and the numbers of states and event
//! indicators for Model Exchange (section 3.2).
//!
//! # Safety
//! The importer guarantees the contract of the [module above](super#safety).

use super::types::*;
use crate::boundary::life_cycle::experiment;
use crate::boundary::values::*;
use crate::boundary::{in_slice, of_elements, out_slice, out_value, partial_derivatives, reserve};
use crate::export::Exported;
use crate::instance::{FromOne, Instance, Outcome, reject, too_long};
use fmi_abi::BaseType::{self, *};
use fmi_abi::{Mode, Status, Value};

pub unsafe fn fmi3EnterInitializationMode<M: Exported>(
    instance: &mut Instance<M>,
    tolerance_defined: fmi3Boolean,
    tolerance: fmi3Float64,
    start_time: fmi3Float64,
    stop_time_defined: fmi3Boolean,
    stop_time: fmi3Float64,
) -> Outcome {
    instance.enter_initialization_mode_at(experiment(
        tolerance_defined,
        tolerance,
        start_time,
        stop_time_defined,
        stop_time,
    ))
}

/// Accepts the call before the initialization, because FMIKit makes it there for every FMU with inputs. The call
/// changes nothing: Configuration Mode exists for structural parameters (section 2.3.6 of FMI 3.0), which models of
/// this crate do not have.
pub unsafe fn fmi3EnterConfigurationMode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    if instance.mode() != Mode::Instantiated {
        return reject("this FMU has no structural parameters");
    }
    instance.logger.log(Status::Ok, "there are no structural parameters to configure, so nothing changes");
    Ok(())
}

/// Accepts the call that follows [`fmi3EnterConfigurationMode`]. Neither function changes the state.
pub unsafe fn fmi3ExitConfigurationMode<M: Exported>(_: &mut Instance<M>) -> Outcome {
    Ok(())
}

// Enumerations use the functions of Int64 (section 2.2.7.2 of FMI 3.0).
getters_and_setters! { FromOne, [value_count];
    fmi3GetFloat64 get_reals, fmi3SetFloat64 set_reals, fmi3Float64: [Real];
    fmi3GetFloat32 get_float32, fmi3SetFloat32 set_float32, fmi3Float32: [Float32];
    fmi3GetInt8 get_integers, fmi3SetInt8 set_integers, fmi3Int8: [Int8];
    fmi3GetUInt8 get_integers, fmi3SetUInt8 set_integers, fmi3UInt8: [UInt8];
    fmi3GetInt16 get_integers, fmi3SetInt16 set_integers, fmi3Int16: [Int16];
    fmi3GetUInt16 get_integers, fmi3SetUInt16 set_integers, fmi3UInt16: [UInt16];
    fmi3GetInt32 get_integers, fmi3SetInt32 set_integers, fmi3Int32: [Integer];
    fmi3GetUInt32 get_integers, fmi3SetUInt32 set_integers, fmi3UInt32: [UInt32];
    fmi3GetInt64 get_integers, fmi3SetInt64 set_integers, fmi3Int64: [Int64, Enumeration];
    fmi3GetUInt64 get_integers, fmi3SetUInt64 set_integers, fmi3UInt64: [UInt64];
    fmi3GetBoolean get_booleans, fmi3SetBoolean set_booleans, fmi3Boolean: [Boolean];
    fmi3GetString get_strings, fmi3SetString set_strings, fmi3String: [String];
}

/// Gets binary values. The instance owns the bytes, which are valid until the next call on it.
pub unsafe fn fmi3GetBinary<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    sizes: *mut usize,
    values: *mut fmi3Binary,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract, the pointers are NULL or point to arrays of these lengths, which do not overlap.
    unsafe {
        of_elements::<M, FromOne>(instance, vr, count, value_count, |instance, vr| {
            let values = out_slice(values, value_count, "values")?;
            let sizes = out_slice(sizes, value_count, "valueSizes")?;
            let mut found = Vec::new();
            reserve(&mut found, vr.len())?;
            instance.get(vr, &[BaseType::Binary], &mut |_, value| {
                if let Value::Binary(bytes) = value {
                    found.push(bytes);
                }
            })?;
            for ((bytes, size), value) in found.iter().zip(sizes).zip(values) {
                size.write(bytes.len());
                value.write(bytes.as_ptr());
            }
            instance.bytes = found;
            Ok(())
        })
    }
}

pub unsafe fn fmi3SetBinary<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    sizes: *const usize,
    values: *const fmi3Binary,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract, the pointers are NULL or point to arrays of these lengths; each value is NULL or has its
    // size.
    unsafe {
        of_elements::<M, FromOne>(instance, vr, count, value_count, |instance, vr| {
            let values: &[fmi3Binary] = in_slice(values, value_count, "values")?;
            let sizes = in_slice(sizes, value_count, "valueSizes")?;
            let bytes = |index: usize, name| in_slice(values[index], sizes[index], name);
            for (index, of) in vr.iter().enumerate() {
                let variable = instance.variable(*of, BaseType::Binary)?;
                bytes(index, variable.name())?;
                if let Some(why) = too_long(variable, sizes[index]) {
                    return instance.reject_value(vr, &[BaseType::Binary], index, |_| why);
                }
            }
            instance.set(vr, &[BaseType::Binary], &|index| {
                Value::Binary(bytes(index, "values").unwrap_or_default().to_vec())
            })
        })
    }
}

/// Defines the functions that compute partial derivatives; `true` denotes adjoint derivatives.
macro_rules! derivatives {
    ($($function:ident: $adjoint:literal;)+) => {
        $(
            pub unsafe fn $function<M: Exported>(
                instance: &mut Instance<M>,
                unknown: *const fmi3ValueReference,
                unknown_count: usize,
                known: *const fmi3ValueReference,
                known_count: usize,
                seed: *const fmi3Float64,
                seed_count: usize,
                sensitivity: *mut fmi3Float64,
                sensitivity_count: usize,
            ) -> Outcome {
                // SAFETY: by contract, the pointers are NULL or point to arrays of these lengths; the array of
                // results does not overlap the others.
                unsafe {
                    partial_derivatives::<M, FromOne, $adjoint>(
                        instance,
                        ["unknowns", "knowns", "seed", "sensitivity"],
                        (unknown, unknown_count),
                        (known, known_count),
                        (seed, seed_count),
                        (sensitivity, sensitivity_count),
                    )
                }
            }
        )+
    };
}

derivatives! {
    fmi3GetDirectionalDerivative: false;
    fmi3GetAdjointDerivative: true;
}

pub unsafe fn fmi3EvaluateDiscreteStates<M: Exported>(_: &mut Instance<M>) -> Outcome {
    reject("fmi3UpdateDiscreteStates evaluates the discrete states (providesEvaluateDiscreteStates is false)")
}

pub unsafe fn fmi3UpdateDiscreteStates<M: Exported>(
    instance: &mut Instance<M>,
    again: *mut fmi3Boolean,
    terminate: *mut fmi3Boolean,
    nominals_changed: *mut fmi3Boolean,
    states_changed: *mut fmi3Boolean,
    next_defined: *mut fmi3Boolean,
    next: *mut fmi3Float64,
) -> Outcome {
    // SAFETY: by contract, each is NULL or points to a value.
    let (again, terminate, nominals_changed, states_changed, next_defined, next) = unsafe {
        (
            out_value(again, "discreteStatesNeedUpdate")?,
            out_value(terminate, "terminateSimulation")?,
            out_value(nominals_changed, "nominalsOfContinuousStatesChanged")?,
            out_value(states_changed, "valuesOfContinuousStatesChanged")?,
            out_value(next_defined, "nextEventTimeDefined")?,
            out_value(next, "nextEventTime")?,
        )
    };
    let event = instance.event()?;
    again.write(event.again.into());
    terminate.write(event.terminate.into());
    nominals_changed.write(event.nominals_changed.into());
    states_changed.write(event.states_changed.into());
    next_defined.write(event.next.is_some().into());
    next.write(event.next.unwrap_or(0.0));
    Ok(())
}

pub unsafe fn fmi3GetNumberOfEventIndicators<M: Exported>(_: &mut Instance<M>, count: *mut usize) -> Outcome {
    // SAFETY: by contract, the pointer is NULL or points to a value.
    unsafe { out_value(count, "nEventIndicators") }?.write(Instance::<M>::INDICATORS);
    Ok(())
}

pub unsafe fn fmi3GetNumberOfContinuousStates<M: Exported>(
    _: &mut Instance<M>,
    count: *mut usize,
) -> Outcome {
    // SAFETY: by contract, the pointer is NULL or points to a value.
    unsafe { out_value(count, "nContinuousStates") }?.write(M::STATES.len());
    Ok(())
}
