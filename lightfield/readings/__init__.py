"""Readings: what a detector read, where, when, and how well that is known."""

from lightfield.readings.readings import ErrorBudget, LoadWarning, Readings

__all__ = ["ErrorBudget", "LoadWarning", "Readings"]
