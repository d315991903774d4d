//! UART0 of the MPS2 boards: an Arm CMSDK APB UART, as [`embedded_io`] streams.
//!
//! Source: *Cortex-M System Design Kit Technical Reference Manual* (Arm DDI 0479), APB UART programmers model. It holds
//! one byte each way and has no FIFO; QEMU takes the next byte from its host side when the one before was read, so
//! nothing is lost however slow the reader is.

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

fn read_register(offset: usize) -> u32 {
    // SAFETY: this is the address of a UART register on both machines, aligned. Reading STATE has no effect; DATA is
    // read by the receiver alone, of which there is one, as a board can be taken once only.
    unsafe { UART0.add(offset).read_volatile() }
}

fn write_register(offset: usize, value: u32) {
    // SAFETY: as above. A write has no effect on memory; DATA is written by the transmitter alone.
    unsafe { UART0.add(offset).write_volatile(value) }
}

fn is_set(flag: u32) -> bool {
    read_register(register::STATE) & flag != 0
}

/// The two directions of UART0, for use together or apart.
pub struct Uart {
    /// From outside.
    pub receiver: Receiver,
    /// To outside.
    pub transmitter: Transmitter,
}

impl Uart {
    /// UART0, switched on. Only [`super::Board::take`] makes one.
    pub(super) fn uart0() -> Self {
        write_register(register::BAUDDIV, FASTEST);
        write_register(register::CTRL, CTRL_TX_ENABLE | CTRL_RX_ENABLE);
        Self { receiver: Receiver(()), transmitter: Transmitter(()) }
    }
}

/// Receives; polled.
pub struct Receiver(());

impl ErrorType for Receiver {
    type Error = Infallible;
}

impl ReadReady for Receiver {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(is_set(STATE_RX_FULL))
    }
}

impl Read for Receiver {
    /// Blocks for the first byte, then takes what is there.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        for byte in buffer {
            while !is_set(STATE_RX_FULL) {
                if count > 0 {
                    return Ok(count);
                }
            }
            *byte = read_register(register::DATA) as u8;
            count += 1;
        }
        Ok(count)
    }
}

/// Transmits; polled.
pub struct Transmitter(());

impl ErrorType for Transmitter {
    type Error = Infallible;
}

impl WriteReady for Transmitter {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!is_set(STATE_TX_FULL))
    }
}

impl Write for Transmitter {
    /// Blocks until the last byte is on its way.
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Infallible> {
        for &byte in buffer {
            self.flush()?;
            write_register(register::DATA, u32::from(byte));
        }
        Ok(buffer.len())
    }

    /// Blocks until the last byte has left.
    fn flush(&mut self) -> Result<(), Infallible> {
        while is_set(STATE_TX_FULL) {}
        Ok(())
    }
}
