//! A collection of objects that an importer refers to by handles, with insertion, search and removal in constant
//! time.

use std::mem::size_of;

/// Objects with their handles. A handle is a number, which the importer stores as a pointer. The number contains the
/// index of a slot and the generation of the slot, which counts the objects that have been removed from it. So the
/// handle of a removed object stays invalid, until the bits of the generation overflow. Handles of different
/// collections differ, because each is combined with the address of an allocation that belongs to its collection.
#[derive(Debug)]
pub(super) struct Handles<V> {
    slots: Vec<Slot<V>>,
    /// First of the empty slots, which form a linked list, because removing must not need memory.
    empty: Option<u32>,
    identity: Option<Box<u8>>,
}

#[derive(Debug)]
struct Slot<V> {
    generation: usize,
    value: Option<V>,
    /// The next empty slot, if this one is empty.
    next_empty: Option<u32>,
}

/// Number of bits of a handle that contain the index. The other bits contain the generation.
const INDEX_BITS: u32 = if size_of::<usize>() < 8 { 20 } else { 32 };
const INDEX_MASK: usize = (1 << INDEX_BITS) - 1;

/// A number that is never a handle.
pub(super) const NULL: usize = 0;

impl<V> Handles<V> {
    pub const fn new() -> Self {
        Self { slots: Vec::new(), empty: None, identity: None }
    }

    /// Returns a number with which all handles of this collection are combined. The numbers of two collections differ
    /// in most bits.
    fn secret(&self) -> usize {
        let address = self.identity.as_deref().map_or(NULL, |identity| (&raw const *identity).addr());
        // Fibonacci hashing spreads the address over the upper bits, and the rotation moves these bits to the index.
        address.wrapping_mul(0x9e37_79b9_7f4a_7c15_u64 as usize | 1).rotate_right(INDEX_BITS)
    }

    fn slot(&mut self, handle: usize) -> Option<(u32, &mut Slot<V>)> {
        let word = handle ^ self.secret();
        let index = word & INDEX_MASK;
        let slot = self.slots.get_mut(index)?;
        (slot.generation == word >> INDEX_BITS && handle != NULL).then_some((index as u32, slot))
    }

    pub fn get_mut(&mut self, handle: usize) -> Option<&mut V> {
        self.slot(handle)?.1.value.as_mut()
    }

    /// Inserts an object and returns its handle; `None` if there are more objects than a handle has indices, or too little
    /// memory.
    pub fn insert(&mut self, value: V) -> Option<usize> {
        self.identity.get_or_insert_with(|| Box::new(0));
        let index = match self.empty {
            Some(index) => index as usize,
            None if self.slots.len() <= INDEX_MASK => {
                self.slots.try_reserve(1).ok()?;
                self.slots.push(Slot { generation: 0, value: None, next_empty: None });
                self.slots.len() - 1
            }
            None => return None,
        };
        let secret = self.secret();
        let slot = &mut self.slots[index];
        slot.value = Some(value);
        self.empty = slot.next_empty;
        let handle = |generation: usize| (generation << INDEX_BITS | index) ^ secret;
        if handle(slot.generation) == NULL {
            slot.generation = next(slot.generation);
        }
        Some(handle(slot.generation))
    }

    pub fn remove(&mut self, handle: usize) -> Option<V> {
        let next_empty = self.empty;
        let (index, slot) = self.slot(handle)?;
        let value = slot.value.take()?;
        slot.generation = next(slot.generation);
        slot.next_empty = next_empty;
        self.empty = Some(index);
        Some(value)
    }

    /// Removes any object and returns it, to empty the collection. No handle may be used afterwards.
    pub fn pop(&mut self) -> Option<V> {
        while let Some(slot) = self.slots.pop() {
            self.empty = None;
            if slot.value.is_some() {
                return slot.value;
            }
        }
        None
    }
}

fn next(generation: usize) -> usize {
    (generation + 1) & (usize::MAX >> INDEX_BITS)
}

#[cfg(test)]
mod tests {
    use super::{Handles, NULL};
    use std::collections::BTreeMap;

    #[test]
    fn it_is_a_map_whose_keys_are_not_reused() {
        let (mut handles, mut map, mut removed) = (Handles::new(), BTreeMap::new(), Vec::new());
        let mut other = Handles::new();
        for step in 0_u32..4000 {
            let random = step.wrapping_mul(2_654_435_761) >> 8;
            if random % 5 < 2
                && let Some(handle) = map.keys().nth(random as usize % map.len().max(1)).copied()
            {
                assert_eq!(handles.remove(handle), map.remove(&handle));
                removed.push(handle);
            } else {
                let handle = handles.insert(step).unwrap();
                assert!(handle != NULL && map.insert(handle, step).is_none() && !removed.contains(&handle));
                let foreign = other.insert(step).unwrap();
                assert_eq!(handles.get_mut(foreign), None);
            }
            for (handle, value) in map.iter().take(10) {
                assert_eq!(handles.get_mut(*handle).copied(), Some(*value));
            }
            assert!(removed.iter().rev().take(20).all(|handle| handles.get_mut(*handle).is_none()));
            assert_eq!(handles.get_mut(NULL), None);
        }
        assert!(removed.len() > 1000 && removed.iter().all(|handle| handles.remove(*handle).is_none()));
        let mut rest: Vec<_> = std::iter::from_fn(|| handles.pop()).collect();
        rest.sort_unstable();
        assert!(rest.into_iter().eq(map.into_values().collect::<std::collections::BTreeSet<_>>()));
        assert_eq!(handles.pop(), None);
    }
}
