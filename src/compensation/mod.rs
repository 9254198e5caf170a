//! Dilation by the cutter, closing and residual on sampled heights.
