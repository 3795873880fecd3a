"""For which delays along a line a root crosses the imaginary axis, and at what frequency."""
