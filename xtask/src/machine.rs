//! The simulated machines.

use clap::ValueEnum;

/// A QEMU machine and the core on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Machine {
    /// Cortex-M4F: `f64` in software
    An386,
    /// Cortex-M7: `f64` in hardware
    An500,
}

impl Machine {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::An386, Self::An500];

    /// The one asked for, or all.
    pub fn selected(machine: Option<Self>) -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(move |each| machine.is_none_or(|wanted| wanted == *each))
    }

    /// Name as in `--machine`.
    pub fn name(self) -> &'static str {
        match self {
            Self::An386 => "an386",
            Self::An500 => "an500",
        }
    }

    /// Name of the machine in QEMU.
    pub fn qemu_name(self) -> &'static str {
        match self {
            Self::An386 => "mps2-an386",
            Self::An500 => "mps2-an500",
        }
    }

    /// The core, as the firmware calls it.
    pub fn core(self) -> &'static str {
        match self {
            Self::An386 => "Cortex-M4",
            Self::An500 => "Cortex-M7",
        }
    }

    /// The core, as the compiler calls it.
    pub fn target_cpu(self) -> &'static str {
        match self {
            Self::An386 => "cortex-m4",
            Self::An500 => "cortex-m7",
        }
    }
}
