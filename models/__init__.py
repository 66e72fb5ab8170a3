"""Physics: frozen parameter records and pure functions on batches."""
