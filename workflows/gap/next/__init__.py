"""The next measurement: points that tell the names apart, or that would show an effect."""
