//! Machines, fixtures, tools, and the split of a part into what a machine can hold.
