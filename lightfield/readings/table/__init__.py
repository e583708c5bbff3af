"""The reading table as a CSV file."""
