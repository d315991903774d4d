//! Uses more stack than there is. The machine must stop; a run that gets to the end is a failure of the memory map.
#![no_std]
#![no_main]

use surefix_firmware::board::{self, Board};

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(board) = Board::take() else { board::exit(1) };
    defmt::info!("recursing beyond {=usize} bytes of stack", board.stack.size());
    let depth = recurse(u32::MAX);
    defmt::error!("survived a recursion of depth {=u32}", depth);
    board::exit(0)
}

#[inline(never)]
fn recurse(left: u32) -> u32 {
    let frame = core::hint::black_box([left; 64]);
    if left == 0 { 0 } else { recurse(left - 1).wrapping_add(frame[0] & 1) }
}
