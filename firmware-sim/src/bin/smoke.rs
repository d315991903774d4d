//! Replays a log that is part of the program, `smoke/drive.log`: the engine works on this machine, without any cable.
#![no_std]
#![no_main]

use surefix_core::rtk::{RtkConfig, preset::Rtk32};
use surefix_firmware::board::{self, Board};
use surefix_firmware::replay::Replay;

/// Made by `surefix simulate firmware-sim/smoke/drive.toml`.
static LOG: &[u8] = include_bytes!("../../smoke/drive.log");

#[cortex_m_rt::entry]
fn main() -> ! {
    static mut REPLAY: Replay<Rtk32> = Replay::new(Rtk32::new(RtkConfig::DEFAULT, None));
    let Some(board) = Board::take() else { board::exit(1) };
    let Ok(summary) = REPLAY.run(LOG, Nowhere, &board.counter);
    let [fixed, partial, ..] = summary.qualities;
    defmt::info!("{=u32} epochs, {=u32} damaged frames", summary.epochs.count, summary.damaged);
    defmt::info!("most of them fixed: {=bool}", fixed + partial > summary.epochs.count / 2);
    defmt::info!("stack to spare: {=bool}", board.stack.peak() < board.stack.size() * 3 / 4);
    board::exit(if summary.ended { 0 } else { 1 })
}

/// A stream that takes everything.
struct Nowhere;

impl embedded_io::ErrorType for Nowhere {
    type Error = core::convert::Infallible;
}

impl embedded_io::Write for Nowhere {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Self::Error> {
        Ok(buffer.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}
