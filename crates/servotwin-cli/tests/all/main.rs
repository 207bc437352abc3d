//! The binary is run as its users run it.
