"""Pages and figures of the follower: its array, its pose, and what it takes its pose for."""
