"""The next measurement: points that separate explanations, or that would show an effect."""
