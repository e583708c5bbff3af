"""The closed loop: a vehicle that follows a leader's lamp, or docks at it, by what its array reads."""
