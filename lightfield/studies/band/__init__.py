"""Which band of wavelengths serves best, for a lamp, a water and a detector."""
