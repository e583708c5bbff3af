"""How far a lamp carries data, and is seen."""
