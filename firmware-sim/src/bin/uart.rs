//! Proves the serial stream: reads a length and as many bytes, sends every fifth of them back, and loses none.
#![no_std]
#![no_main]

use embedded_io::{Read, Write};
use surefix_firmware::board::{self, Board};

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut board) = Board::take() else { board::exit(1) };
    let Ok(()) = transfer(&mut board) else { board::exit(1) };
    board::exit(0)
}

fn transfer(board: &mut Board) -> Result<(), embedded_io::ReadExactError<core::convert::Infallible>> {
    let mut length = [0; 4];
    board.uart.receiver.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length);
    let mut byte = [0];
    for index in 0..length {
        board.uart.receiver.read_exact(&mut byte)?;
        if index % 5 == 0 {
            board.uart.transmitter.write_all(&byte).map_err(embedded_io::ReadExactError::Other)?;
        }
    }
    board.uart.transmitter.flush().map_err(embedded_io::ReadExactError::Other)?;
    defmt::info!("{=u32} bytes read", length);
    Ok(())
}
