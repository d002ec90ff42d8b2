//! The functions of FMI 3.0.

use crate::toys::Faulty;
use crate::toys::faulty::{Fault, Name, while_all_break};
use crate::{Case, Standard, X, with_state};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::fmi3::{indicator, reference};
use fmu_test_kit::fmi3::Importer;
use std::ptr::{null, null_mut};

const U: u32 = reference(crate::U);
const Y: u32 = reference(crate::Y);
const TRUTH: u32 = reference(crate::TRUTH);
const TEXT: u32 = reference(crate::TEXT);

/// The same in FMI 3.0: a call that breaks an instance with this fault: every function that runs a model's code.
pub const CALLS: &[Case<Importer>] = &[
    (CoSimulation, "fmi3GetFloat64", Fault::Read, |fmu| fmu.fmi3GetFloat64(&Y, 1, &mut 0.0, 1)),
    (CoSimulation, "fmi3GetFloat64", Fault::NoMessage, |fmu| fmu.fmi3GetFloat64(&Y, 1, &mut 0.0, 1)),
    (CoSimulation, "fmi3GetFloat64", Fault::Bomb, |fmu| fmu.fmi3GetFloat64(&Y, 1, &mut 0.0, 1)),
    (CoSimulation, "fmi3GetFloat64", Fault::Calculate, |fmu| fmu.fmi3GetFloat64(&Y, 1, &mut 0.0, 1)),
    (CoSimulation, "fmi3GetInt32", Fault::Read, |fmu| {
        fmu.fmi3GetInt32(&reference(Name::n as u32), 1, &mut 0, 1)
    }),
    (CoSimulation, "fmi3GetBoolean", Fault::Read, |fmu| fmu.fmi3GetBoolean(&TRUTH, 1, &mut 0, 1)),
    (CoSimulation, "fmi3GetString", Fault::ReadText, |fmu| fmu.fmi3GetString(&TEXT, 1, &mut null(), 1)),
    (CoSimulation, "fmi3SetFloat64", Fault::Then, |fmu| fmu.try_set(&[crate::U], &[1.0])),
    (CoSimulation, "fmi3SetInt32", Fault::Update, |fmu| fmu.set_fault(Fault::Update)),
    (CoSimulation, "fmi3SetInt32", Fault::None, |fmu| {
        while_all_break(Fault::Clone, || fmu.set_fault(Fault::None))
    }),
    (CoSimulation, "fmi3SetInt32", Fault::Drop, |fmu| fmu.set_fault(Fault::None)),
    (CoSimulation, "fmi3SetBoolean", Fault::Then, |fmu| fmu.fmi3SetBoolean(&TRUTH, 1, &1, 1)),
    (CoSimulation, "fmi3SetString", Fault::Then, |fmu| fmu.fmi3SetString(&TEXT, 1, &c"a".as_ptr(), 1)),
    (CoSimulation, "fmi3SetInt32", Fault::Log, |fmu| fmu.set_fault(Fault::Log)),
    (CoSimulation, "fmi3DoStep", Fault::Step, |fmu| fmu.try_step(0.0, 0.1).expect_err("a step")),
    (CoSimulation, "fmi3GetOutputDerivatives", Fault::OutputDerivative, |fmu| {
        fmu.fmi3GetOutputDerivatives(&Y, 1, &1, &mut 0.0, 1)
    }),
    (CoSimulation, "fmi3GetDirectionalDerivative", Fault::Partial, |fmu| {
        fmu.fmi3GetDirectionalDerivative(&Y, 1, &U, 1, &1.0, 1, &mut 0.0, 1)
    }),
    (CoSimulation, "fmi3GetAdjointDerivative", Fault::Partial, |fmu| {
        fmu.fmi3GetAdjointDerivative(&Y, 1, &U, 1, &1.0, 1, &mut 0.0, 1)
    }),
    // A variable stands for the indicator.
    (ModelExchange, "fmi3GetFloat64", Fault::Indicators, |fmu| {
        fmu.fmi3GetFloat64(&reference(indicator::<Faulty>(0)), 1, &mut 0.0, 1)
    }),
    (ModelExchange, "fmi3UpdateDiscreteStates", Fault::Event, |fmu| {
        fmu.ok(fmu.fmi3EnterEventMode());
        let (mut flags, mut next) = ([0; 5], 0.0);
        let [again, terminate, nominals, states, defined] = &mut flags;
        fmu.fmi3UpdateDiscreteStates(again, terminate, nominals, states, defined, &mut next)
    }),
    (ModelExchange, "fmi3CompletedIntegratorStep", Fault::StepCompleted, |fmu| {
        fmu.fmi3CompletedIntegratorStep(1, &mut 0, &mut 0)
    }),
    (ModelExchange, "fmi3GetEventIndicators", Fault::Indicators, |fmu| {
        fmu.fmi3GetEventIndicators(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi3GetNominalsOfContinuousStates", Fault::Nominals, |fmu| {
        fmu.fmi3GetNominalsOfContinuousStates(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi3GetContinuousStateDerivatives", Fault::Read, |fmu| {
        fmu.fmi3GetContinuousStateDerivatives(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi3GetContinuousStates", Fault::Calculate, |fmu| {
        fmu.fmi3GetContinuousStates(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi3SetContinuousStates", Fault::Then, |fmu| fmu.fmi3SetContinuousStates(&0.0, 1)),
    (ModelExchange, "fmi3SetFloat64", Fault::Then, |fmu| fmu.try_set(&[X], &[1.0])),
    (CoSimulation, "fmi3GetFMUState", Fault::None, |fmu| {
        let mut state = null_mut();
        let status = while_all_break(Fault::Clone, || fmu.fmi3GetFMUState(&mut state));
        assert!(state.is_null());
        status
    }),
    (CoSimulation, "fmi3GetFMUState", Fault::None, |fmu| {
        with_state(fmu, |state| while_all_break(Fault::Clone, || fmu.fmi3GetFMUState(state)))
    }),
    (CoSimulation, "fmi3SetFMUState", Fault::None, |fmu| {
        with_state(fmu, |state| while_all_break(Fault::Clone, || fmu.fmi3SetFMUState(*state)))
    }),
    (CoSimulation, "fmi3FreeFMUState", Fault::Drop, |fmu| {
        with_state(fmu, |state| {
            let status = fmu.fmi3FreeFMUState(state);
            assert!(state.is_null());
            status
        })
    }),
    (CoSimulation, "fmi3SerializedFMUStateSize", Fault::Memory, |fmu| {
        with_state(fmu, |state| fmu.fmi3SerializedFMUStateSize(*state, &mut 0))
    }),
    (CoSimulation, "fmi3SerializeFMUState", Fault::Memory, |fmu| {
        with_state(fmu, |state| fmu.fmi3SerializeFMUState(*state, [0; 100].as_mut_ptr(), 100))
    }),
    (CoSimulation, "fmi3DeserializeFMUState", Fault::Memory, |fmu| {
        let bytes = Importer::of::<Faulty>(CoSimulation).bytes();
        let mut state = null_mut();
        let status = fmu.fmi3DeserializeFMUState(bytes.as_ptr(), bytes.len(), &mut state);
        assert!(state.is_null());
        status
    }),
];
