//! Epochs of any size from their parts.
//!
//! Panic contract: none.

use super::record::{EpochPart, Station};
use crate::gnss::epoch::{Epoch, EpochView};
use crate::gnss::time::GpsTime;

/// Puts the parts of epochs together, in room for one epoch of up to `N` observations.
///
/// What is lost with a damaged frame is the observations in it: an epoch of which a part is missing is handed on with
/// what is there, and counted.
#[derive(Clone, Debug)]
pub struct EpochCollector<const N: usize> {
    epoch: Epoch<N>,
    /// Whose epoch is open, if one is.
    open: Option<Station>,
    /// Index of the observation of the open epoch that should come next.
    next: u16,
    /// Observations that the open epoch should have.
    total: u16,
    /// Whether a part is missing before `next`.
    gap: bool,
    incomplete: u32,
    excess: u32,
}

impl<const N: usize> EpochCollector<N> {
    /// Without an epoch.
    pub const fn new() -> Self {
        Self {
            epoch: Epoch::new(GpsTime::from_nanoseconds(0)),
            open: None,
            next: 0,
            total: 0,
            gap: false,
            incomplete: 0,
            excess: 0,
        }
    }

    /// Takes the next part and hands `sink` each epoch that ends with it: the one before, if its last part was lost,
    /// and the part's own if this is its last.
    pub fn push(&mut self, part: &EpochPart<'_>, mut sink: impl FnMut(Station, EpochView<'_>)) {
        let continues = self.open == Some(part.station)
            && self.epoch.time == part.time
            && self.total == part.total
            && self.next <= part.first;
        if !continues {
            self.finish(&mut sink);
            self.epoch.time = part.time;
            self.open = Some(part.station);
            self.total = part.total;
        }
        self.gap |= self.next != part.first;
        self.next = part.first.saturating_add(part.count);
        for observation in part.observations() {
            if self.epoch.observations.push(observation).is_err() {
                self.excess = self.excess.saturating_add(1);
            }
        }
        if part.is_last() {
            self.finish(sink);
        }
    }

    /// Hands on the epoch whose last part has not come. To be called at the end of a stream, and before any record
    /// whose order with respect to epochs matters.
    pub fn finish(&mut self, mut sink: impl FnMut(Station, EpochView<'_>)) {
        if let Some(station) = self.open.take() {
            self.incomplete = self.incomplete.saturating_add(u32::from(self.gap || self.next < self.total));
            sink(station, self.epoch.view());
        }
        self.epoch.observations.clear();
        self.next = 0;
        self.gap = false;
    }

    /// Epochs so far of which a part was missing.
    pub const fn incomplete(&self) -> u32 {
        self.incomplete
    }

    /// Observations so far for which there was no room.
    pub const fn excess(&self) -> u32 {
        self.excess
    }
}

impl<const N: usize> Default for EpochCollector<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::epoch::Observation;
    use crate::log::{EPOCH_PART, MAX_FRAME, Record, RecordReader, epoch_parts, write_epoch_part};

    fn epoch(time: i64, observations: usize) -> Epoch<200> {
        let mut epoch = Epoch::new(GpsTime::from_nanoseconds(time));
        for i in 0..observations {
            let satellite = format!("G{:02}", 1 + i % 63).parse().unwrap();
            let mut observation = Observation::new(satellite, "1C".parse().unwrap());
            observation.code = Some(2.0e7 + i as f64);
            epoch.observations.push(observation).unwrap();
        }
        epoch
    }

    /// Reads the parts of epochs that `keep` names by epoch and part; the epochs that come out, and the counts.
    fn collect<const N: usize>(
        epochs: &[(Station, Epoch<200>)],
        keep: impl Fn(usize, usize) -> bool,
    ) -> (Vec<(Station, Epoch<200>)>, u32, u32) {
        let mut collector = EpochCollector::<N>::new();
        let mut reader: RecordReader = RecordReader::new();
        let mut got = Vec::new();
        let mut sink = |station, view: EpochView<'_>| {
            let observations = view.observations.iter().copied().collect();
            got.push((station, Epoch { time: view.time, observations }));
        };
        for (i, (station, epoch)) in epochs.iter().enumerate() {
            for part in (0..epoch_parts(epoch.view())).filter(|&part| keep(i, part)) {
                let mut frame = [0; MAX_FRAME];
                let length = write_epoch_part(*station, epoch.view(), part, &mut frame).unwrap();
                for &byte in &frame[..length] {
                    if let Some(Ok(Record::Epoch(part))) = reader.push(byte) {
                        collector.push(&part, &mut sink);
                    }
                }
            }
        }
        collector.finish(&mut sink);
        (got, collector.incomplete(), collector.excess())
    }

    #[test]
    fn epochs_of_any_size_come_back() {
        use Station::{Base, Rover};
        let sizes = [0, 1, EPOCH_PART, EPOCH_PART + 1, 3 * EPOCH_PART, 200];
        let epochs: Vec<_> = (0i64..)
            .zip(sizes)
            .flat_map(|(time, size)| [(Base, epoch(time, size)), (Rover, epoch(time, size))])
            .collect();
        assert_eq!(collect::<200>(&epochs, |_, _| true), (epochs, 0, 0));
    }

    #[test]
    fn a_lost_part_costs_its_own_observations() {
        let epochs: Vec<_> = (0..3).map(|time| (Station::Rover, epoch(time, 2 * EPOCH_PART + 5))).collect();
        for (lost, left) in [(0, EPOCH_PART + 5), (1, EPOCH_PART + 5), (2, 2 * EPOCH_PART)] {
            let (got, incomplete, _) = collect::<200>(&epochs, |i, part| (i, part) != (1, lost));
            let lengths: Vec<_> = got.iter().map(|(_, epoch)| epoch.observations.len()).collect();
            assert_eq!((lengths, incomplete), (vec![2 * EPOCH_PART + 5, left, 2 * EPOCH_PART + 5], 1));
        }
        let (got, incomplete, _) = collect::<200>(&epochs, |i, _| i != 1);
        assert_eq!((got.len(), incomplete), (2, 0));
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let (got, incomplete, excess) = collect::<50>(&[(Station::Base, epoch(7, 60))], |_, _| true);
        assert_eq!((got[0].1.observations.len(), incomplete, excess), (50, 0, 10));
    }
}
