"""From instrument files and an index of them to one reading table."""
