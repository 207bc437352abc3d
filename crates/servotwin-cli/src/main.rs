//! The command line of servotwin.
fn main() {}
