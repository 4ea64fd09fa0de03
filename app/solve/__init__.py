"""From a frame to a pointing, or to the honest reason why there is none."""
