//! Arrays that end at a guard page, so that an access beyond the end crashes. A write before the beginning is detected after the
//! call.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};

/// Number of accessible bytes after an array: 0 if an access beyond the array should crash, more if a write should be detected.
pub static AFTER: AtomicUsize = AtomicUsize::new(0);

/// Whether freed arrays remain mapped for reuse, because mapping takes time in repetitions and makes threads wait for each other.
pub static KEEP: AtomicBool = AtomicBool::new(false);

/// Byte that fills memory before a call.
pub const FILL: u8 = 0x5a;

/// Block of `FILL` bytes for comparisons.
static FILLED: [u8; 4096] = [FILL; 4096];

/// Returns the number of calls into the FMU that have not returned, in memory that a forked process shares with its parent.
pub fn calls_in_progress() -> &'static AtomicU32 {
    static COUNT: OnceLock<&AtomicU32> = OnceLock::new();
    COUNT.get_or_init(|| {
        #[cfg(unix)]
        // SAFETY: new memory, which is zero and is never unmapped.
        unsafe {
            let (access, flags) = (libc::PROT_READ | libc::PROT_WRITE, libc::MAP_SHARED | libc::MAP_ANON);
            let map = libc::mmap(std::ptr::null_mut(), 4, access, flags, -1, 0);
            assert!(map != libc::MAP_FAILED, "no memory");
            &*map.cast::<AtomicU32>()
        }
        #[cfg(not(unix))]
        Box::leak(Box::default())
    })
}

/// Runs code of the FMU, and counts it in `calls_in_progress` until it returns.
pub fn in_fmu<T>(run: impl FnOnce() -> T) -> T {
    calls_in_progress().fetch_add(1, Ordering::Relaxed);
    let result = run();
    calls_in_progress().fetch_sub(1, Ordering::Relaxed);
    result
}

fn is_filled(bytes: &[u8]) -> bool {
    bytes.chunks(FILLED.len()).all(|part| *part == FILLED[..part.len()])
}

#[cfg(unix)]
mod pages {
    use super::{AFTER, KEEP, Ordering};
    use std::ptr::null_mut;
    use std::sync::{Mutex, PoisonError};

    /// Lengths and addresses of freed pages that can be used again.
    static KEPT: Mutex<Vec<(usize, usize)>> = Mutex::new(Vec::new());

    /// Mapped pages, the last of which is a guard page.
    pub struct Pages {
        map: *mut u8,
        length: usize,
    }

    fn page() -> usize {
        // SAFETY: only returns a number.
        usize::try_from(unsafe { libc::sysconf(libc::_SC_PAGESIZE) }).unwrap_or(4096)
    }

    impl Pages {
        pub fn new(size: usize) -> Self {
            let page = page();
            let length = (size.div_ceil(page) + 1) * page;
            let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(index) = kept.iter().position(|(other, _)| *other == length) {
                return Self { map: kept.swap_remove(index).1 as *mut u8, length };
            }
            // SAFETY: new memory, the last page of which becomes inaccessible.
            let map = unsafe {
                let map = libc::mmap(
                    null_mut(),
                    length,
                    libc::PROT_READ | libc::PROT_WRITE,
                    libc::MAP_PRIVATE | libc::MAP_ANON,
                    -1,
                    0,
                );
                assert!(map != libc::MAP_FAILED, "no memory for an array of {size} bytes");
                libc::mprotect(map.cast::<u8>().add(length - page).cast(), page, libc::PROT_NONE);
                map.cast::<u8>()
            };
            Self { map, length }
        }

        /// Returns the address and the number of the accessible bytes.
        pub fn open(&self) -> (*mut u8, usize) {
            (self.map, self.length - page())
        }
    }

    impl Drop for Pages {
        fn drop(&mut self) {
            // If memory after arrays is accessible, freed arrays remain accessible, too.
            if KEEP.load(Ordering::Relaxed) {
                KEPT.lock().unwrap_or_else(PoisonError::into_inner).push((self.length, self.map as usize));
            } else if AFTER.load(Ordering::Relaxed) == 0 {
                // SAFETY: mapped in `new`; no pointer to it is used after the call.
                unsafe { libc::munmap(self.map.cast(), self.length) };
            }
        }
    }
}

#[cfg(not(unix))]
mod pages {
    /// Memory without a guard page: a write beyond an array is detected after the call.
    pub struct Pages(Box<[std::cell::UnsafeCell<u8>]>);

    impl Pages {
        pub fn new(size: usize) -> Self {
            Self((0..size + 128).map(|_| std::cell::UnsafeCell::new(0)).collect())
        }

        pub fn open(&self) -> (*mut u8, usize) {
            (self.0.as_ptr().cast_mut().cast(), self.0.len())
        }
    }
}

/// Array for one call.
pub struct Guarded {
    pages: pages::Pages,
    /// Index of the first byte of the array in the pages.
    begin: usize,
    size: usize,
    /// Bytes of the array before the call.
    before: Vec<u8>,
}

impl Guarded {
    /// Makes an array with these bytes.
    pub fn new(bytes: &[u8]) -> Self {
        let after = match cfg!(unix) {
            true => AFTER.load(Ordering::Relaxed),
            false => 64,
        };
        // At least 64 bytes before the array are filled, to detect writes there.
        let pages = pages::Pages::new(bytes.len() + after + 64);
        let (map, open) = pages.open();
        let begin = open - bytes.len() - after;
        // SAFETY: `open` bytes may be written, and the array lies within them.
        unsafe {
            map.write_bytes(FILL, open);
            map.add(begin).copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
        }
        Self { pages, begin, size: bytes.len(), before: bytes.to_vec() }
    }

    /// Makes an array of `size` bytes for results.
    pub fn for_results(size: usize) -> Self {
        Self::new(&vec![FILL; size])
    }

    pub fn address(&self) -> u64 {
        self.pages.open().0.wrapping_add(self.begin) as u64
    }

    fn all(&self) -> &[u8] {
        let (map, open) = self.pages.open();
        // SAFETY: `open` bytes are initialized, and no call is under way.
        unsafe { std::slice::from_raw_parts(map, open) }
    }

    pub fn bytes(&self) -> &[u8] {
        &self.all()[self.begin..self.begin + self.size]
    }

    /// Sets a byte of the array.
    pub fn set(&self, index: usize, byte: u8) {
        let (map, open) = self.pages.open();
        assert!(index < self.size && self.begin + index < open, "the index is outside the array");
        // SAFETY: the index lies within the array, and no call is under way.
        unsafe { map.add(self.begin + index).write(byte) };
    }

    /// Describes a write before or after the array or, if the array is for reading, a write to it; `None` if there was none.
    pub fn damage(&self, for_reading: bool) -> Option<String> {
        let all = self.all();
        if !is_filled(&all[..self.begin]) {
            let index = all[..self.begin].iter().rposition(|byte| *byte != FILL).unwrap_or_default();
            return Some(format!("{} bytes before an array", self.begin - index));
        }
        if !is_filled(&all[self.begin + self.size..]) {
            return Some("bytes after an array".to_owned());
        }
        (for_reading && self.bytes() != self.before)
            .then(|| "an array that is for reading (const)".to_owned())
    }
}
