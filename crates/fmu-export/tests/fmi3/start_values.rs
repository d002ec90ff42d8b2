//! Start values that are refused are not forgotten: some importers go on after a refusal.

use crate::toys::{Oscillator, Talker, oscillator, talker};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::fmi3::{reference, types::Status};
use fmu_test_kit::fmi3::Importer;

fn enter(fmu: &Importer) -> Status {
    fmu.fmi3EnterInitializationMode(0, 0.0, 0.0, 0, 0.0)
}

#[test]
fn a_refused_start_value_is_remembered() {
    const MASS: u32 = oscillator::Name::mass as u32;
    for interface in [CoSimulation, ModelExchange] {
        let fmu = Importer::of::<Oscillator>(interface);
        let wrong = |value: f64| fmu.try_set(&[MASS], &[value]);
        let first = fmu.refused("a start value", |_| wrong(-1.0));
        let again = fmu.refused("the initialization", enter);
        assert_eq!(again.split_once(": ").unwrap().1, first.split_once(": ").unwrap().1);
        fmu.ok(wrong(2.0));
        fmu.ok(enter(&fmu));
        fmu.refused("a start value", |_| wrong(f64::INFINITY));
        fmu.refused("the end of the initialization", |fmu| fmu.fmi3ExitInitializationMode());
        let truth = |value: u8| fmu.fmi3SetBoolean(&reference(oscillator::Name::damped as u32), 1, &value, 1);
        fmu.ok(wrong(2.0));
        fmu.refused("a start value", |_| truth(2));
        fmu.refused("the end of the initialization", |fmu| fmu.fmi3ExitInitializationMode());
        fmu.ok(truth(0));
        fmu.ok(fmu.fmi3ExitInitializationMode());
    }
}

#[test]
fn an_enumeration() {
    let fmu = Importer::of::<Talker>(CoSimulation);
    let mood = |value: i64| fmu.fmi3SetInt64(&reference(talker::Name::mood as u32), 1, &value, 1);
    fmu.refused("no item of the enumeration", |_| mood(3));
    fmu.refused("the initialization", enter);
    fmu.ok(fmu.fmi3Reset());
    fmu.ok(enter(&fmu));
}
