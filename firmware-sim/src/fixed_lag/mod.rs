//! The example of a smoother on a target: a filter of carrier phases whose position is known better some epochs later.
//!
//! No input; the answer on UART0 is each smoothed density, see [`drive::write`]. It is the same byte for byte as the
//! host's.

pub mod drive;

use crate::board::InstructionCounter;
use crate::replay::Cost;
use drive::{Drive, DriveError, EPOCHS, LAG, position, position_of, write};
use embedded_io::Write;
use surefix_core::real::Real;

/// What came of a drive.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Instructions to simulate and filter an epoch, and to store it in the ring.
    pub filter: Cost,
    /// Instructions to smooth one.
    pub smoother: Cost,
    /// Sums of squared position errors of the epochs that were smoothed: filtered, smoothed `[m²]`.
    squares: [f64; 2],
}

impl Summary {
    /// Root mean squares of the position error: filtered, smoothed `[m]`.
    pub fn errors(&self) -> [f64; 2] {
        self.squares.map(|sum| libm::sqrt(sum / f64::from(self.smoother.count.max(1))))
    }

    /// Says it by defmt, one `name: value` a line, as the task runner reads it.
    pub fn report(&self) {
        let [filtered, smoothed] = self.errors();
        defmt::info!("epochs smoothed: {=u32}", self.smoother.count);
        defmt::info!("position error, filtered: {=f64}", filtered);
        defmt::info!("position error, smoothed: {=f64}", smoothed);
        defmt::info!("instructions per epoch to filter, mean: {=u64}", self.filter.mean());
        defmt::info!("instructions per epoch, mean: {=u64}", self.smoother.mean());
        defmt::info!("instructions per epoch, most: {=u64}", self.smoother.max);
    }
}

/// Why a drive ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped<E> {
    /// Filter or smoother failed.
    Drive(DriveError),
    /// The answer cannot be written.
    Write(E),
}

/// Drives all epochs, smooths each [`LAG`] epochs later, and writes that to `sink`.
pub fn run<T: Real, W: Write>(
    drive: &mut Drive<T>,
    mut sink: W,
    counter: &InstructionCounter,
) -> Result<Summary, Stopped<W::Error>> {
    let mut summary = Summary::default();
    let mut filtered = [[0.0; 3]; LAG + 1];
    for epoch in 0..EPOCHS {
        let (latest, instructions) = counter.measure(|| drive.advance());
        summary.filter.add(instructions);
        filtered.rotate_right(1);
        filtered[0] = latest.map_err(Stopped::Drive)?;
        let (smoothed, instructions) = counter.measure(|| drive.smooth());
        let Some(smoothed) = smoothed else { continue };
        summary.smoother.add(instructions);
        let density = smoothed.map_err(Stopped::Drive)?;
        let truth = position(epoch - LAG as u32);
        for (sum, found) in summary.squares.iter_mut().zip([filtered[LAG], position_of(density.mean)]) {
            *sum += found.iter().zip(truth).fold(0.0, |sum, (found, truth)| sum + (found - truth) * (found - truth));
        }
        write(density, |bytes| sink.write_all(bytes)).map_err(Stopped::Write)?;
    }
    sink.flush().map_err(Stopped::Write)?;
    Ok(summary)
}

/// Makes a program of the drive with a scalar: it answers over UART0, and says by defmt what that took.
#[macro_export]
macro_rules! fixed_lag_over_uart {
    ($scalar:ty) => {
        #[cortex_m_rt::entry]
        fn main() -> ! {
            static mut DRIVE: $crate::fixed_lag::drive::Drive<$scalar> = $crate::fixed_lag::drive::Drive::new();
            use $crate::board::{self, Board};
            use $crate::fixed_lag::Stopped;
            let Some(Board { counter, uart, stack }) = Board::take() else { board::exit(1) };
            match $crate::fixed_lag::run(DRIVE, uart.transmitter, &counter) {
                Ok(summary) => summary.report(),
                Err(Stopped::Drive(error)) => {
                    defmt::error!("{}", defmt::Display2Format(&error));
                    board::exit(1)
                }
                Err(Stopped::Write(error)) => match error {},
            }
            defmt::info!("state and workspace: {=usize}", core::mem::size_of_val(DRIVE));
            defmt::info!("peak stack: {=usize}", stack.peak());
            board::exit(0)
        }
    };
}
