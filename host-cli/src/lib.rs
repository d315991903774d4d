//! Host side of surefix: readers, processing, simulation, comparison and writers around `surefix-core`.
