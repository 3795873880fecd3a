"""The marches: from inputs and past to states and outputs, delays exact."""
