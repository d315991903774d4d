//! The `surefix` command: see `surefix --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    surefix::cli::main()
}
