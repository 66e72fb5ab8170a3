"""What a promise of the yield costs, which part it depends on most, and its reviews."""
