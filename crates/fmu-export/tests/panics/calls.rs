//! A call of every function that runs code of the model, with the value of the parameter that makes this code panic.

use crate::models::Faulty;
use crate::models::faulty::{Name, Panic, while_all_break};
use crate::{BOOLEAN, PANIC, STRING, U, X, Y};
use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::Status;
use fmu_export::fmi3::{indicator, reference};
use fmu_test_kit::{Either, Importer, fmi3};
use std::ffi::c_void;
use std::ptr::{null, null_mut};

/// Interface type, name of the function without `fmi2` and without `fmi3`, where the model panics, and a call that this ends.
pub type Case<F> = (Interface, [&'static str; 2], Panic, fn(&F) -> Status);

/// Calls that both FMI versions have.
pub fn of_both<F: Either>() -> Vec<Case<F>> {
    const REALS: [&str; 2] = ["GetReal", "GetFloat64"];
    const INTEGERS: [&str; 2] = ["SetInteger", "SetInt32"];
    vec![
        (CoSimulation, REALS, Panic::Read, |fmu| fmu.try_get(&[Y], &mut [0.0])),
        (CoSimulation, REALS, Panic::NoMessage, |fmu| fmu.try_get(&[Y], &mut [0.0])),
        (CoSimulation, REALS, Panic::Bomb, |fmu| fmu.try_get(&[Y], &mut [0.0])),
        (CoSimulation, REALS, Panic::Calculate, |fmu| fmu.try_get(&[Y], &mut [0.0])),
        (CoSimulation, ["SetReal", "SetFloat64"], Panic::Then, |fmu| fmu.try_set(&[U], &[1.0])),
        (ModelExchange, ["SetReal", "SetFloat64"], Panic::Then, |fmu| fmu.try_set(&[X], &[1.0])),
        (CoSimulation, INTEGERS, Panic::Update, |fmu| set_panic(fmu, Panic::Update)),
        (CoSimulation, INTEGERS, Panic::None, |fmu| {
            while_all_break(Panic::Clone, || set_panic(fmu, Panic::None))
        }),
        (CoSimulation, INTEGERS, Panic::Drop, |fmu| set_panic(fmu, Panic::None)),
        (CoSimulation, INTEGERS, Panic::Log, |fmu| set_panic(fmu, Panic::Log)),
        (CoSimulation, ["SetBoolean"; 2], Panic::Then, |fmu| fmu.set_boolean(BOOLEAN, 1)),
        (CoSimulation, ["SetString"; 2], Panic::Then, |fmu| fmu.set_string(STRING, c"a".as_ptr())),
        (CoSimulation, ["DoStep"; 2], Panic::Step, |fmu| fmu.try_step(0.0, 0.1)),
        (CoSimulation, ["GetInteger", "GetInt32"], Panic::Read, |fmu| fmu.get_integer(N, &mut 0)),
        (CoSimulation, ["GetBoolean"; 2], Panic::Read, |fmu| fmu.get_boolean(BOOLEAN, &mut 0)),
        (CoSimulation, ["GetString"; 2], Panic::ReadString, |fmu| fmu.get_string(STRING, &mut null())),
        (
            CoSimulation,
            ["GetRealOutputDerivatives", "GetOutputDerivatives"],
            Panic::OutputDerivative,
            |fmu| fmu.try_rate(Y, 1, &mut 0.0),
        ),
        (CoSimulation, ["GetDirectionalDerivative"; 2], Panic::Partial, |fmu| {
            fmu.try_directional(&[Y], &[U], &[1.0], &mut [0.0])
        }),
        (ModelExchange, ["NewDiscreteStates", "UpdateDiscreteStates"], Panic::Event, |fmu| {
            fmu.ok(fmu.enter_event_mode());
            fmu.try_update().unwrap_err()
        }),
        (ModelExchange, ["CompletedIntegratorStep"; 2], Panic::StepCompleted, |fmu| {
            fmu.try_completed_step().unwrap_err()
        }),
        (ModelExchange, ["GetEventIndicators"; 2], Panic::Indicators, |fmu| fmu.get_indicators(&mut 0.0, 1)),
        (ModelExchange, ["GetNominalsOfContinuousStates"; 2], Panic::Nominals, |fmu| {
            fmu.get_nominals(&mut 0.0, 1)
        }),
        (ModelExchange, ["GetDerivatives", "GetContinuousStateDerivatives"], Panic::Read, |fmu| {
            fmu.get_derivatives(&mut 0.0, 1)
        }),
        (ModelExchange, ["GetContinuousStates"; 2], Panic::Calculate, |fmu| fmu.get_states(&mut 0.0, 1)),
        (ModelExchange, ["SetContinuousStates"; 2], Panic::Then, |fmu| fmu.set_states(&0.0, 1)),
        (CoSimulation, ["GetFMUstate", "GetFMUState"], Panic::None, |fmu| {
            let mut state = null_mut();
            let status = while_all_break(Panic::Clone, || fmu.get_state(&mut state));
            assert!(state.is_null());
            status
        }),
        (CoSimulation, ["GetFMUstate", "GetFMUState"], Panic::None, |fmu| {
            with_state(fmu, |state| while_all_break(Panic::Clone, || fmu.get_state(state)))
        }),
        (CoSimulation, ["SetFMUstate", "SetFMUState"], Panic::None, |fmu| {
            with_state(fmu, |state| while_all_break(Panic::Clone, || fmu.set_state(*state)))
        }),
        (CoSimulation, ["FreeFMUstate", "FreeFMUState"], Panic::Drop, |fmu| {
            with_state(fmu, |state| {
                let status = fmu.free_state(state);
                assert!(state.is_null());
                status
            })
        }),
        (CoSimulation, ["SerializedFMUstateSize", "SerializedFMUStateSize"], Panic::Memory, |fmu| {
            with_state(fmu, |state| fmu.state_size(*state, &mut 0))
        }),
        (CoSimulation, ["SerializeFMUstate", "SerializeFMUState"], Panic::Memory, |fmu| {
            with_state(fmu, |state| fmu.serialize_into(*state, [0; 100].as_mut_ptr(), 100))
        }),
        (CoSimulation, ["DeSerializeFMUstate", "DeserializeFMUState"], Panic::Memory, |fmu| {
            let bytes = F::in_mode::<Faulty>(CoSimulation, fmu_export::Mode::Instantiated).bytes();
            let mut state = null_mut();
            let status = fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state);
            assert!(state.is_null());
            status
        }),
    ]
}

/// Calls that only one FMI version has.
pub trait Special: Either + Sized + 'static {
    const CALLS: &'static [Case<Self>];
}

const N: u32 = Name::n as u32;

impl Special for Importer {
    const CALLS: &'static [Case<Self>] =
        &[(CoSimulation, ["SetRealInputDerivatives", ""], Panic::InputDerivative, |fmu| {
            fmu.fmi2SetRealInputDerivatives(&U, 1, &1, &1.0)
        })];
}

impl Special for fmi3::Importer {
    const CALLS: &'static [Case<Self>] = &[
        (CoSimulation, ["", "GetAdjointDerivative"], Panic::Partial, |fmu| {
            fmu.fmi3GetAdjointDerivative(&reference(Y), 1, &reference(U), 1, &1.0, 1, &mut 0.0, 1)
        }),
        // The variable that represents the event indicator.
        (ModelExchange, ["", "GetFloat64"], Panic::Indicators, |fmu| {
            fmu.try_get(&[indicator::<Faulty>(0)], &mut [0.0])
        }),
    ];
}

pub fn set_panic(fmu: &impl Either, panic: Panic) -> Status {
    fmu.set_integer(PANIC, panic as i32)
}

/// Runs the function on a saved state of the instance.
fn with_state(fmu: &impl Either, function: impl FnOnce(&mut *mut c_void) -> Status) -> Status {
    function(&mut fmu.save())
}
