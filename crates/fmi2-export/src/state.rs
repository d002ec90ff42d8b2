//! Saved states (section 2.1.8): a copy in memory, and the same as bytes with version and checksum.

use crate::call_table::{Interface, Mode};
use crate::description::ModelInfo;
use crate::model::Model;

/// Sees every value of a model's state in turn; writes it or replaces it.
pub trait StateVisitor {
    /// A floating-point value.
    fn real(&mut self, value: &mut f64);
    /// An integer value.
    fn integer(&mut self, value: &mut i32);
    /// A truth value.
    fn boolean(&mut self, value: &mut bool);

    /// A value that may be missing.
    fn optional_real(&mut self, value: &mut Option<f64>) {
        let (mut present, mut number) = (value.is_some(), value.unwrap_or(0.0));
        self.boolean(&mut present);
        self.real(&mut number);
        *value = present.then_some(number);
    }
}

/// Everything about an instance that a saved state brings back.
pub(crate) struct InstanceState<M> {
    pub mode: Mode,
    pub time: f64,
    pub start_time: f64,
    pub stop_time: Option<f64>,
    pub model: M,
}

impl<M: Clone> Clone for InstanceState<M> {
    fn clone(&self) -> Self {
        Self { model: self.model.clone(), ..*self }
    }

    /// Passes on to the model, which may have a way to clone into what is there already.
    fn clone_from(&mut self, source: &Self) {
        let Self { mode, time, start_time, stop_time, model } = source;
        (self.mode, self.time, self.start_time, self.stop_time) = (*mode, *time, *start_time, *stop_time);
        self.model.clone_from(model);
    }
}

impl<M: Model> InstanceState<M> {
    /// The state after `fmi2Instantiate` and `fmi2Reset`.
    pub fn new(interface: Interface) -> Self {
        Self {
            mode: Mode::Instantiated,
            time: 0.0,
            start_time: 0.0,
            stop_time: None,
            model: M::new(interface),
        }
    }

    fn visit(&mut self, visitor: &mut impl StateVisitor) {
        // A number that is no mode becomes Fatal, which no saved state can have.
        let mut mode = self.mode as i32;
        visitor.integer(&mut mode);
        self.mode = u16::try_from(mode).ok().and_then(Mode::from_bits).unwrap_or(Mode::Fatal);
        visitor.real(&mut self.time);
        visitor.real(&mut self.start_time);
        visitor.optional_real(&mut self.stop_time);
        self.model.visit_state(visitor);
    }
}

/// Begins every serialized state; the last digit is the version of the layout.
const MAGIC: &[u8; 8] = b"fmi2st-1";
/// The magic, a hash of the guid, the interface type.
const HEADER_LENGTH: usize = 8 + 8 + 1;
const CHECKSUM_LENGTH: usize = 8;

/// The number of bytes of a serialized state.
pub(crate) fn serialized_size<M: Model>(state: &InstanceState<M>) -> usize {
    let mut counter = Counter(0);
    state.clone().visit(&mut counter);
    HEADER_LENGTH + counter.0 + CHECKSUM_LENGTH
}

/// Fills `bytes`, which must have the length that [`serialized_size`] tells.
pub(crate) fn serialize<M: Model>(state: &InstanceState<M>, interface: Interface, bytes: &mut [u8]) {
    let (content, checksum) = bytes.split_at_mut(bytes.len() - CHECKSUM_LENGTH);
    let mut writer = Writer { rest: &mut *content };
    writer.put(MAGIC);
    writer.put(&guid_hash(&M::INFO));
    writer.put(&[interface as u8]);
    state.clone().visit(&mut writer);
    checksum.copy_from_slice(&fnv1a(content).to_le_bytes());
}

/// Rebuilds a state from bytes that may come from anywhere.
pub(crate) fn deserialize<M: Model>(
    bytes: &[u8],
    interface: Interface,
    template: &InstanceState<M>,
) -> Result<InstanceState<M>, &'static str> {
    if bytes.len() < MAGIC.len() || bytes[..7] != MAGIC[..7] {
        return Err("the bytes are no saved state of an FMU of this kind");
    }
    if bytes[7] != MAGIC[7] {
        return Err("the saved state has another version of the layout; save it again with this FMU");
    }
    if bytes.len() < HEADER_LENGTH + CHECKSUM_LENGTH {
        return Err("the saved state is cut short");
    }
    if bytes[8..16] != guid_hash(&M::INFO) {
        return Err("the saved state comes from another FMU (its guid differs)");
    }
    if bytes.len() != serialized_size(template) {
        return Err("the saved state has the wrong length");
    }
    let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM_LENGTH);
    if fnv1a(content).to_le_bytes() != *checksum {
        return Err("the saved state is damaged (its checksum is wrong)");
    }
    if content[16] != interface as u8 {
        return Err("the saved state comes from the other interface type (Co-Simulation or Model Exchange)");
    }
    let mut reader = Reader { rest: &content[HEADER_LENGTH..], valid: true };
    let mut state = template.clone();
    state.visit(&mut reader);
    if !reader.valid || !interface.has(state.mode) {
        return Err("the saved state holds impossible values");
    }
    Ok(state)
}

fn guid_hash(info: &ModelInfo) -> [u8; 8] {
    fnv1a(info.guid.as_bytes()).to_le_bytes()
}

/// FNV-1a: every step is a bijection of the running value, so no single changed byte goes unseen.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

struct Counter(usize);

impl StateVisitor for Counter {
    fn real(&mut self, _: &mut f64) {
        self.0 += 8;
    }
    fn integer(&mut self, _: &mut i32) {
        self.0 += 4;
    }
    fn boolean(&mut self, _: &mut bool) {
        self.0 += 1;
    }
}

struct Writer<'a> {
    rest: &'a mut [u8],
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) {
        let (head, rest) = std::mem::take(&mut self.rest).split_at_mut(bytes.len());
        head.copy_from_slice(bytes);
        self.rest = rest;
    }
}

impl StateVisitor for Writer<'_> {
    fn real(&mut self, value: &mut f64) {
        self.put(&value.to_bits().to_le_bytes());
    }
    fn integer(&mut self, value: &mut i32) {
        self.put(&value.to_le_bytes());
    }
    fn boolean(&mut self, value: &mut bool) {
        self.put(&[u8::from(*value)]);
    }
}

struct Reader<'a> {
    rest: &'a [u8],
    valid: bool,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        match self.rest.split_first_chunk::<N>() {
            Some((head, rest)) => {
                self.rest = rest;
                *head
            }
            None => {
                self.valid = false;
                [0; N]
            }
        }
    }
}

impl StateVisitor for Reader<'_> {
    fn real(&mut self, value: &mut f64) {
        *value = f64::from_bits(u64::from_le_bytes(self.take()));
        self.valid &= value.is_finite();
    }
    fn integer(&mut self, value: &mut i32) {
        *value = i32::from_le_bytes(self.take());
    }
    fn boolean(&mut self, value: &mut bool) {
        let [byte] = self.take();
        self.valid &= byte <= 1;
        *value = byte == 1;
    }
}
