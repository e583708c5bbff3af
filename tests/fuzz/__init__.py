"""Wrong input of every kind, by the thousand: `python -m fuzz --seed N --count N` in the folder `tests`."""
