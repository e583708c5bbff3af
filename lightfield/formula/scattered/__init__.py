"""What does scattered light look like in unbounded water? Solved without photons, so without their noise."""
