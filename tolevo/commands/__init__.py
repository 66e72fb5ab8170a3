"""The commands: each with its configuration, calculation, records and page."""
