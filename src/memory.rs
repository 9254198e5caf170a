//! How memory is taken from the system, and when what was freed goes back to it.

/// Keeps memory that was freed for what is taken next: blocks and bands of the same sizes are taken again and again,
/// and pages that the system has to clear anew cost a twentieth of a job's time. For a program to call before any
/// other thread runs.
pub fn keep_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const AHEAD: i32 = 64 << 20;
        // The most that glibc takes; larger ones are given back at once.
        const LARGE: i32 = 32 << 20;
        // SAFETY: the options say only when memory goes back to the system.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE);
            libc::mallopt(libc::M_TRIM_THRESHOLD, i32::MAX);
            libc::mallopt(libc::M_TOP_PAD, AHEAD);
        }
    }
}

/// Gives back all that is kept: what one stage has freed is of other sizes than what the next one takes, and would be
/// held beside it.
pub fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: only pages that hold nothing are given back.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Least bytes for which large pages are worth asking for.
const LEAST: usize = 4 << 20;

/// Asks the system for large pages under memory that is about to be written for the first time:
/// taking it 4 kB by 4 kB costs as much as the compensation of a small cutter. Only a hint.
fn large_pages(z: &[f32]) {
    #[cfg(not(target_os = "linux"))]
    let _ = (z, LEAST);
    #[cfg(target_os = "linux")]
    if size_of_val(z) >= LEAST {
        const PAGE: usize = 4096;
        let start = z.as_ptr().addr().next_multiple_of(PAGE);
        let end = (z.as_ptr().addr() + size_of_val(z)) / PAGE * PAGE;
        // SAFETY: the range lies within `z`; the advice changes no contents and no access rights.
        unsafe {
            libc::madvise(z.as_ptr().with_addr(start).cast_mut().cast(), end - start, libc::MADV_HUGEPAGE);
        }
    }
}

/// Makes so many heights of a vector that are all about to be written: what it holds stays, or else it is memory
/// that nobody has touched yet.
pub fn untouched(z: &mut Vec<f32>, len: usize) {
    if z.capacity() < len {
        *z = vec![0.0; len];
        large_pages(z);
    }
    z.resize(len, 0.0);
}
