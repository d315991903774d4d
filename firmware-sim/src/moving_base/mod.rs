//! The filter of double differences between two vehicles, with noise as configured and with noise that follows the data, so
//! that what the latter costs can be read.
//!
//! No input; the answer on UART0 is each epoch's, of the plain filter, then of the adaptive one, see [`drive::write`]. It is
//! the same byte for byte as the host's.

pub mod drive;

use crate::board::InstructionCounter;
use crate::replay::Cost;
use drive::{Drive, EPOCHS, vector, write};
use embedded_io::Write;
use surefix_core::filter::double_difference::DoubleDifferenceError;
use surefix_core::integrity::protection::Basis;
use surefix_core::real::Real;

/// Instructions that noise which follows the data may take, in percent of the plain filter's.
pub const MOST_PERCENT: u64 = 125;

/// What came of a drive.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Instructions for an epoch, from differences to answer.
    pub epochs: Cost,
    /// Epochs with a fixed answer.
    pub fixed: u32,
    /// Sum of squared errors `[m²]`.
    squares: f64,
}

impl Summary {
    /// Root mean square of the position error `[m]`.
    pub fn error(&self) -> f64 {
        libm::sqrt(self.squares / f64::from(self.epochs.count.max(1)))
    }
}

/// Why a drive ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped<E> {
    /// The filter failed.
    Drive(DoubleDifferenceError),
    /// The answer cannot be written.
    Write(E),
}

/// Drives all epochs and writes the answers to `sink`.
pub fn run<T: Real, W: Write>(
    drive: &mut Drive<T>,
    sink: &mut W,
    counter: &InstructionCounter,
) -> Result<Summary, Stopped<W::Error>> {
    let mut summary = Summary::default();
    for epoch in 0..EPOCHS {
        let sights = drive.observe();
        let (answer, instructions) = counter.measure(|| drive.advance(&sights));
        let answer = answer.map_err(Stopped::Drive)?;
        summary.epochs.add(instructions);
        summary.fixed += u32::from(answer.basis != Basis::Float);
        let error = answer.position - vector(epoch).0;
        summary.squares += error.dot(&error);
        write(&answer, |bytes| sink.write_all(bytes)).map_err(Stopped::Write)?;
    }
    sink.flush().map_err(Stopped::Write)?;
    Ok(summary)
}

/// Makes a program of both drives with a scalar: it answers over UART0, and says by defmt what that took.
#[macro_export]
macro_rules! moving_base_over_uart {
    ($scalar:ty) => {
        #[cortex_m_rt::entry]
        fn main() -> ! {
            static mut PLAIN: $crate::moving_base::drive::Drive<$scalar> =
                $crate::moving_base::drive::Drive::new($crate::moving_base::drive::Kind::Plain);
            static mut ADAPTIVE: $crate::moving_base::drive::Drive<$scalar> =
                $crate::moving_base::drive::Drive::new($crate::moving_base::drive::Kind::Adaptive);
            use $crate::board::{self, Board};
            use $crate::moving_base::drive::Drive;
            use $crate::moving_base::{Stopped, Summary, run};
            let Some(Board { counter, mut uart, stack }) = Board::take() else { board::exit(1) };
            let mut all = [Summary::default(); 2];
            for (drive, summary) in [PLAIN, ADAPTIVE].into_iter().zip(&mut all) {
                match run(drive, &mut uart.transmitter, &counter) {
                    Ok(done) => *summary = done,
                    Err(Stopped::Drive(error)) => {
                        defmt::error!("{}", defmt::Display2Format(&error));
                        board::exit(1)
                    }
                    Err(Stopped::Write(error)) => match error {},
                }
            }
            let [plain, adaptive] = all;
            for (kind, summary) in [("plain", plain), ("adaptive", adaptive)] {
                defmt::info!("{=str}: epochs fixed: {=u32}", kind, summary.fixed);
                defmt::info!("{=str}: position error: {=f64}", kind, summary.error());
                defmt::info!("{=str}: instructions per epoch: {=u64}", kind, summary.epochs.mean());
            }
            defmt::info!("instructions per epoch, mean: {=u64}", adaptive.epochs.mean());
            defmt::info!("instructions per epoch, most: {=u64}", adaptive.epochs.max);
            defmt::info!("state and workspace: {=usize}", core::mem::size_of::<Drive<$scalar>>());
            defmt::info!("peak stack: {=usize}", stack.peak());
            let dear = 100 * adaptive.epochs.mean() > $crate::moving_base::MOST_PERCENT * plain.epochs.mean();
            if dear {
                defmt::error!("the adaptive filter takes too many instructions");
            }
            board::exit(i32::from(dear))
        }
    };
}
