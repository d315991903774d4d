//! The `surefix` command.

fn main() {}
