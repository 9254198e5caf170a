//! Reads the text of a program back, sweeps the cutter through the stock, and times the motions. Shares no code with what planned or wrote it.
