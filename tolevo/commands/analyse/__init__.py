"""`tolevo analyse`: the sheet of a stack at the tolerances that its drawing has, without a search."""
