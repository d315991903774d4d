//! Filtered densities of all epochs, kept for a backward pass within a budget of memory.
//!
//! | [`Storage`] | memory for K epochs of n states | work beside the backward pass |
//! |---|---|---|
//! | `Memory` | K (n²/2 + 3n/2) numbers | none |
//! | `Checkpoints` | 2 √K (n²/2 + 3n/2) numbers | a second forward pass, in segments of √K epochs |
//! | `File` | one density | K densities written and read, in an unnamed temporary file |
//!
//! Chosen in this order, the first that fits the budget. A day at 1 Hz with 80 states is 2.3 GB, or 16 MB of
//! checkpoints. Lower triangles are packed by rows; numbers are kept as they are, so that all three give the same bits.

use super::model::Density;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

/// How filtered densities are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// All of them.
    Memory,
    /// Every s-th, and those of one segment between two of them.
    Checkpoints {
        /// s, at least 1.
        spacing: usize,
    },
    /// All of them, in a temporary file that vanishes with the process.
    File,
}

impl Storage {
    /// The first that fits `budget` bytes, for so many epochs of at most so many states.
    pub fn choose(epochs: usize, states: usize, budget: usize) -> Self {
        let spacing = epochs.isqrt().max(1);
        let bytes = |densities: usize| densities.saturating_mul(packed_len(states)).saturating_mul(size_of::<f64>());
        if bytes(epochs) <= budget {
            Self::Memory
        } else if bytes(epochs.div_ceil(spacing) + spacing) <= budget {
            Self::Checkpoints { spacing }
        } else {
            Self::File
        }
    }
}

/// Numbers of a packed density of n states.
const fn packed_len(n: usize) -> usize {
    n + n * (n + 1) / 2
}

/// A density, packed: mean, then the lower triangle by rows.
#[derive(Clone, Debug, Default)]
struct Packed {
    states: usize,
    numbers: Vec<f64>,
}

impl Packed {
    fn put(&mut self, density: &Density) {
        let n = density.dim();
        self.states = n;
        self.numbers.clear();
        self.numbers.reserve_exact(packed_len(n));
        self.numbers.extend_from_slice(&density.mean);
        for (i, row) in density.covariance.chunks_exact(n.max(1)).enumerate() {
            self.numbers.extend_from_slice(&row[..=i]);
        }
    }

    fn get(&self, density: &mut Density) {
        let n = self.states;
        density.resize(n);
        let (mean, mut triangle) = self.numbers.split_at(n);
        density.mean.copy_from_slice(mean);
        for (i, row) in density.covariance.chunks_exact_mut(n.max(1)).enumerate() {
            let (packed, rest) = triangle.split_at(i + 1);
            row[..=i].copy_from_slice(packed);
            triangle = rest;
        }
    }
}

/// Packed densities in a file, and where each begins.
#[derive(Debug)]
struct Spool {
    file: File,
    /// Of each epoch, the number of states and the place of its first byte.
    index: Vec<(usize, u64)>,
    packed: Packed,
    bytes: Vec<u8>,
}

impl Spool {
    fn new() -> io::Result<Self> {
        Ok(Self { file: tempfile::tempfile()?, index: Vec::new(), packed: Packed::default(), bytes: Vec::new() })
    }

    fn put(&mut self, k: usize, density: &Density) -> io::Result<()> {
        self.index.truncate(k);
        let len = |states| (packed_len(states) * size_of::<f64>()) as u64;
        let start = self.index.last().map_or(0, |&(states, start)| start + len(states));
        self.packed.put(density);
        self.bytes.clear();
        self.bytes.extend(self.packed.numbers.iter().flat_map(|number| number.to_le_bytes()));
        self.file.seek(SeekFrom::Start(start))?;
        self.file.write_all(&self.bytes)?;
        self.index.push((density.dim(), start));
        Ok(())
    }

    fn get(&mut self, k: usize, density: &mut Density) -> io::Result<()> {
        let &(states, start) = self.index.get(k).ok_or(io::ErrorKind::NotFound)?;
        self.bytes.resize(packed_len(states) * size_of::<f64>(), 0);
        self.file.seek(SeekFrom::Start(start))?;
        self.file.read_exact(&mut self.bytes)?;
        let (numbers, _) = self.bytes.as_chunks();
        self.packed.states = states;
        self.packed.numbers.clear();
        self.packed.numbers.extend(numbers.iter().map(|&number| f64::from_le_bytes(number)));
        self.packed.get(density);
        Ok(())
    }
}

/// The filtered densities of one pass.
#[derive(Debug)]
pub struct History {
    storage: Storage,
    /// All epochs, or the checkpoints.
    kept: Vec<Packed>,
    /// The epochs after one checkpoint up to the next, the first of them being the checkpoint itself.
    segment: Vec<Packed>,
    /// Epoch of `segment[0]` and the number of epochs it holds.
    held: (usize, usize),
    spool: Option<Spool>,
}

