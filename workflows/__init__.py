"""What a command does, from configuration to result."""
