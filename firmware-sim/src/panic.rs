//! What happens on a panic or a fault: it is reported by defmt, and QEMU exits with a code that no test expects.

use crate::board::{EXIT_FAULT, EXIT_PANIC, exit};
use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    match info.location() {
        Some(place) => defmt::error!("panic at {=str}:{=u32}", place.file(), place.line()),
        None => defmt::error!("panic"),
    }
    exit(EXIT_PANIC)
}

/// A bus, usage or memory fault. After a stack overflow there is no stack left to enter this on, and QEMU stops with a
/// lock-up instead, which also is a failure.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {=u32:#010x}", frame.pc());
    exit(EXIT_FAULT)
}
