//! Sizes of [`RtkFilter`] for common receivers. A signal is one band of one satellite; an ephemeris is one message.
//!
//! | preset | signals | for instance | state and workspace |
//! |---|---|---|---|
//! | [`Rtk16`] | 16 | 16 satellites on L1, 8 on two bands | 44 KB |
//! | [`Rtk32`] | 32 | 32 satellites on L1, 16 on two bands | 103 KB |
//! | [`Rtk64`] | 64 | 32 satellites on two bands | 271 KB |
//! | [`Rtk128`] | 128 | everything that a host file holds | 916 KB |
//!
//! The sizes are checked by a test. Signals beyond the capacity are left out; a preset does not change results otherwise.

use super::RtkFilter;

/// 16 signals.
pub type Rtk16 = RtkFilter<16, 25, 48>;
/// 32 signals.
pub type Rtk32 = RtkFilter<32, 41, 96>;
/// 64 signals.
pub type Rtk64 = RtkFilter<64, 73, 128>;
/// 128 signals.
pub type Rtk128 = RtkFilter<128, 137, 512>;

#[cfg(test)]
mod tests {
    use super::*;

    /// The table above, rounded.
    #[test]
    fn sizes_are_as_documented() {
        let sizes = [size_of::<Rtk16>(), size_of::<Rtk32>(), size_of::<Rtk64>(), size_of::<Rtk128>()];
        for (size, limit) in sizes.into_iter().zip([44_100, 103_500, 270_800, 915_800]) {
            assert!(size <= limit && size > limit * 98 / 100, "{sizes:?}");
        }
    }
}
