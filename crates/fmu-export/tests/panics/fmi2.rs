//! The functions of FMI 2.0.

use crate::toys::Faulty;
use crate::toys::faulty::{Fault, Name, while_all_break};
use crate::{Case, Standard, TEXT, TRUTH, U, X, Y, with_state};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_test_kit::Importer;
use std::ptr::{null, null_mut};

/// A call that breaks an instance with this fault: every function that runs a model's code.
pub const CALLS: &[Case<Importer>] = &[
    (CoSimulation, "fmi2GetReal", Fault::Read, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetReal", Fault::NoMessage, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetReal", Fault::Bomb, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetReal", Fault::Calculate, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetInteger", Fault::Read, |fmu| fmu.fmi2GetInteger(&(Name::n as u32), 1, &mut 0)),
    (CoSimulation, "fmi2GetBoolean", Fault::Read, |fmu| fmu.fmi2GetBoolean(&TRUTH, 1, &mut 0)),
    (CoSimulation, "fmi2GetString", Fault::ReadText, |fmu| fmu.fmi2GetString(&TEXT, 1, &mut null())),
    (CoSimulation, "fmi2SetReal", Fault::Then, |fmu| fmu.try_set(&[U], &[1.0])),
    (CoSimulation, "fmi2SetInteger", Fault::Update, |fmu| fmu.set_fault(Fault::Update)),
    (CoSimulation, "fmi2SetInteger", Fault::None, |fmu| {
        while_all_break(Fault::Clone, || fmu.set_fault(Fault::None))
    }),
    (CoSimulation, "fmi2SetInteger", Fault::Drop, |fmu| fmu.set_fault(Fault::None)),
    (CoSimulation, "fmi2SetBoolean", Fault::Then, |fmu| fmu.fmi2SetBoolean(&TRUTH, 1, &1)),
    (CoSimulation, "fmi2SetString", Fault::Then, |fmu| fmu.fmi2SetString(&TEXT, 1, &c"a".as_ptr())),
    (CoSimulation, "fmi2SetInteger", Fault::Log, |fmu| fmu.set_fault(Fault::Log)),
    (CoSimulation, "fmi2DoStep", Fault::Step, |fmu| fmu.try_step(0.0, 0.1)),
    (CoSimulation, "fmi2SetRealInputDerivatives", Fault::InputDerivative, |fmu| {
        fmu.fmi2SetRealInputDerivatives(&U, 1, &1, &1.0)
    }),
    (CoSimulation, "fmi2GetRealOutputDerivatives", Fault::OutputDerivative, |fmu| {
        fmu.fmi2GetRealOutputDerivatives(&Y, 1, &1, &mut 0.0)
    }),
    (CoSimulation, "fmi2GetDirectionalDerivative", Fault::Partial, |fmu| {
        fmu.fmi2GetDirectionalDerivative(&Y, 1, &U, 1, &1.0, &mut 0.0)
    }),
    (ModelExchange, "fmi2NewDiscreteStates", Fault::Event, |fmu| {
        fmu.ok(fmu.fmi2EnterEventMode());
        fmu.fmi2NewDiscreteStates(&mut Default::default())
    }),
    (ModelExchange, "fmi2CompletedIntegratorStep", Fault::StepCompleted, |fmu| {
        fmu.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)
    }),
    (ModelExchange, "fmi2GetEventIndicators", Fault::Indicators, |fmu| {
        fmu.fmi2GetEventIndicators(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi2GetNominalsOfContinuousStates", Fault::Nominals, |fmu| {
        fmu.fmi2GetNominalsOfContinuousStates(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi2GetDerivatives", Fault::Read, |fmu| fmu.fmi2GetDerivatives(&mut 0.0, 1)),
    (ModelExchange, "fmi2GetContinuousStates", Fault::Calculate, |fmu| {
        fmu.fmi2GetContinuousStates(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi2SetContinuousStates", Fault::Then, |fmu| fmu.fmi2SetContinuousStates(&0.0, 1)),
    (ModelExchange, "fmi2SetReal", Fault::Then, |fmu| fmu.try_set(&[X], &[1.0])),
    (CoSimulation, "fmi2GetFMUstate", Fault::None, |fmu| {
        let mut state = null_mut();
        let status = while_all_break(Fault::Clone, || fmu.fmi2GetFMUstate(&mut state));
        assert!(state.is_null());
        status
    }),
    (CoSimulation, "fmi2GetFMUstate", Fault::None, |fmu| {
        with_state(fmu, |state| while_all_break(Fault::Clone, || fmu.fmi2GetFMUstate(state)))
    }),
    (CoSimulation, "fmi2SetFMUstate", Fault::None, |fmu| {
        with_state(fmu, |state| while_all_break(Fault::Clone, || fmu.fmi2SetFMUstate(*state)))
    }),
    (CoSimulation, "fmi2FreeFMUstate", Fault::Drop, |fmu| {
        with_state(fmu, |state| {
            let status = fmu.fmi2FreeFMUstate(state);
            assert!(state.is_null());
            status
        })
    }),
    (CoSimulation, "fmi2SerializedFMUstateSize", Fault::Memory, |fmu| {
        with_state(fmu, |state| fmu.fmi2SerializedFMUstateSize(*state, &mut 0))
    }),
    (CoSimulation, "fmi2SerializeFMUstate", Fault::Memory, |fmu| {
        with_state(fmu, |state| fmu.fmi2SerializeFMUstate(*state, [0; 100].as_mut_ptr(), 100))
    }),
    (CoSimulation, "fmi2DeSerializeFMUstate", Fault::Memory, |fmu| {
        let bytes = Importer::of::<Faulty>(CoSimulation).bytes();
        let mut state = null_mut();
        let status = fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state);
        assert!(state.is_null());
        status
    }),
];
