"""Measurements: the reading table, and the readers of instrument files."""

from lightfield.measurements.readings import ErrorBudget, LoadWarning, Readings

__all__ = ["ErrorBudget", "LoadWarning", "Readings"]
