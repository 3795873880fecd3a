"""How the system responds over frequency: band, margins, zeros, norms."""
