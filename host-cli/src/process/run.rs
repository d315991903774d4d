//! Running the engine over a stream of inputs.
//!
//! The host feeds the same [`RtkFilter`](surefix_core::rtk::RtkFilter) through the same door as firmware does
//! ([`surefix_core::rtk::feed`]), so its solutions are the same to the last bit.

use super::stream::Input;
use surefix_core::gnss::solution::Solution;
use surefix_core::log::{self, Config, Event, Station};
use surefix_core::rtk::RtkConfig;
use surefix_core::rtk::evidence::Evidence;
use surefix_core::rtk::preset::Rtk128;

/// The engine of the host: the largest preset.
pub struct Engine {
    filter: Box<Rtk128>,
}

impl Engine {
    /// An engine that has seen nothing.
    pub fn new(config: RtkConfig) -> Self {
        // Built in place by a thread with room for it: the filter is too large to pass through a small stack.
        let build = move || Box::new(Rtk128::new(config, None));
        let thread = std::thread::Builder::new().stack_size(16 << 20).spawn(build);
        let filter = match thread.map(std::thread::JoinHandle::join) {
            Ok(Ok(filter)) => filter,
            // No thread to be had: this one's stack will do in an optimised build.
            _ => build(),
        };
        Self { filter }
    }

    /// The configuration in force.
    pub fn config(&self) -> &RtkConfig {
        self.filter.config()
    }

    /// The measurements of the latest rover epoch as they were used, see [`surefix_core::rtk::evidence`].
    pub fn evidence(&self) -> Option<Evidence<'_>> {
        self.filter.evidence()
    }

    /// Takes one input; a rover epoch is answered by a solution.
    pub fn feed(&mut self, input: &Input) -> Option<Solution> {
        self.filter.feed(&match input {
            Input::Header(header) => log::Input::Header(*header),
            Input::Config(schema, data) => log::Input::Config(Config { schema: *schema, data }),
            Input::Ionosphere(ionosphere) => log::Input::Ionosphere(*ionosphere),
            Input::Ephemeris(ephemeris) => log::Input::Ephemeris(*ephemeris),
            Input::Base(epoch) => log::Input::Epoch(Station::Base, epoch.view()),
            Input::Rover(epoch) => log::Input::Epoch(Station::Rover, epoch.view()),
            Input::Reset => log::Input::Event(Event::Reset),
        })
    }
}
