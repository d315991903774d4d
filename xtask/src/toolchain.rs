//! Finding and installing what builds and runs Cortex-M programs.
//!
//! Two toolchains do. Stable Rust with its `thumbv7em-none-eabihf` target is the usual one. Where rustup can add no
//! target, Debian's `rustc-web` builds `core` from its own sources; its stable compiler allows that with
//! `RUSTC_BOOTSTRAP=1`, and `ld.lld` links.

use crate::command::{exists, output, run};
use crate::machine::Machine;
use anyhow::{Result, bail};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The target of both machines.
pub const TARGET: &str = "thumbv7em-none-eabihf";

const QEMU: &str = "qemu-system-arm";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_RUST: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "lld"];

/// A toolchain that builds for Cortex-M, with QEMU beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CortexM {
    /// The running toolchain, which has the target.
    Rustup,
    /// Debian's packages.
    Debian,
}

impl CortexM {
    /// What is installed; `None` if something is missing.
    pub fn find() -> Option<Self> {
        if exists(QEMU) { Self::find_compiler() } else { None }
    }

    /// What is installed, after installing what is missing and can be installed. The error says what to install.
    pub fn find_or_install() -> Result<Self> {
        if Self::find_compiler().is_none() {
            println!("no Rust compiler for {TARGET} found");
            // Offline, or with a toolchain not from rustup, this fails, and the next way is tried.
            if exists("rustup") && run(Command::new("rustup").args(["target", "add", TARGET])).is_err() {
                println!("rustup cannot add the target");
            }
        }
        if Self::find_compiler().is_none() {
            apt_install(&DEBIAN_RUST);
        }
        if !exists(QEMU) {
            apt_install(&[QEMU]);
        }
        if let Some(toolchain) = Self::find() {
            return Ok(toolchain);
        }
        let mut missing = Vec::new();
        if Self::find_compiler().is_none() {
            missing.push(format!(
                "a compiler for {TARGET}: `rustup target add {TARGET}`, or on Debian as root \
                 `apt-get install --no-install-recommends {}`",
                DEBIAN_RUST.join(" ")
            ));
        }
        if !exists(QEMU) {
            missing.push(format!("QEMU: the package that has {QEMU}, on Debian as root `apt-get install {QEMU}`"));
        }
        bail!("the Cortex-M part needs\n  {}", missing.join("\n  "))
    }

    fn find_compiler() -> Option<Self> {
        let has_target = sysroot("rustc").is_some_and(|root| root.join("lib/rustlib").join(TARGET).exists());
        if has_target {
            return Some(Self::Rustup);
        }
        let core_source = sysroot(DEBIAN_RUSTC)?.join("lib/rustlib/src/rust/library/core/Cargo.toml");
        let complete = core_source.exists() && Path::new(DEBIAN_CARGO).exists() && exists("ld.lld");
        complete.then_some(Self::Debian)
    }

    /// A `cargo` command, such as `build`, for one machine's core.
    pub fn cargo(self, subcommand: &str, machine: Machine) -> Command {
        let mut flags = vec![format!("-Ctarget-cpu={}", machine.target_cpu())];
        let mut command = match self {
            Self::Rustup => Command::new("cargo"),
            Self::Debian => Command::new(DEBIAN_CARGO),
        };
        command.args([subcommand, "--target", TARGET]);
        if self == Self::Debian {
            flags.extend(["-Clinker=ld.lld".to_owned(), "-Clinker-flavor=ld.lld".to_owned()]);
            command.args(["-Z", "build-std=core"]);
            // Without RUSTC, cargo finds the compiler that comes first in PATH.
            command.env("RUSTC", DEBIAN_RUSTC).env("RUSTC_BOOTSTRAP", "1");
        }
        // Takes precedence over RUSTFLAGS of the caller and of configuration files.
        command.env("CARGO_ENCODED_RUSTFLAGS", flags.join("\x1f"));
        command
    }
}

impl fmt::Display for CortexM {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rustup => write!(f, "{} with {TARGET}", version("rustc"))?,
            Self::Debian => write!(f, "Debian's {}, building core from source", version(DEBIAN_RUSTC))?,
        }
        write!(f, "; {}", version(QEMU))
    }
}

/// First line of what `--version` prints.
fn version(program: &str) -> String {
    let all = output(Command::new(program).arg("--version")).unwrap_or_default();
    all.lines().next().unwrap_or_default().to_owned()
}

fn sysroot(rustc: &str) -> Option<PathBuf> {
    output(Command::new(rustc).args(["--print", "sysroot"])).map(PathBuf::from)
}

/// Tries to install Debian packages; whether it worked is seen by looking for the programs.
fn apt_install(packages: &[&str]) {
    if !exists("apt-get") {
        return;
    }
    let is_root = output(Command::new("id").arg("-u")).is_some_and(|id| id == "0");
    let may_sudo = || output(Command::new("sudo").args(["-n", "true"])).is_some();
    let apt_get = || {
        let mut command = if is_root { Command::new("apt-get") } else { Command::new("sudo") };
        if !is_root {
            command.args(["-n", "apt-get"]);
        }
        command.env("DEBIAN_FRONTEND", "noninteractive");
        command
    };
    if !is_root && !may_sudo() {
        return;
    }
    let updated = run(apt_get().args(["update", "-qq"]));
    let installed = run(apt_get().args(["install", "-y", "-qq", "--no-install-recommends"]).args(packages));
    for error in [updated.err(), installed.err()].into_iter().flatten() {
        println!("{error:#}");
    }
}
