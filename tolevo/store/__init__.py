"""Records of studies and tables in SQLite or PostgreSQL, which processes and machines share."""
