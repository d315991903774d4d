//! Whatever happens to the bytes of a device log, only the frames that were touched are lost, no record is made up, and
//! nothing panics.

use proptest::prelude::*;
use surefix_core::gnss::epoch::{Epoch, Observation};
use surefix_core::gnss::time::GpsTime;
use surefix_core::log::*;

/// A log of epochs and events and the range of bytes of each frame, delimiters included.
fn log(frames: usize, seed: u64) -> (Vec<u8>, Vec<std::ops::Range<usize>>) {
    let mut bytes = Vec::new();
    let mut ranges = Vec::new();
    for i in 0..frames {
        let mut frame = [0; MAX_FRAME];
        let random = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(i as u64).rotate_left(i as u32 % 64);
        let length = if i % 4 == 3 {
            write_event(&Event::Marker(random as u32), &mut frame)
        } else {
            write_epoch_part(Station::Rover, epoch(i, random).view(), 0, &mut frame)
        };
        let start = bytes.len();
        bytes.extend_from_slice(&frame[..length.unwrap()]);
        ranges.push(start..bytes.len());
    }
    (bytes, ranges)
}

fn epoch(i: usize, random: u64) -> Epoch<40> {
    let mut epoch = Epoch::new(GpsTime::from_nanoseconds(i as i64));
    for j in 0..random % 41 {
        let satellite = format!("E{:02}", 1 + j).parse().unwrap();
        let mut observation = Observation::new(satellite, "1C".parse().unwrap());
        observation.code = Some((random % 30_000_000_000) as f64 / 1000.0);
        observation.phase = Some(f64::from_bits(random >> 3));
        observation.loss_of_lock = j % 3 == 0;
        epoch.observations.push(observation).unwrap();
    }
    epoch
}

/// The records of a stream as text, which tells any two apart.
fn read(bytes: &[u8]) -> (Vec<String>, Counts) {
    let mut reader: RecordReader = RecordReader::new();
    let mut records = Vec::new();
    let mut keep = |record: Result<Record<'_>, FrameError>| match record {
        Ok(Record::Epoch(part)) => {
            records.push(format!("{:?} {:?} {:?}", part.time, part.total, part.observations().collect::<Vec<_>>()));
        }
        Ok(other) => records.push(format!("{other:?}")),
        Err(_) => (),
    };
    bytes.iter().for_each(|&byte| {
        reader.push(byte).into_iter().for_each(&mut keep);
    });
    reader.finish().into_iter().for_each(&mut keep);
    let counts = *reader.counts();
    (records, counts)
}

/// The records of the frames that lie wholly outside `touched`.
fn untouched(bytes: &[u8], ranges: &[std::ops::Range<usize>], touched: impl Fn(usize) -> bool) -> Vec<String> {
    let kept = ranges.iter().filter(|range| !(*range).clone().any(&touched));
    kept.flat_map(|range| read(&bytes[range.clone()]).0).collect()
}

proptest! {
    #[test]
    fn changed_bytes_cost_their_frames(
        seed in any::<u64>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), 1u8..), 1..12),
    ) {
        let (bytes, ranges) = log(24, seed);
        let mut damaged = bytes.clone();
        let mut touched = std::collections::BTreeSet::new();
        for (index, flip) in &changes {
            damaged[index.index(bytes.len())] ^= flip;
            touched.insert(index.index(bytes.len()));
        }
        let (records, counts) = read(&damaged);
        prop_assert_eq!(records.len(), counts.good as usize);
        let expected = untouched(&bytes, &ranges, |i| touched.contains(&i));
        let all = read(&bytes).0;
        prop_assert_eq!(all.len(), ranges.len());
        // A delimiter that changed touches no content: such a frame may come back too, but nothing may that was not there.
        prop_assert!(is_subsequence(&expected, &records), "an untouched frame was lost");
        prop_assert!(is_subsequence(&records, &all), "a record was made up");
    }

    #[test]
    fn a_hole_costs_its_frames(seed in any::<u64>(), from in any::<prop::sample::Index>(), length in 1usize..3000) {
        let (bytes, ranges) = log(24, seed);
        let from = from.index(bytes.len());
        let to = (from + length).min(bytes.len());
        let damaged = [&bytes[..from], &bytes[to..]].concat();
        let (records, counts) = read(&damaged);
        prop_assert!(is_subsequence(&untouched(&bytes, &ranges, |i| (from..to).contains(&i)), &records));
        prop_assert!(is_subsequence(&records, &read(&bytes).0));
        prop_assert!(counts.bad() <= 2);
    }

    #[test]
    fn noise_between_frames_costs_nothing(seed in any::<u64>(), noise in prop::collection::vec(any::<u8>(), 0..4000)) {
        let (bytes, ranges) = log(8, seed);
        let at = ranges[seed as usize % 8].end;
        let (records, _) = read(&[&bytes[..at], &noise, &bytes[at..]].concat());
        prop_assert_eq!(records, read(&bytes).0);
    }

    #[test]
    fn a_log_can_be_cut_anywhere(seed in any::<u64>(), at in any::<prop::sample::Index>()) {
        let (bytes, ranges) = log(8, seed);
        let at = at.index(bytes.len());
        let whole = ranges.iter().filter(|range| range.end <= at).count();
        let (records, counts) = read(&bytes[..at]);
        // The last delimiter carries nothing: without it the frame is whole.
        prop_assert!(records.len() == whole || ranges[whole].end == at + 1 && records.len() == whole + 1);
        prop_assert!(counts.bad() <= 1);
        let (records, _) = read(&bytes[at..]);
        prop_assert!(is_subsequence(&untouched(&bytes, &ranges, |i| i < at), &records));
    }

    /// Payloads of any bytes behind a right checksum: the decoder of records itself, which noise hardly ever reaches.
    #[test]
    fn any_payload_is_read_or_refused(kind in 0u8..10, payload in prop::collection::vec(any::<u8>(), 0..400)) {
        let mut plain = vec![MAGIC, VERSION, kind];
        plain.extend(&payload);
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&plain);
        plain.extend(crc.to_le_bytes());
        let mut stream = vec![0; plain.len() + 8];
        let length = cobs::encode(&plain, &mut stream);
        let (records, counts) = read(&stream[..length]);
        prop_assert_eq!(counts.good + counts.bad(), 1);
        prop_assert_eq!(records.len(), counts.good as usize);
        prop_assert_eq!(counts.checksum + counts.malformed + counts.overlong, 0);
    }
}

