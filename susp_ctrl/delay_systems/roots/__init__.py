"""Where the characteristic roots are, and how many lie right of a line."""
