//! When memory that was freed goes back to the system.

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
