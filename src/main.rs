use std::process::ExitCode;

mod cli;

fn main() -> ExitCode {
    // A reader that has seen enough (`| head`) ends the program, it does not make it panic.
    sigpipe::reset();
    keep_freed_memory();
    cli::run()
}

/// Keeps memory that was freed for what is taken next: blocks and bands of the same sizes are taken again and again,
/// and pages that the system has to clear anew cost a twentieth of a job's time.
fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const AHEAD: i32 = 64 << 20;
        // The most that glibc takes; larger ones are given back at once.
        const LARGE: i32 = 32 << 20;
        // SAFETY: no other thread runs yet, and the options say only when memory goes back to the system.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE);
            libc::mallopt(libc::M_TRIM_THRESHOLD, i32::MAX);
            libc::mallopt(libc::M_TOP_PAD, AHEAD);
        }
    }
}
