"""Pages and figures of a diagnosis."""
