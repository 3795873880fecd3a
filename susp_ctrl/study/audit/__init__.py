"""Whether the printed numbers of a publication follow from its own equations."""
