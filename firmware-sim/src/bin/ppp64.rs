//! Precise point positioning, one receiver at rest and moving, answers over UART0.
#![no_std]
#![no_main]

use surefix_firmware::board::{self, Board};
use surefix_firmware::ppp::drive::{Drive, Kind};
use surefix_firmware::ppp::run;

#[cortex_m_rt::entry]
fn main() -> ! {
    static mut DRIVE: Drive = Drive::new();
    let Some(Board { counter, mut uart, stack }) = Board::take() else { board::exit(1) };
    for kind in Kind::ALL {
        let summary = match run(DRIVE, kind, &mut uart.transmitter, &counter) {
            Ok(summary) => summary,
            Err(error) => match error {},
        };
        defmt::info!("{=str}: epochs by phases: {=u32}", kind.name(), summary.float);
        defmt::info!("{=str}: position error: {=f64}", kind.name(), summary.error);
        defmt::info!("{=str}: instructions per epoch, mean: {=u64}", kind.name(), summary.epochs.mean());
        defmt::info!("{=str}: instructions per epoch, most: {=u64}", kind.name(), summary.epochs.max);
        // The last kind has most states.
        if kind == Kind::ALL[3] {
            defmt::info!("instructions per epoch, mean: {=u64}", summary.epochs.mean());
            defmt::info!("instructions per epoch, most: {=u64}", summary.epochs.max);
        }
    }
    defmt::info!("state and workspace: {=usize}", core::mem::size_of::<Drive>());
    defmt::info!("peak stack: {=usize}", stack.peak());
    board::exit(0)
}
