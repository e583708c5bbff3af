"""How far a lamp can be used."""
