//! How much of the stack was ever used.
//!
//! The start-up code of `cortex-m-rt` (feature `paint-stack`) fills the stack with a pattern before anything runs; what
//! no longer holds the pattern has been used.

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static mut _stack_start: u32;
    static mut _stack_end: u32;
}

/// The painted stack.
pub struct Stack {
    top: *const u32,
    bottom: *const u32,
}

impl Stack {
    /// The stack that the memory map names.
    pub(super) fn new() -> Self {
        Self { top: &raw const _stack_start, bottom: &raw const _stack_end }
    }

    /// Room of the stack `[bytes]`.
    pub fn size(&self) -> usize {
        self.top as usize - self.bottom as usize
    }

    /// Deepest use of the stack since the start `[bytes]`.
    pub fn peak(&self) -> usize {
        let mut lowest_used = self.bottom;
        // SAFETY: the pointer stays in the stack region, which is RAM, aligned to words by the linker script. The words
        // read belong to frames that are live or gone; volatile reads of them do not disturb either.
        while lowest_used < self.top && unsafe { lowest_used.read_volatile() } == STACK_PAINT_VALUE {
            lowest_used = lowest_used.wrapping_add(1);
        }
        self.top as usize - lowest_used as usize
    }
}
