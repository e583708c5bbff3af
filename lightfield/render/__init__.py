"""Light transport in Mitsuba 3: backend, plugins, tracer, transport response."""

from lightfield.rooms import open_room

open_room(__name__)  # `lightfield.render(...)`
