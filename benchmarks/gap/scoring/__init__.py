"""What a record can tell, and how what was said of it is scored. Imports the generator alone."""
