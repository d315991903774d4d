//! stand-in
use surefix_core::gnss::solution::{Reason, Solution};
use surefix_core::log::{Input, Station};

/// stand-in
pub struct Engine;

impl Engine {
    /// stand-in
    pub const fn new() -> Self {
        Self
    }
    /// stand-in
    pub fn push(&mut self, input: Input<'_>) -> Option<Solution> {
        match input {
            Input::Epoch(Station::Rover, epoch) => Some(Solution::none(epoch.time, Reason::NoBase)),
            _ => None,
        }
    }
}
