//! Smooths a drive by a ring of ten epochs, in single precision, and answers over UART0.
#![no_std]
#![no_main]

surefix_firmware::fixed_lag_over_uart!(f32);
