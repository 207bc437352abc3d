//! Promises that every component keeps.
