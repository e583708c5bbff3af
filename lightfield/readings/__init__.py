"""Readings: what a detector read, where, when, and how well that is known."""

from lightfield.readings.columns import ErrorBudget
from lightfield.readings.load_warning import LoadWarning
from lightfield.readings.readings import Readings
from lightfield.readings.table.read import read_table
from lightfield.readings.table.write import write_table

__all__ = ["ErrorBudget", "LoadWarning", "Readings", "read_table", "write_table"]
