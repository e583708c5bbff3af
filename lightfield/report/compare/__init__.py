"""Pages and figures of comparisons."""
