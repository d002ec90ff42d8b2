//! Serialized states: saved states as bytes, with a version and a checksum.

use super::origin::Origin;
use super::values::check_value;
use super::{Outcome, State, reject};
use crate::export::Exported;
use crate::hash::{EMPTY, fnv1a};
use crate::model::Experiment;
use crate::saved::{Saved, StateVisitor};
use crate::settable::ALL_MODES;
use crate::stamp::stamp;
use fmi_abi::Mode;

impl<M: Exported> State<M> {
    /// Visits all fields, except `stale` and `started`, which [`read`] sets.
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut mode = i64::from(self.mode as u32);
        visitor.integer(&mut mode);
        match Mode::from_number(mode) {
            Some(mode) => self.mode = mode,
            None => visitor.invalid(),
        }
        self.ended.visit(visitor);
        self.time.visit(visitor);
        self.experiment.start_time.visit(visitor);
        self.experiment.stop_time.visit(visitor);
        self.experiment.tolerance.visit(visitor);
        self.model.visit_state(visitor);
    }
}

/// First bytes of every serialized state. The last digit is the version of the layout.
const MAGIC: &[u8; 8] = b"fmustat2";
/// Length of the magic, a hash of the guid, and a byte for FMI version and interface type.
const HEADER_LENGTH: usize = 8 + 8 + 1;
const CHECKSUM_LENGTH: usize = 8;

/// Returns the number of bytes of a serialized state. Does not change `state`, although a visitor needs a mutable
/// reference.
pub(super) fn size<M: Exported>(state: &mut State<M>) -> usize {
    let mut counter = Writer::default();
    state.visit(&mut counter);
    HEADER_LENGTH + counter.count + CHECKSUM_LENGTH
}

/// Serializes a state into `bytes`, which must have the length from [`size`]. Rejects a state with values that [`read`]
/// would reject.
pub(super) fn write<M: Exported>(state: &mut State<M>, origin: Origin, bytes: &mut [u8]) -> Outcome {
    check(state)?;
    let (content, checksum) = bytes.split_at_mut(bytes.len() - CHECKSUM_LENGTH);
    let mut writer = Writer { rest: Some(&mut *content), count: 0 };
    writer.put(MAGIC);
    writer.put(&guid_hash::<M>());
    writer.put(&[origin.byte()]);
    state.visit(&mut writer);
    checksum.copy_from_slice(&fnv1a(EMPTY, content).to_le_bytes());
    Ok(())
}

/// Reads a state from untrusted bytes into `state`, which may be any state of the model. After an error, `state` may
/// be partly overwritten.
pub(super) fn read<M: Exported>(bytes: &[u8], origin: Origin, state: &mut State<M>) -> Outcome {
    let version = MAGIC.len() - 1;
    if bytes.len() < MAGIC.len() || bytes[..version] != MAGIC[..version] {
        return reject("the bytes are not a saved state of an FMU of this kind");
    }
    if bytes[version] != MAGIC[version] {
        return reject("the saved state has another version of the layout; save it again with this FMU");
    }
    if bytes.len() < HEADER_LENGTH + CHECKSUM_LENGTH {
        return reject("the saved state is truncated");
    }
    if bytes[8..16] != guid_hash::<M>() {
        return reject("the saved state comes from another FMU (its guid differs)");
    }
    // The checksum follows the content. Because the content shows where it ends, no byte behind that is read.
    let mut reader = Reader { rest: &bytes[HEADER_LENGTH..], valid: true };
    state.visit(&mut reader);
    let (rest, valid) = (reader.rest, reader.valid);
    let content = &bytes[..bytes.len() - rest.len()];
    if valid && (rest.len() != CHECKSUM_LENGTH || fnv1a(EMPTY, content).to_le_bytes() != *rest) {
        return reject("the saved state is damaged or has the wrong length (its checksum is wrong)");
    }
    let Some(from) = Origin::from_byte(content[16]) else {
        return reject("the saved state contains impossible values");
    };
    from.check(origin)?;
    if !valid {
        return reject("the saved state is damaged, has the wrong length or contains impossible values");
    }
    if !ALL_MODES.contains(origin.0, origin.1, state.mode) {
        return reject("the saved state contains impossible values");
    }
    check(state)?;
    state.model.restored()?;
    state.model.update()?;
    (state.stale, state.started) = (true, false);
    Ok(())
}

