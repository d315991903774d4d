//! Dense kernels on slices: in place, no allocation, runtime dimensions.
