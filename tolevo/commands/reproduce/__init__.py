"""Claims of documents, recomputed: `tolevo reproduce`."""