/// Checks that the variables with start values have valid values, and that the times and the tolerance are finite. The
/// model must check its `memory` itself.
fn check<M: Exported>(state: &State<M>) -> Outcome {
    let Experiment { start_time, stop_time, tolerance } = state.experiment;
    let times = [Some(state.time), Some(start_time), stop_time, tolerance];
    if !times.into_iter().flatten().all(f64::is_finite) {
        return reject("the saved state contains impossible values");
    }
    for variable in M::TABLE.iter().filter(|variable| variable.has_start()) {
        if let Some(value) = variable.value(&state.model) {
            check_value(variable, &value)?;
        }
    }
    Ok(())
}

/// Identifies the FMU. Depends on the table as well, because all libraries that are not packed have the same guid.
fn guid_hash<M: Exported>() -> [u8; 8] {
    let stamp = stamp::<M>();
    fnv1a(fnv1a(EMPTY, stamp.interface()), stamp.guid_bytes()).to_le_bytes()
}

/// Writes a state to `rest`, or only counts its bytes if there is no `rest`.
#[derive(Default)]
struct Writer<'a> {
    rest: Option<&'a mut [u8]>,
    count: usize,
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) {
        self.count += bytes.len();
        if let Some(rest) = self.rest.take() {
            let (head, rest) = rest.split_at_mut(bytes.len());
            head.copy_from_slice(bytes);
            self.rest = Some(rest);
        }
    }
}

impl StateVisitor for Writer<'_> {
    fn real(&mut self, value: &mut f64) {
        self.put(&value.to_bits().to_le_bytes());
    }
    fn integer(&mut self, value: &mut i64) {
        self.put(&value.to_le_bytes());
    }
    fn boolean(&mut self, value: &mut bool) {
        self.put(&[u8::from(*value)]);
    }
    fn string(&mut self, value: &mut String) {
        self.length(&mut value.len());
        self.put(value.as_bytes());
    }
    fn length(&mut self, length: &mut usize) {
        self.put(&(*length as u64).to_le_bytes());
    }
    fn invalid(&mut self) {}
}

/// Reads a state from the bytes in `rest`. `valid` becomes false at the first fault.
struct Reader<'a> {
    rest: &'a [u8],
    valid: bool,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let Some((head, rest)) = self.rest.split_first_chunk::<N>() else {
            self.invalid();
            return [0; N];
        };
        self.rest = rest;
        *head
    }
}

impl StateVisitor for Reader<'_> {
    fn real(&mut self, value: &mut f64) {
        *value = f64::from_bits(u64::from_le_bytes(self.take()));
    }
    fn integer(&mut self, value: &mut i64) {
        *value = i64::from_le_bytes(self.take());
    }
    fn boolean(&mut self, value: &mut bool) {
        let [byte] = self.take();
        self.valid &= byte <= 1;
        *value = byte == 1;
    }
    fn string(&mut self, value: &mut String) {
        let length = u64::from_le_bytes(self.take());
        let bytes = usize::try_from(length).ok().and_then(|length| self.rest.split_at_checked(length));
        match bytes.and_then(|(bytes, rest)| Some((std::str::from_utf8(bytes).ok()?, rest))) {
            Some((read, rest)) => {
                read.clone_into(value);
                self.rest = rest;
            }
            None => self.invalid(),
        }
    }
    fn length(&mut self, length: &mut usize) {
        let claimed = u64::from_le_bytes(self.take());
        *length = match usize::try_from(claimed) {
            Ok(length) if length <= self.rest.len() => length,
            _ => {
                self.invalid();
                0
            }
        };
    }
    fn invalid(&mut self) {
        self.valid = false;
    }
    fn continues(&self) -> bool {
        self.valid
    }
}

