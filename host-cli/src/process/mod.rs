//! Processing: what an engine is told, in which order, and what becomes of it.

pub mod stream;
