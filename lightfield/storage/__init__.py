"""Files, caches and tables of numbers: what is kept on the disk, and how."""
