"""Statistics of a study: what its settings do, beside the noise of its runs."""
