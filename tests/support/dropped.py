"""Files as they are dropped into the explorer."""

from __future__ import annotations

import base64

from lightfield.explorer import protocol


def dropped_file(name: str, content: str | bytes) -> protocol.File:
    """As the page sends it."""
    data = content.encode() if isinstance(content, str) else content
    return protocol.File(name=name, content=base64.b64encode(data).decode())
