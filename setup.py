"""What `pyproject.toml` cannot say: the example scenes go into the package, the pictures out of its page.

Scenes stand beside the package in the repository, where people look for them; installed they are
`lightfield/scenes`. A package index shows README.md without the files beside it: there its pictures and its
links to other files would lead nowhere.
"""

import re
from pathlib import Path

from setuptools import find_packages, setup

HERE = Path(__file__).parent


def long_description() -> str:
    """The README without pictures, and with the text alone of links to files beside it."""
    text = (HERE / "README.md").read_text(encoding="utf-8")
    # A table of pictures goes with its head: lines of a block of which one holds a picture.
    blocks = [block for block in text.split("\n\n") if "![" not in block]
    return re.sub(r"\[([^\]]+)\]\((?!https?://|#)[^)]+\)", r"\1", "\n\n".join(blocks))


setup(
    packages=[*find_packages(include=["lightfield*"]), "lightfield.scenes"],
    package_dir={"lightfield.scenes": "scenes"},
    long_description=long_description(),
    long_description_content_type="text/markdown",
)
