"""How the system responds in time: to any input, to steps and impulses, steadily to sines."""
