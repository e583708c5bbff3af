"""Out to other tools: light for simulators, poses for robots."""
