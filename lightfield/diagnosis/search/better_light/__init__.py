"""The last fits of what was found by scattered light, in light without the noise of photons."""
