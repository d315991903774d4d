//! Replays the device log that comes over UART0 by a filter for 64 signals, as of 32 satellites on two bands.
#![no_std]
#![no_main]

surefix_firmware::replay_over_uart!(surefix_core::rtk::preset::Rtk64);
