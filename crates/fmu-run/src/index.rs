//! A hash table that finds items by name and does not copy the names.

use hashbrown::HashTable;
use std::hash::{BuildHasher, RandomState};

/// Indices of items by name. If several items have the same name, the last one is found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Index {
    hasher: RandomState,
    table: HashTable<u32>,
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
        for (index, name) in all.iter().enumerate() {
            // There are fewer than 2^32 names, because the memory for reading a model description is limited.
            let own = index as u32;
            let hash = |index: &u32| hasher.hash_one(all[*index as usize]);
            let same = |index: &u32| all[*index as usize] == *name;
            match table.find_mut(hasher.hash_one(name), same) {
                Some(before) => *before = own,
                None => _ = table.insert_unique(hasher.hash_one(name), own, hash),
            }
        }
        Self { hasher, table }
    }

    /// Returns the index of the item with this name; `name_of` returns the name of an item.
    pub fn find<'a>(&self, name: &str, name_of: impl Fn(usize) -> &'a str) -> Option<usize> {
        let same = |index: &u32| name_of(*index as usize) == name;
        self.table.find(self.hasher.hash_one(name), same).map(|index| *index as usize)
    }
}
