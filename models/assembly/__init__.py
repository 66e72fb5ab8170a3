"""Assembly as a state-space process: part errors propagate, adjustments reduce them."""
