"""The explorer as one page to mail."""
