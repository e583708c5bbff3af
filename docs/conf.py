"""How the site is built (`make docs`): warnings are errors, notebooks are executed, figures are made."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from lightfield import __version__

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "lightfield"
author = "lightfield developers"
copyright = author
release = version = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathtext"]
html_math_renderer = "mathtext"
exclude_patterns = ["_build", "_extensions", "**/.ipynb_checkpoints"]
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
# Of what points out of the site nothing but links to other sites is checked here.
suppress_warnings = ["misc.highlighting_failure"]

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True
# Cells run where the reader's commands would: in the repository.
nb_execution_in_temp = False
os.environ.setdefault("MPLBACKEND", "module://matplotlib_inline.backend_inline")
os.environ.setdefault("LIGHTFIELD_DOCS", "1")

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"lightfield {release}"
html_static_path = ["_static"]
html_css_files = ["narrow.css"]
