//! The floating-point environment (rounding mode and exception mask), which some FMUs change for the whole thread.

/// Calls `body`, then restores the environment. Otherwise the caller's results might be rounded differently, or a
/// division by zero might end the process.
#[cfg(target_arch = "x86_64")]
pub(crate) fn keeping_environment<T>(body: impl FnOnce() -> T) -> T {
    use std::arch::asm;
    let (mut sse, mut x87) = (0_u32, 0_u16);
    // SAFETY: stores the control registers in two variables.
    unsafe {
        asm!("stmxcsr [{}]", "fnstcw [{}]", in(reg) &raw mut sse, in(reg) &raw mut x87, options(nostack, preserves_flags));
    }
    let result = body();
    // SAFETY: the registers had these values before; `fnclex` clears pending exceptions, which they could raise
    // otherwise.
    unsafe {
        asm!("fnclex", "ldmxcsr [{}]", "fldcw [{}]", in(reg) &raw const sse, in(reg) &raw const x87, options(nostack, preserves_flags));
    }
    result
}

/// Calls `body`, then restores the environment, for the same reason as on x86-64.
#[cfg(target_arch = "aarch64")]
pub(crate) fn keeping_environment<T>(body: impl FnOnce() -> T) -> T {
    use std::arch::asm;
    let control: u64;
    // SAFETY: reads the control register.
    unsafe { asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack, preserves_flags)) };
    let result = body();
    // SAFETY: the register had this value before.
    unsafe { asm!("msr fpcr, {}", in(reg) control, options(nomem, nostack, preserves_flags)) };
    result
}

/// Calls `body`. On other processors the environment is not restored.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub(crate) fn keeping_environment<T>(body: impl FnOnce() -> T) -> T {
    body()
}
