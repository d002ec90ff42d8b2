//! Missing memory, which must be an error of a call.
#![cfg(target_os = "linux")]
#![allow(missing_docs)]

use fmu_export::*;
use fmu_test_kit::{Either, Importer, fmi3};
use std::process::Command;
use std::ptr::null_mut;

variables! {
    /// A model whose state is large, without further memory on the heap.
    pub struct Large {
        values: [f64; 8192] = [0.0; 8192],
    }, memory in values;

    /// An input
    u: f64 = input(&NUMBER).start(0.5);
}

impl Model for Large {
    const INFO: Info = info!("Large", "large");
}

impl CoSimulation for Large {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        self.values[0] = step.time;
        Ok(Stepped::Done)
    }
}

offer!(Large: CoSimulation);

const IN_CHILD: &str = "FMU_EXPORT_MEMORY";

/// Saves states and creates instances until the memory is used up, then frees a state and saves another one.
fn use_up<F: Either>() {
    let fmu = F::initialized_at::<Large>(0.0);
    // The first message allocates memory that later messages use again.
    fmu.rejected("a wrong reference", |fmu| fmu.try_set(&[99], &[0.0]));
    let mut states = Vec::with_capacity(1 << 16);
    let message = loop {
        let mut state = null_mut();
        if fmu.get_state(&mut state) != Status::Ok {
            assert!(state.is_null());
            break fmu.take_log().pop().unwrap().message;
        }
        states.push(state);
    };
    assert!(message.ends_with(": there is not enough memory"), "{message}");
    assert!(states.len() > 100);
    let failed = F::make::<Large>(&fmu_test_kit::Arguments::new::<Large>(Interface::CoSimulation));
    let messages = failed.err().expect("an instance is as large as a state");
    assert!(messages[0].message.ends_with(": there is not enough memory"), "{messages:?}");
    for mut state in states.drain(..).take(4) {
        fmu.ok(fmu.free_state(&mut state));
    }
    let mut state = null_mut();
    fmu.ok(fmu.get_state(&mut state));
    fmu.ok(fmu.set_state(state));
    fmu.ok(fmu.try_step(0.0, 1.0));
}

#[test]
fn missing_memory_is_an_error() {
    if std::env::var_os(IN_CHILD).is_some() {
        use_up::<Importer>();
        return use_up::<fmi3::Importer>();
    }
    let program = std::env::current_exe().unwrap();
    let command = format!("ulimit -v 400000; exec {} missing_memory_is_an_error", program.display());
    let output = Command::new("sh").args(["-c", &command]).env(IN_CHILD, "").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}
