"""How many unstable roots there are over two delays, two gains, or a gain and a delay."""