impl History {
    /// Empty.
    pub fn new(storage: Storage) -> io::Result<Self> {
        let spool = if storage == Storage::File { Some(Spool::new()?) } else { None };
        Ok(Self { storage, kept: Vec::new(), segment: Vec::new(), held: (0, 0), spool })
    }

    /// How it keeps them.
    pub fn storage(&self) -> Storage {
        self.storage
    }

    /// Keeps the density of epoch k. Epochs come one after the other, from 0 or from an epoch after a checkpoint.
    pub fn put(&mut self, k: usize, density: &Density) -> io::Result<()> {
        match self.storage {
            Storage::Memory => slot(&mut self.kept, k).put(density),
            Storage::File => {
                if let Some(spool) = &mut self.spool {
                    spool.put(k, density)?;
                }
            }
            Storage::Checkpoints { spacing } => {
                let (checkpoint, place) = (k / spacing, k % spacing);
                if place == 0 {
                    slot(&mut self.kept, checkpoint).put(density);
                }
                slot(&mut self.segment, place).put(density);
                self.held = (checkpoint * spacing, place + 1);
            }
        }
        Ok(())
    }

    /// Fetches the density of epoch k. If it was not kept, that of the checkpoint before it is fetched, whose epoch is
    /// returned: the epochs from there to k are to be filtered and put again.
    pub fn get(&mut self, k: usize, density: &mut Density) -> io::Result<usize> {
        let found = match self.storage {
            Storage::Memory => self.kept.get(k),
            Storage::File => {
                self.spool.as_mut().ok_or(io::ErrorKind::NotFound)?.get(k, density)?;
                return Ok(k);
            }
            Storage::Checkpoints { spacing } => {
                let (first, len) = self.held;
                let checkpoint = k / spacing;
                if (first..first + len).contains(&k) {
                    self.segment.get(k - first)
                } else if k == checkpoint * spacing {
                    self.kept.get(checkpoint)
                } else {
                    let packed = self.kept.get(checkpoint).ok_or(io::ErrorKind::NotFound)?;
                    packed.get(density);
                    slot(&mut self.segment, 0).put(density);
                    self.held = (checkpoint * spacing, 1);
                    return Ok(checkpoint * spacing);
                }
            }
        };
        found.ok_or(io::ErrorKind::NotFound)?.get(density);
        Ok(k)
    }
}

/// An element, made if need be.
fn slot(slots: &mut Vec<Packed>, index: usize) -> &mut Packed {
    if slots.len() <= index {
        slots.resize_with(index + 1, Packed::default);
    }
    &mut slots[index]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Epoch k has 1 + k mod 3 states, filled with numbers that name it; the upper triangle is noise.
    fn density(k: usize) -> Density {
        let n = 1 + k % 3;
        let mut density = Density::default();
        density.reset(n);
        density.mean.iter_mut().enumerate().for_each(|(i, mean)| *mean = (100 * k + i) as f64);
        for i in 0..n {
            for j in 0..n {
                density.covariance[i * n + j] = if j <= i { (k + 10 * i + j) as f64 / 7.0 } else { f64::NAN };
            }
        }
        density
    }

    fn assert_same(a: &Density, b: &Density) {
        assert_eq!(a.mean, b.mean);
        for i in 0..a.dim() {
            assert_eq!(a.covariance[i * a.dim()..][..=i], b.covariance[i * a.dim()..][..=i]);
        }
    }

    #[test]
    fn what_is_put_comes_back_whatever_the_storage() {
        for storage in [Storage::Memory, Storage::File, Storage::Checkpoints { spacing: 4 }] {
            let mut history = History::new(storage).unwrap();
            for pass in 0..2 {
                (0..23).for_each(|k| history.put(k, &density(k + pass)).unwrap());
                let mut got = Density::default();
                let mut again = 0;
                for k in (0..23).rev() {
                    let from = history.get(k, &mut got).unwrap();
                    assert_same(&got, &density(from + pass));
                    for j in from + 1..=k {
                        history.put(j, &density(j + pass)).unwrap();
                        again += 1;
                    }
                }
                // Five whole segments before the last one, of three epochs each beside the checkpoint.
                assert_eq!(again, if storage == Storage::Memory || storage == Storage::File { 0 } else { 15 });
            }
        }
    }

    #[test]
    fn the_budget_chooses() {
        // A density of 80 states has 3320 numbers, 26 560 bytes.
        assert_eq!(Storage::choose(10, 80, 265_600), Storage::Memory);
        assert_eq!(Storage::choose(86_400, 80, 1 << 29), Storage::Checkpoints { spacing: 293 });
        assert_eq!(Storage::choose(86_400, 80, 1 << 20), Storage::File);
        assert_eq!(Storage::choose(0, 0, 0), Storage::Memory);
    }

    #[test]
    fn an_epoch_that_was_never_put_is_an_error() {
        for storage in [Storage::Memory, Storage::File, Storage::Checkpoints { spacing: 4 }] {
            assert!(History::new(storage).unwrap().get(0, &mut Density::default()).is_err());
        }
    }
}
