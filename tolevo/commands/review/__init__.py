"""`tolevo review`: an order that has been placed, against the parts that came."""
