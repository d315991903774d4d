//! Runs the device log that comes over UART0 by the mixed-integer filter of Section V, covariances in double precision.
#![no_std]
#![no_main]

surefix_firmware::section_v_over_uart!(f64);
