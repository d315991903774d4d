//! Replays the device log that comes over UART0 and answers there; says by defmt what it took.
#![no_std]
#![no_main]

use surefix_firmware::board::{self, Board};
use surefix_firmware::replay::Replay;

#[cortex_m_rt::entry]
fn main() -> ! {
    static mut REPLAY: Replay = Replay::new();
    let Some(Board { counter, uart, stack }) = Board::take() else { board::exit(1) };
    let Ok(summary) = REPLAY.run(uart.receiver, uart.transmitter, &counter);
    summary.report();
    defmt::info!("peak stack: {=usize}", stack.peak());
    board::exit(if summary.ended { 0 } else { 1 })
}
