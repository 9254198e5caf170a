/// Least bytes for which large pages are worth asking for.
const LEAST: usize = 4 << 20;

/// Asks the system for large pages under memory that is about to be written for the first time:
/// taking it 4 kB by 4 kB costs as much as the compensation of a small cutter. Only a hint.
pub(super) fn large_pages(z: &[f32]) {
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
pub(super) fn untouched(z: &mut Vec<f32>, len: usize) {
    if z.capacity() < len {
        *z = vec![0.0; len];
        large_pages(z);
    }
    z.resize(len, 0.0);
}
