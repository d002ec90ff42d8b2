//! Equal inputs and steps give bit-identical results in both FMI versions.

use crate::models::*;
use fmu_export::{Causality, Exported, Interface::*, Mode::ContinuousTime};
use fmu_test_kit::checks::places;
use fmu_test_kit::{Either, Importer, fmi3, serialized};

/// Returns the state without the byte for FMI version and interface type, the mode, and the checksum.
fn content(fmu: &dyn Either) -> Vec<u8> {
    let bytes = fmu.bytes();
    bytes[serialized::ENDED..bytes.len() - serialized::CHECKSUM].to_vec()
}

fn steps<F: Either, M: Exported>() -> Vec<Vec<u8>> {
    let fmu = F::initialized_at::<M>(0.5);
    let inputs =
        places::<M>(|of| of.causality() == Causality::Input && of.base() == fmu_export::BaseType::Real);
    let mut time = 0.5;
    let step = |step: i32| {
        let value = |place: &u32| 0.1 * (f64::from(step + *place as i32)).sin();
        fmu.set(&inputs, &inputs.iter().map(value).collect::<Vec<_>>());
        let size = 0.01 * f64::from(1 + step % 3);
        fmu.step(time, size);
        time += size;
        content(&fmu)
    };
    (0..20).map(step).collect()
}

#[test]
fn in_co_simulation() {
    fn same<M: Exported>() {
        assert_eq!(steps::<Importer, M>(), steps::<fmi3::Importer, M>());
    }
    same::<Oscillator>();
    same::<Counter>();
    same::<Talker>();
    same::<Sum>();
    same::<Ticker>();
    same::<Palette>();
}

#[test]
fn in_model_exchange() {
    fn run<F: Either>() -> Vec<u8> {
        let fmu = F::in_mode::<Oscillator>(ModelExchange, ContinuousTime);
        let mut x = [0.1, 0.0];
        for step in 0..50 {
            fmu.ok(fmu.set_time(0.01 * f64::from(step)));
            fmu.ok(fmu.set_states(x.as_ptr(), 2));
            let rates = fmu.derivatives::<2>();
            x = [0, 1].map(|place| x[place] + 0.01 * rates[place]);
        }
        content(&fmu)
    }
    assert_eq!(run::<Importer>(), run::<fmi3::Importer>());
}
