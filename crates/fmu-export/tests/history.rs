//! Random histories of the test models, and of the models of `cargo fmu new`.
#![allow(missing_docs)]

use fmu_test_kit::models;

#[path = "../../fmu-package/models/house/src/house.rs"]
mod house;
#[path = "../../fmu-package/models/lag/src/lib.rs"]
mod lag;

use fmu_test_kit::history::Histories;
use models::*;
use std::ffi::CString;

fmu_export::offer!(house::House: CoSimulation + ModelExchange);

macro_rules! histories {
    ($($test:ident $model:ty;)+) => {
        $(#[test] fn $test() {
            Histories::default().check::<$model>();
        })+
    };
}

histories! {
    ball Ball;
    clumsy Clumsy;
    clumsy_on_heap ClumsyOnHeap;
    counter Counter;
    fuse Fuse;
    lag lag::Lag;
    lazy Lazy;
    motor Motor;
    oscillator Oscillator;
    palette Palette;
    rod Rod;
    talker Talker;
}

/// Checks histories without copies, because a variable of the meter counts the steps that `step_fast` made.
#[test]
fn meter() {
    Histories { with_copies: false, ..Histories::default() }.check::<Meter>();
}

#[test]
fn house() {
    const RESOURCES: &str =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../fmu-package/models/house/modelDescription/resources");
    let location = CString::new(RESOURCES).unwrap();
    Histories { resource_location: Some(&location), ..Histories::default() }.check::<house::House>();
}

#[test]
fn steps_stay_cheap() {
    fmu_test_kit::costs::steps_stay_cheap::<lag::Lag>();
    fmu_test_kit::costs::steps_stay_cheap::<ClumsyOnHeap>();
}
