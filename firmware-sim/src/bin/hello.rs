//! The smallest program: the machine starts, defmt speaks, the instruction counter counts, the exit code arrives.
#![no_std]
#![no_main]

use surefix_firmware::board::{self, Board};

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(board) = Board::take() else { board::exit(1) };
    defmt::info!("hello from a {=str}", board::core_name());
    // Two instructions an iteration (subs, bne), and a few around.
    let ((), instructions) = board.counter.measure(|| cortex_m::asm::delay(100_000));
    let plausible = (100_000..300_000).contains(&instructions);
    defmt::info!("instruction counter plausible: {=bool}", plausible);
    board::exit(if plausible { 0 } else { 1 })
}
