"""The system itself: its data, its response at any point, arithmetic, and the loop as algorithms see it."""
