"""Serial arms: chains of revolute joints by a Denavit-Hartenberg table."""
