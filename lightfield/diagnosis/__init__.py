"""Pieces of the diagnosis: noise, templates, adequacy test, search, rivals, ladder, verdict."""
