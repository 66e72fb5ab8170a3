"""Configurations: TOML in, everything a command needs out, every fault at once."""
