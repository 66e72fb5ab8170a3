"""Many runs over settings and seeds: designs, execution, storage, statistics."""
