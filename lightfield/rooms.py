"""Rooms of the house that share their name with a public function: they let themselves be called."""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Room(ModuleType):
    """A room that is called as the public function of its name: Python keeps both under one name."""

    def __call__(self, *args: object, **given: object) -> object:
        return self.__wrapped__(*args, **given)

    @property
    def __wrapped__(self) -> Any:  # what `inspect.signature` asks for
        house, _, name = self.__name__.rpartition(".")
        return getattr(import_module(f"{house}.{sys.modules[house].PUBLIC[name]}"), name)

    @property
    def __doc__(self) -> str | None:  # type: ignore[override]  # `lf.render?` in a notebook asks for it
        return self.__wrapped__.__doc__


def open_room(name: str) -> None:
    """Let a room, by its full name, be called as the public function of its name."""
    sys.modules[name].__class__ = _Room
