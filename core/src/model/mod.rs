//! Models between the vocabulary and the filters: which combination of observations, which noise, which motion.

pub mod combination;
pub mod motion;
pub mod multi_band;
pub mod noise;
pub mod partially_linear;
pub mod virtual_bias;
