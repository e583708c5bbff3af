"""How often the base model may be given up where nothing is missing: one number, for which nobody waits."""

#: Family-wise level at which the base model is given up. Chosen: one false alarm in a hundred tables;
#: tests/unit/diagnosis/adequacy/test_adequacy.py holds it where nothing is missing.
ALPHA = 0.01
