//! Consistent overhead byte stuffing: an encoding without zero bytes, one byte longer per 254 bytes begun.
//!
//! Cheshire and Baker (1999), "Consistent Overhead Byte Stuffing", IEEE/ACM Trans. Networking 7(2), section III: a code
//! byte `n` < 255 stands for `n − 1` bytes that follow and a zero; `n` = 255 for 254 bytes that follow and no zero. The
//! zero of the last group is implied.
//!
//! Written out rather than taken from the `cobs` crate (the tests compare with it), whose slice indexing leaves panic
//! branches in firmware. Panic contract: none.

/// Encodes byte by byte into a borrowed buffer.
pub(super) struct Encoder<'a> {
    out: &'a mut [u8],
    /// Bytes of `out` in use.
    length: usize,
    /// Where the code byte of the open group will go.
    code_at: usize,
}

/// The buffer is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Full;

impl<'a> Encoder<'a> {
    /// Starts behind the delimiter that it puts into `out`.
    pub fn new(out: &'a mut [u8]) -> Result<Self, Full> {
        let mut encoder = Self { out, length: 0, code_at: 1 };
        encoder.put(0)?;
        encoder.put(0)?;
        Ok(encoder)
    }

    /// Appends one byte of the message.
    pub fn push(&mut self, byte: u8) -> Result<(), Full> {
        if self.group_length() == 254 {
            self.close_group(0xff)?;
        }
        if byte == 0 { self.close_group(self.group_length() as u8 + 1) } else { self.put(byte) }
    }

    /// Ends the message with a delimiter; the number of bytes in the buffer.
    pub fn finish(mut self) -> Result<usize, Full> {
        let code = self.group_length() as u8 + 1;
        if let Some(slot) = self.out.get_mut(self.code_at) {
            *slot = code;
        }
        self.put(0)?;
        Ok(self.length)
    }

    /// Bytes in the open group, 0…254.
    fn group_length(&self) -> usize {
        self.length - self.code_at - 1
    }

    fn close_group(&mut self, code: u8) -> Result<(), Full> {
        if let Some(slot) = self.out.get_mut(self.code_at) {
            *slot = code;
        }
        self.code_at = self.length;
        self.put(0)
    }

    fn put(&mut self, byte: u8) -> Result<(), Full> {
        *self.out.get_mut(self.length).ok_or(Full)? = byte;
        self.length += 1;
        Ok(())
    }
}

/// Decodes a message without delimiters in place; `None` if it is not well formed.
pub(super) fn decode(buffer: &mut [u8]) -> Option<&[u8]> {
    let (mut from, mut to) = (0, 0);
    while from < buffer.len() {
        let code = *buffer.get(from)?;
        let end = from + usize::from(code);
        if code == 0 || end > buffer.len() {
            return None;
        }
        for i in from + 1..end {
            *buffer.get_mut(to)? = *buffer.get(i)?;
            to += 1;
        }
        from = end;
        if code != 0xff && from < buffer.len() {
            *buffer.get_mut(to)? = 0;
            to += 1;
        }
    }
    buffer.get(..to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encode(message: &[u8]) -> Vec<u8> {
        let mut out = vec![0xaa; message.len() + message.len() / 254 + 4];
        let mut encoder = Encoder::new(&mut out).unwrap();
        message.iter().for_each(|&byte| encoder.push(byte).unwrap());
        let length = encoder.finish().unwrap();
        out.truncate(length);
        out
    }

    /// Examples of the Wikipedia article "Consistent Overhead Byte Stuffing" (2024), rows 1, 4 and 5.
    #[test]
    fn published_examples() {
        assert_eq!(encode(&[0]), [0, 1, 1, 0]);
        assert_eq!(encode(&[0x11, 0x22, 0x00, 0x33]), [0, 3, 0x11, 0x22, 2, 0x33, 0]);
        assert_eq!(encode(&[0x11, 0, 0, 0]), [0, 2, 0x11, 1, 1, 1, 0]);
    }

    #[test]
    fn a_full_buffer_is_an_error() {
        for room in 0..7 {
            let mut out = [0; 7];
            let written = Encoder::new(&mut out[..room]).and_then(|mut encoder| {
                encoder.push(7)?;
                encoder.push(0)?;
                encoder.finish()
            });
            assert_eq!(written, if room < 5 { Err(Full) } else { Ok(5) }); // 00 02 07 01 00
        }
    }

    proptest! {
        /// Runs of non-zero bytes around 254 are the difficult case.
        #[test]
        fn agrees_with_the_cobs_crate_and_comes_back(
            runs in prop::collection::vec((250usize..258, 0usize..3), 0..4),
            tail in prop::collection::vec(any::<u8>(), 0..20),
        ) {
            let mut message = Vec::new();
            for (length, zeros) in runs {
                message.extend((0..length).map(|i| (i % 255 + 1) as u8));
                message.extend(vec![0; zeros]);
            }
            message.extend(tail);
            let encoded = encode(&message);
            let mut peer = vec![0; message.len() + 8];
            let length = cobs::encode(&message, &mut peer);
            prop_assert_eq!(cobs::decode(&encoded[1..encoded.len() - 1], &mut peer.clone()).unwrap(), message.len());
            prop_assert!(encoded.len() <= length + 3);
            let mut inner = peer[..length].to_vec();
            prop_assert_eq!(decode(&mut inner), Some(&message[..]));
            let mut inner = encoded[1..encoded.len() - 1].to_vec();
            prop_assert!(!inner.contains(&0));
            prop_assert_eq!(decode(&mut inner), Some(&message[..]));
        }

        #[test]
        fn any_bytes_decode_or_are_refused(mut bytes in prop::collection::vec(any::<u8>(), 0..600)) {
            let longest = bytes.len();
            if let Some(message) = decode(&mut bytes) {
                prop_assert!(message.len() <= longest);
            }
        }
    }
}
