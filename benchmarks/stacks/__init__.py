"""Generated stacks with many requirements on one bill of parts, and what solves them."""
