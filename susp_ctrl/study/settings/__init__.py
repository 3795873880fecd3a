"""What the study file asks for: typed settings and the strict reader of the file."""
