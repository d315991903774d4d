//! Two vehicles by the filter of double differences, plain and adaptive, covariances in double precision, answers over UART0.
#![no_std]
#![no_main]

surefix_firmware::moving_base_over_uart!(f64);
