//! The same inputs and the same steps give the same bits in both standards.

use crate::toys::*;
use fmu_export::{Causality, Exported, Interface::*};
use fmu_test_kit::fmi3;
use fmu_test_kit::{Importer, serialized};

/// All but the byte with standard and interface type, the mode, and the checksum.
fn content(bytes: &[u8]) -> &[u8] {
    &bytes[serialized::ENDED..bytes.len() - serialized::CHECKSUM]
}

fn steps<M: Exported>() {
    let (old, new) = (Importer::of::<M>(CoSimulation), fmi3::Importer::of::<M>(CoSimulation));
    old.initialize(0.5);
    new.initialize(0.5);
    let inputs: Vec<u32> = (0..)
        .zip(M::TABLE)
        .filter(|(_, of)| of.causality() == Causality::Input && of.base() == fmu_export::BaseType::Real)
        .map(|(place, _)| place)
        .collect();
    let mut time = 0.5;
    for step in 0..20 {
        let values: Vec<f64> =
            inputs.iter().map(|place| 0.1 * (f64::from(step + *place as i32)).sin()).collect();
        old.set(&inputs, &values);
        new.set(&inputs, &values);
        let size = 0.01 * f64::from(1 + step % 3);
        old.step(time, size);
        new.step(time, size);
        time += size;
        assert_eq!(content(&old.bytes()), content(&new.bytes()));
    }
}

#[test]
fn in_co_simulation() {
    steps::<Oscillator>();
    steps::<Counter>();
    steps::<Talker>();
    steps::<Sum>();
    steps::<Ticker>();
    steps::<Palette>();
}

#[test]
fn in_model_exchange() {
    let (old, new) =
        (Importer::of::<Oscillator>(ModelExchange), fmi3::Importer::of::<Oscillator>(ModelExchange));
    old.initialize(0.0);
    new.initialize(0.0);
    old.ok(old.fmi2EnterContinuousTimeMode());
    new.ok(new.fmi3EnterContinuousTimeMode());
    let (mut a, mut b) = ([0.1, 0.0], [0.1, 0.0]);
    for step in 0..50 {
        let time = 0.01 * f64::from(step);
        let (mut da, mut db) = ([f64::NAN; 2], [f64::NAN; 2]);
        old.ok(old.fmi2SetTime(time));
        new.ok(new.fmi3SetTime(time));
        old.ok(old.fmi2SetContinuousStates(a.as_ptr(), 2));
        new.ok(new.fmi3SetContinuousStates(b.as_ptr(), 2));
        old.ok(old.fmi2GetDerivatives(da.as_mut_ptr(), 2));
        new.ok(new.fmi3GetContinuousStateDerivatives(db.as_mut_ptr(), 2));
        for place in 0..2 {
            a[place] += 0.01 * da[place];
            b[place] += 0.01 * db[place];
        }
        assert_eq!(a.map(f64::to_bits), b.map(f64::to_bits));
    }
    assert_eq!(content(&old.bytes()), content(&new.bytes()));
}
