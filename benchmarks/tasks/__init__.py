"""What the contenders are tried on."""
