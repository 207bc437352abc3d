//! Fingerprints of data: FNV-1a with 64 bits (Fowler, Noll, Vo) over canonical bytes. It does not resist forgery.
//!
//! Numbers enter by their bits, texts and lists with their lengths. So the fingerprint depends on values alone, and not
//! on how anything is printed or named.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

/// The fingerprint of the values added so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(u64);

/// A value with canonical bytes.
pub trait Canonical {
    /// Adds the value.
    fn add_to(&self, fingerprint: &mut Fingerprint);
}

impl Default for Fingerprint {
    fn default() -> Self {
        Fingerprint(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    /// Adds a value.
    pub fn add(&mut self, value: &(impl Canonical + ?Sized)) -> &mut Self {
        value.add_to(self);
        self
    }

    /// The fingerprint.
    pub fn value(&self) -> u64 {
        self.0
    }

    fn add_bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

impl fmt::Display for Fingerprint {
    /// Sixteen hexadecimal digits.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:016x}", self.0)
    }
}

impl Canonical for u64 {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add_bytes(&self.to_le_bytes());
    }
}

impl Canonical for usize {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&(*self as u64));
    }
}

impl Canonical for bool {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add_bytes(&[u8::from(*self)]);
    }
}

impl Canonical for f64 {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.to_bits());
    }
}

impl Canonical for str {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.len()).add_bytes(self.as_bytes());
    }
}

impl Canonical for String {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(self.as_str());
    }
}

impl<T: Canonical + ?Sized> Canonical for &T {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(*self);
    }
}

impl<T: Canonical> Canonical for Option<T> {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.is_some());
        if let Some(value) = self {
            fingerprint.add(value);
        }
    }
}

impl<T: Canonical> Canonical for [T] {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.len());
        self.iter().for_each(|value| value.add_to(fingerprint));
    }
}

impl<T: Canonical, const N: usize> Canonical for [T; N] {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        self.iter().for_each(|value| value.add_to(fingerprint));
    }
}

impl<T: Canonical> Canonical for Vec<T> {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(self.as_slice());
    }
}

impl<A: Canonical, B: Canonical> Canonical for (A, B) {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.0).add(&self.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(value: impl Canonical) -> u64 {
        Fingerprint::default().add(&value).value()
    }

    #[test]
    fn values_that_differ_have_different_fingerprints() {
        assert_ne!(of(("a", "bc")), of(("ab", "c")));
        assert_ne!(of([[1_u64].as_slice(), &[2]]), of([[1_u64, 2].as_slice(), &[]]));
        assert_ne!(of(0.0), of(-0.0));
        assert_ne!(of(None::<u64>), of(Some(0_u64)));
        assert_eq!(of(String::from("a")), of("a"));
    }
}
