//! The board layer of the two QEMU machines: [`Uart`], [`InstructionCounter`], [`Stack`], and the way out.
//!
//! This is the only place of the project that touches registers and memory by address, and so the only one with
//! `unsafe`; each use says why it is sound.

mod counter;
mod stack;
mod uart;

pub use counter::InstructionCounter;
pub use stack::Stack;
pub use uart::Uart;

/// Exit code of a panic.
pub const EXIT_PANIC: i32 = 101;
/// Exit code of a fault.
pub const EXIT_FAULT: i32 = 102;

/// Clock of both machines, of the core and of SysTick `[Hz]`.
pub const CLOCK_HZ: u32 = 25_000_000;

/// The peripherals of the board.
pub struct Board {
    /// Counts instructions from [`Board::take`] on.
    pub counter: InstructionCounter,
    /// The binary stream in and out.
    pub uart: Uart,
    /// The painted stack.
    pub stack: Stack,
}

impl Board {
    /// The board, ready to use; `None` when it was taken before.
    pub fn take() -> Option<Self> {
        let core = cortex_m::Peripherals::take()?;
        Some(Self { counter: InstructionCounter::start(core.SYST), uart: Uart::uart0(), stack: Stack::new() })
    }
}

/// Name of the core this runs on, by its CPUID register.
pub fn core_name() -> &'static str {
    // SAFETY: CPUID is read-only and reading it has no effect.
    let cpuid = unsafe { (*cortex_m::peripheral::CPUID::PTR).base.read() };
    match (cpuid >> 4) & 0xfff {
        0xc24 => "Cortex-M4",
        0xc27 => "Cortex-M7",
        _ => "unknown core",
    }
}

/// Ends the simulation with an exit code.
pub fn exit(code: i32) -> ! {
    semihosting::process::exit(code)
}
