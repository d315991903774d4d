//! Replays the device log that comes over UART0 by a filter for 16 signals, as of 8 satellites on two bands.
#![no_std]
#![no_main]

surefix_firmware::replay_over_uart!(surefix_core::rtk::preset::Rtk16);
