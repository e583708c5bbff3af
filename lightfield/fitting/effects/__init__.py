"""Effects: named groups of scene parameters set free from their neutral values."""

from lightfield.fitting.effects.effect import TOGETHER, Effect, Form, Free, Need, Scale
from lightfield.fitting.effects.registry import ENTRY_POINT_GROUP, all_of, curves, get, get_form, table

__all__ = [
    "ENTRY_POINT_GROUP",
    "TOGETHER",
    "Effect",
    "Form",
    "Free",
    "Need",
    "Scale",
    "all_of",
    "curves",
    "get",
    "get_form",
    "table",
]
