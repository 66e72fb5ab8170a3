"""What a promise of the yield costs, what it hangs on, and what production says of it."""
