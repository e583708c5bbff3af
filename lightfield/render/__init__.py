"""Light transport in Mitsuba 3: backend, plugins, tracer, transport response."""

from lightfield.render.backend import with_plugins
from lightfield.rooms import open_room


def _register() -> None:
    """Our plugins, which import Mitsuba."""
    from lightfield.render.plugins.registration import register

    register()


with_plugins(_register)
open_room(__name__)  # `lightfield.render(...)`