fn is_subsequence(short: &[String], long: &[String]) -> bool {
    let mut rest = long.iter();
    short.iter().all(|item| rest.any(|other| other == item))
}

#[test]
fn numbers_that_are_not_finite_are_dropped_and_counted() {
    let mut epoch = epoch(1, 3);
    epoch.observations[0].code = Some(f64::NAN);
    epoch.observations[1].phase = Some(f64::NEG_INFINITY);
    epoch.observations[2].cn0 = Some(f32::NAN);
    let mut frame = [0; MAX_FRAME];
    let length = write_epoch_part(Station::Rover, epoch.view(), 0, &mut frame).unwrap();
    let mut reader: RecordReader = RecordReader::new();
    for &byte in &frame[..length] {
        if let Some(record) = reader.push(byte) {
            let Ok(Record::Epoch(part)) = record else { panic!("{record:?}") };
            let read: Vec<_> = part.observations().collect();
            assert_eq!((read[0].code, read[0].phase), (None, epoch.observations[0].phase));
            assert_eq!((read[1].phase, read[2].cn0, part.not_finite), (None, None, 3));
        }
    }
    assert_eq!((reader.counts().observables_not_finite, reader.counts().good), (3, 1));

    let header = Header { base_position: Some([f64::NAN, 0.0, 0.0]), ..Header::default() };
    let length = write_header(&header, &mut frame).unwrap();
    assert_eq!(read(&frame[..length]).1, Counts { not_finite: 1, ..Counts::default() });
}

#[test]
fn the_largest_part_fits_and_two_frequencies_of_twenty_satellites_are_about_a_kilobyte() {
    let mut worst = Epoch::<EPOCH_PART>::new(GpsTime::from_nanoseconds(i64::MIN));
    let mut typical = Epoch::<EPOCH_PART>::new(GpsTime::from_week_tow(2400, 345_600.0));
    for i in 0..EPOCH_PART {
        let mut observation = Observation::new("R63".parse().unwrap(), "9Z".parse().unwrap());
        (observation.code, observation.phase) = (Some(1.0 / 3.0), Some(-1.0 / 3.0));
        (observation.doppler, observation.cn0) = (Some(f64::MAX), Some(f32::MIN_POSITIVE));
        worst.observations.push(observation).unwrap();
        observation = Observation::new(format!("C{:02}", i + 1).parse().unwrap(), "2I".parse().unwrap());
        (observation.code, observation.phase) = (Some(24_345_678.123), Some(128_345_678.123));
        (observation.doppler, observation.cn0) = (Some(-3456.789), Some(45.25));
        typical.observations.push(observation).unwrap();
    }
    let mut frame = [0; MAX_FRAME];
    assert!(write_epoch_part(Station::Rover, worst.view(), 0, &mut frame).is_ok());
    assert_eq!(read(&frame).1.good, 1);
    assert!(write_epoch_part(Station::Rover, typical.view(), 0, &mut frame).unwrap() <= 1128);
    assert_eq!(write_epoch_part(Station::Rover, typical.view(), 1, &mut frame), Err(WriteError::NotExpressible));
}
