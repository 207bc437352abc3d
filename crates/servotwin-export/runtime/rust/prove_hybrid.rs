//! Entry points for the hybrid twin in `servotwin prove`, those of `prove_hybrid.c`. Not part of an export.
//!
//! # Safety
//! Callers pass lists as long as those of the exported diagnoser.

use crate::guarded;
use servotwin_flight::hybrid::Hybrid;
use servotwin_flight::sizes::{INPUTS, SENSORS};

#[unsafe(no_mangle)]
pub extern "C" fn prove_hybrid_size() -> u64 {
    size_of::<Hybrid>() as u64
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_hybrid_start(hybrid: *mut Hybrid) -> i32 {
    unsafe { hybrid.write(Hybrid::new()) };
    i32::from(servotwin_flight::rounds_twice())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn prove_hybrid_push(
    hybrid: *mut Hybrid,
    inputs: *const [f64; INPUTS],
    measured: *const [f64; SENSORS],
    integers: *mut [i64; 3],
    confidence: *mut f64,
) -> *const f64 {
    let hybrid = unsafe { &mut *hybrid };
    let outcome = guarded(None, || hybrid.push(unsafe { &*inputs }, unsafe { &*measured }).copied());
    let Some(outcome) = outcome else { return std::ptr::null() };
    let [finding, ..] = crate::finding(outcome.finding);
    unsafe {
        *integers = [finding, crate::alarm(outcome.alarm), outcome.since_sample as i64];
        *confidence = outcome.confidence;
    }
    hybrid.expected().as_ptr()
}
