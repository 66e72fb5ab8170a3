"""Records with hidden effects. Shares no code with the library that is judged by them."""
