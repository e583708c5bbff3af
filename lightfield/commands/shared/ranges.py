"""Numbers of options, in the ranges that Python's arguments of the same names have."""

from __future__ import annotations

import argparse

from lightfield.api.given import RANGES
from lightfield.errors import UsageError


def check_ranges(args: argparse.Namespace, *names: str) -> None:
    """Refuse numbers out of range, with a `UsageError` that names the option; None: not asked for."""
    for name in names:
        rule, holds = RANGES[name]
        found = getattr(args, name)
        if found is not None and not holds(found):
            where = f"--{name.replace('_', '-')}"
            raise UsageError(
                "impossible number", where=where, found=found, rule=rule, remedy="a number in that range"
            )
