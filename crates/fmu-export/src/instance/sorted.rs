//! A map for few entries. It replaces a `BTreeMap`, whose code is ten times as large and would be in every library.

/// A map as a list of entries, sorted by key.
#[derive(Clone, Debug)]
pub(super) struct Sorted<K, V>(Vec<(K, V)>);

impl<K: Ord + Copy, V> Sorted<K, V> {
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    fn index(&self, key: K) -> Result<usize, usize> {
        self.0.binary_search_by_key(&key, |(key, _)| *key)
    }

    /// Inserts a value, or replaces the value that the key has.
    pub fn insert(&mut self, key: K, value: V) {
        match self.index(key) {
            Ok(index) => self.0[index].1 = value,
            Err(index) => self.0.insert(index, (key, value)),
        }
    }

    pub fn remove(&mut self, key: K) -> Option<V> {
        let index = self.index(key).ok()?;
        Some(self.0.remove(index).1)
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }

    pub fn values(&self) -> impl Iterator<Item = &V> {
        self.0.iter().map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::Sorted;
    use std::collections::BTreeMap;

    #[test]
    fn it_is_a_map() {
        let (mut sorted, mut map) = (Sorted::new(), BTreeMap::new());
        for step in 0_u32..400 {
            let key = step.wrapping_mul(2_654_435_761) % 37;
            if step % 3 == 0 {
                assert_eq!(sorted.remove(key), map.remove(&key));
            } else {
                sorted.insert(key, step);
                map.insert(key, step);
            }
            assert!(sorted.values().eq(map.values()));
        }
        sorted.clear();
        assert_eq!(sorted.values().count(), 0);
    }
}
