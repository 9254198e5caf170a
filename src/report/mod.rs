//! Everything shown, nothing computed: JSON, maps, pages.
