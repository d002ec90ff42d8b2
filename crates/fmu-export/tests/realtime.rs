//! Control loops with test models, which must not allocate, make system calls, or lock.
#![allow(missing_docs)]

use fmu_test_kit::models;

fmu_test_kit::control_loop!(models::Oscillator);

/// Checks arrays, which are set and read as a whole in FMI 3.0 and by their elements in FMI 2.0.
#[test]
fn arrays_are_set_and_read_without_allocation() {
    use fmu_export::Variables;
    use fmu_test_kit::Either;
    use models::{Rod, rod::Name};
    let [power, temperatures, rates] =
        [Name::power, Name::T, Name::der_T].map(|name| Rod::index(name) as u32);
    let whole = fmu_test_kit::fmi3::Importer::initialized_at::<Rod>(0.0);
    let elements = fmu_test_kit::Importer::initialized_at::<Rod>(0.0);
    let references = [temperatures, rates].map(fmu_export::fmi3::reference);
    let indices: [u32; 16] = std::array::from_fn(|k| k as u32 % 8 + if k < 8 { temperatures } else { rates });
    let (mut of_fmi3, mut of_fmi2) = ([f64::NAN; 16], [f64::NAN; 16]);
    let count = fmu_test_kit::realtime::allocations(|| {
        for k in 0..5 {
            let (time, powers) = (f64::from(k) * 0.25, [f64::from(k), 3.0]);
            let vr = fmu_export::fmi3::reference(power);
            whole.ok(whole.fmi3SetFloat64(&vr, 1, powers.as_ptr(), 2));
            whole.step(time, 0.25);
            whole.ok(whole.fmi3GetFloat64(references.as_ptr(), 2, of_fmi3.as_mut_ptr(), 16));
            elements.ok(elements.try_set(&[power, power + 1], &powers));
            elements.step(time, 0.25);
            elements.ok(elements.try_get(&indices, &mut of_fmi2));
        }
    });
    assert_eq!((count, of_fmi3), (0, of_fmi2));
}

/// Checks a model that is copied before each step, because the step may fail half-way. Its vector has its final length after
/// three steps, so the first four are not counted.
#[test]
fn steps_that_can_be_undone_do_not_allocate() {
    use fmu_test_kit::Either;
    fn check<F: Either>() {
        let fmu = F::initialized_at::<models::ClumsyOnHeap>(0.0);
        (0..4).for_each(|step| fmu.step(f64::from(step) * 0.125, 0.125));
        let count = fmu_test_kit::realtime::allocations(|| {
            (4..7).for_each(|step| fmu.step(f64::from(step) * 0.125, 0.125));
        });
        assert_eq!(count, 0);
    }
    check::<fmu_test_kit::Importer>();
    check::<fmu_test_kit::fmi3::Importer>();
}

#[cfg(rtsan)]
#[test]
#[ignore = "the RealtimeSanitizer must end this test; make sanitize checks it"]
fn allocation_is_caught() {
    let _context = fmu_test_kit::realtime::sanitizer::enter();
    drop(std::hint::black_box(Box::new(1)));
}
