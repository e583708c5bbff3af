"""Poses from what an array read: of single readings and of sequences, with their errors and rivals."""