#[cfg(test)]
mod tests {
    use super::{Reader, Writer};
    use crate::saved::Saved;
    use std::collections::{BTreeMap, VecDeque};

    fn written<T: Saved>(mut value: T) -> Vec<u8> {
        let mut counter = Writer::default();
        value.visit(&mut counter);
        let mut bytes = vec![0; counter.count];
        value.visit(&mut Writer { rest: Some(&mut bytes), count: 0 });
        bytes
    }

    /// Returns the value that the bytes contain; `None` if they are invalid or too many.
    fn read<T: Saved + Default>(bytes: &[u8]) -> Option<T> {
        let mut value = T::default();
        let mut reader = Reader { rest: bytes, valid: true };
        value.visit(&mut reader);
        (reader.valid && reader.rest.is_empty()).then_some(value)
    }

    #[track_caller]
    fn round_trip<T: Saved + Default + Clone + PartialEq + std::fmt::Debug>(value: T) {
        let bytes = written(value.clone());
        assert_eq!(read(&bytes), Some(value));
        assert!(
            (0..bytes.len()).all(|length| read::<T>(&bytes[..length]).is_none()),
            "missing bytes must be detected"
        );
    }

    #[test]
    fn every_type_is_read_as_written() {
        round_trip(-0.25);
        round_trip([f64::MIN_POSITIVE, f64::INFINITY]);
        round_trip([f32::MAX, f32::NEG_INFINITY]);
        assert!(
            read::<(f64, f32)>(&written((f64::NAN, f32::NAN))).is_some_and(|(a, b)| a.is_nan() && b.is_nan())
        );
        assert_eq!(read::<f32>(&written(f64::MAX)), None);
        round_trip(true);
        round_trip("Gödel".to_owned());
        round_trip([i8::MIN, -1, i8::MAX]);
        round_trip([u32::MAX, 0]);
        round_trip(i64::MIN);
        round_trip((7_u8, Some(-3_i16)));
        round_trip([usize::MAX, 0]);
        round_trip((isize::MIN, Box::new(2.5), "c".to_owned()));
        round_trip((1_u8, (2_u8, 3_u8), false, 4.0));
        round_trip(VecDeque::from([1.5, -2.0, 0.25]));
        round_trip(BTreeMap::from([(-3, vec![true]), (7, vec![])]));
        round_trip([None, Some(2.5)]);
        round_trip(vec![vec![String::new(), "a".to_owned()], vec![], vec!["bc".to_owned()]]);
    }

    #[test]
    fn impossible_bytes_are_invalid() {
        assert_eq!(read::<bool>(&[2]), None);
        assert_eq!(read::<u8>(&written(256_i32)), None);
        assert_eq!(read::<u32>(&written(-1_i64)), None);
        assert_eq!(read::<i32>(&written(i64::MAX)), None);
        for wrong in [[(2, 1.0), (1, 1.0)], [(1, 1.0), (1, 2.0)]] {
            assert_eq!(read::<BTreeMap<i32, f64>>(&written(wrong.to_vec())), None);
        }
        assert_eq!(read::<String>(&[written(1_i64), vec![0xff]].concat()), None);
        for length in [1, 2, 1 << 40, i64::MAX, -1] {
            assert_eq!(read::<Vec<f64>>(&written(length)), None);
            assert_eq!(read::<VecDeque<f64>>(&written(length)), None);
            assert_eq!(read::<BTreeMap<i32, f64>>(&written(length)), None);
            assert_eq!(
                read::<Vec<Vec<f64>>>(&[written(2_i64), written(length), written(length)].concat()),
                None
            );
        }
    }

    /// Reads a long vector, and checks that a false length creates at most one element without bytes.
    #[test]
    fn long_vectors() {
        let value = vec![true; (1 << 20) + 1];
        assert_eq!(read(&written(value.clone())), Some(value));

        let mut bytes = written(1_i64 << 20);
        bytes.resize(8 + (1 << 20), 0);
        let mut large = Vec::<[f64; 32]>::new();
        large.visit(&mut Reader { rest: &bytes, valid: true });
        assert_eq!(large.len(), (1 << 20) / 256 + 1);
    }
}
