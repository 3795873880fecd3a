"""What becomes of the study in many variants: plan, processes, journal, table."""
