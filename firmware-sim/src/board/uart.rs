//! UART0 of the MPS2 boards: an Arm CMSDK APB UART, as an [`embedded_io`] stream.
//!
//! Source: *Cortex-M System Design Kit Technical Reference Manual* (ARM DDI 0479), section 4.3. It holds one byte each
//! way and has no FIFO; QEMU takes the next byte from its host side when the one before was read, so nothing is lost
//! however slow the reader is.

use core::convert::Infallible;
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};

const UART0: *mut u32 = 0x4000_4000 as *mut u32;

/// Register offsets in words.
mod register {
    pub const DATA: usize = 0;
    pub const STATE: usize = 1;
    pub const CTRL: usize = 2;
    pub const BAUDDIV: usize = 4;
}

const STATE_TX_FULL: u32 = 1 << 0;
const STATE_RX_FULL: u32 = 1 << 1;
const CTRL_TX_ENABLE: u32 = 1 << 0;
const CTRL_RX_ENABLE: u32 = 1 << 1;

/// Smallest divider that the peripheral accepts; QEMU does not simulate the bit rate.
const FASTEST: u32 = 16;

/// A polled UART. Reads and writes block.
pub struct Uart {
    base: *mut u32,
}

impl Uart {
    /// UART0, switched on. Only [`super::Board::take`] makes one.
    pub(super) fn uart0() -> Self {
        let mut uart = Self { base: UART0 };
        uart.write_register(register::BAUDDIV, FASTEST);
        uart.write_register(register::CTRL, CTRL_TX_ENABLE | CTRL_RX_ENABLE);
        uart
    }

    fn read_register(&self, offset: usize) -> u32 {
        // SAFETY: `base` is the peripheral's address on both machines, `offset` one of its registers, aligned; this
        // value owns the peripheral, as a board can be taken once only.
        unsafe { self.base.add(offset).read_volatile() }
    }

    fn write_register(&mut self, offset: usize, value: u32) {
        // SAFETY: as in `read_register`; a write has no effect on memory.
        unsafe { self.base.add(offset).write_volatile(value) }
    }

    fn state(&self, flag: u32) -> bool {
        self.read_register(register::STATE) & flag != 0
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.state(STATE_RX_FULL))
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.state(STATE_TX_FULL))
    }
}

impl Read for Uart {
    /// Blocks for the first byte, then takes what is there.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        for byte in buffer {
            while !self.state(STATE_RX_FULL) {
                if count > 0 {
                    return Ok(count);
                }
            }
            *byte = self.read_register(register::DATA) as u8;
            count += 1;
        }
        Ok(count)
    }
}

impl Write for Uart {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Infallible> {
        for &byte in buffer {
            while self.state(STATE_TX_FULL) {}
            self.write_register(register::DATA, u32::from(byte));
        }
        Ok(buffer.len())
    }

    /// Blocks until the last byte has left.
    fn flush(&mut self) -> Result<(), Infallible> {
        while self.state(STATE_TX_FULL) {}
        Ok(())
    }
}
