//! A hash that distinguishes texts: FNV-1a with 64 bits (Fowler, Noll, Vo). It does not resist forgery.

use core::fmt::{self, Write};

/// The hash of the texts added so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextHash(u64);

impl Default for TextHash {
    fn default() -> Self {
        TextHash(0xcbf2_9ce4_8422_2325)
    }
}

impl TextHash {
    /// Adds a text.
    pub fn add(&mut self, text: fmt::Arguments) {
        // The hash accepts every text.
        let _ = self.write_fmt(text);
    }

    /// The hash.
    pub fn value(&self) -> u64 {
        self.0
    }
}

impl fmt::Display for TextHash {
    /// Sixteen hexadecimal digits.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:016x}", self.0)
    }
}

impl Write for TextHash {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for &byte in text.as_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        Ok(())
    }
}
