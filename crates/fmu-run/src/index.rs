//! A hash table that finds items by name and does not copy the names.

use hashbrown::HashTable;
use std::collections::BTreeSet;
use std::hash::{BuildHasher, RandomState};

/// Indices of items by name. If several items have the same name, none of them is found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Index {
    hasher: RandomState,
    table: HashTable<u32>,
    /// Those items in the table whose names others have, too.
    shared: BTreeSet<u32>,
}

/// Any two tables are equal, because the owner of a table also compares the names, and these determine the content of the table.
impl PartialEq for Index {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Index {
    pub fn of<'a>(names: impl ExactSizeIterator<Item = &'a str> + Clone) -> Self {
        let hasher = RandomState::new();
        let all: Vec<&str> = names.collect();
        let mut table: HashTable<u32> = HashTable::with_capacity(all.len());
        let mut shared = BTreeSet::new();
        for (index, name) in all.iter().enumerate() {
            // There are fewer than 2^32 names, because the memory for reading a model description is limited.
            let own = index as u32;
            let hash = |index: &u32| hasher.hash_one(all[*index as usize]);
            let same = |index: &u32| all[*index as usize] == *name;
            match table.find(hasher.hash_one(name), same) {
                Some(before) => _ = shared.insert(*before),
                None => _ = table.insert_unique(hasher.hash_one(name), own, hash),
            }
        }
        Self { hasher, table, shared }
    }

    /// Returns the index of the only item with this name; `name_of` returns the name of an item.
    pub fn find<'a>(&self, name: &str, name_of: impl Fn(usize) -> &'a str) -> Option<usize> {
        self.first(name, name_of).filter(|index| !self.shared.contains(index)).map(|index| index as usize)
    }

    /// Returns whether several items have this name.
    pub fn is_shared<'a>(&self, name: &str, name_of: impl Fn(usize) -> &'a str) -> bool {
        self.first(name, name_of).is_some_and(|index| self.shared.contains(&index))
    }

    fn first<'a>(&self, name: &str, name_of: impl Fn(usize) -> &'a str) -> Option<u32> {
        let same = |index: &u32| name_of(*index as usize) == name;
        self.table.find(self.hasher.hash_one(name), same).copied()
    }
}
