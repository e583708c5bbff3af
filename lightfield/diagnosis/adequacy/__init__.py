"""Is anything still missing? Templates, score tests, robust noise."""
