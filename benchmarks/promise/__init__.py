"""Whether promises from samples are kept: repeats of measuring, allocating and making."""
