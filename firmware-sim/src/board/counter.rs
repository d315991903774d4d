//! Counts instructions by SysTick.
//!
//! QEMU has no cycle counter. Run with `-icount shift=0`, one instruction takes 1 ns of virtual time, and SysTick at
//! 25 MHz ticks once in 40 instructions. Instructions are not cycles: pipelines, caches and flash wait states are not
//! simulated.

use super::CLOCK_HZ;
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_rt::exception;

/// Ticks between two wraps of the 24-bit counter.
const PERIOD: u32 = 1 << 24;

/// Instructions in a tick.
const INSTRUCTIONS_PER_TICK: u64 = 1_000_000_000 / CLOCK_HZ as u64;

static WRAPS: AtomicU32 = AtomicU32::new(0);

/// Counts the instructions executed since it was started, in steps of 40.
pub struct InstructionCounter {
    systick: SYST,
}

impl InstructionCounter {
    /// Starts to count from zero.
    pub fn start(mut systick: SYST) -> Self {
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(PERIOD - 1);
        systick.clear_current();
        systick.enable_interrupt();
        systick.enable_counter();
        Self { systick }
    }

    /// Instructions executed since the start. It wraps after 2^56 ticks.
    pub fn now(&self) -> u64 {
        loop {
            let wraps = WRAPS.load(Ordering::Relaxed);
            let down = self.systick.cvr.read();
            if wraps == WRAPS.load(Ordering::Relaxed) {
                let ticks = u64::from(wraps) * u64::from(PERIOD) + u64::from((PERIOD - down) % PERIOD);
                return ticks * INSTRUCTIONS_PER_TICK;
            }
        }
    }

    /// Runs `work` and returns its result with the instructions it took.
    pub fn measure<T>(&self, work: impl FnOnce() -> T) -> (T, u64) {
        let start = self.now();
        let result = work();
        (result, self.now().wrapping_sub(start))
    }
}

#[exception]
fn SysTick() {
    WRAPS.fetch_add(1, Ordering::Relaxed);
}
