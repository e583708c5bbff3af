"""The follower: what its array of detectors can know of its pose, and what it takes it for."""
