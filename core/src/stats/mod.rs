//! Probability distributions: normal and χ².
