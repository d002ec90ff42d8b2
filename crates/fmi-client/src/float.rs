//! The floating-point environment: rounding and exceptions, which some FMUs change for the whole thread.

/// Calls `body`, then restores the environment, because results of the caller would otherwise be rounded differently, and a
/// division by zero could end the process.
#[cfg(target_arch = "x86_64")]
pub(crate) fn keeping_environment<T>(body: impl FnOnce() -> T) -> T {
    use std::arch::asm;
    let (mut of_sse, mut of_x87) = (0_u32, 0_u16);
    // SAFETY: stores the control registers in two variables.
    unsafe {
        asm!("stmxcsr [{}]", "fnstcw [{}]", in(reg) &raw mut of_sse, in(reg) &raw mut of_x87, options(nostack, preserves_flags));
    }
    let result = body();
    // SAFETY: values that the registers had; no exceptions are pending that they would raise.
    unsafe {
        asm!("fnclex", "ldmxcsr [{}]", "fldcw [{}]", in(reg) &raw const of_sse, in(reg) &raw const of_x87, options(nostack, preserves_flags));
    }
    result
}

/// Calls `body`, then sets the environment to what it was before.
#[cfg(target_arch = "aarch64")]
pub(crate) fn keeping_environment<T>(body: impl FnOnce() -> T) -> T {
    use std::arch::asm;
    let control: u64;
    // SAFETY: reads the control register.
    unsafe { asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack, preserves_flags)) };
    let result = body();
    // SAFETY: a value that the register had.
    unsafe { asm!("msr fpcr, {}", in(reg) control, options(nomem, nostack, preserves_flags)) };
    result
}

/// Calls `body`.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub(crate) fn keeping_environment<T>(body: impl FnOnce() -> T) -> T {
    body()
}
