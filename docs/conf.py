"""Configuration of the documentation: pages are executed, and load nothing from a network."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "ephs"
author = "The ephs developers"
version = release = installed_version("ephs")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx_design",
    "sphinxcontrib.bibtex",
]
exclude_patterns = ["_build", ".jupyter_cache", "jupyter_execute"]

default_role = "literal"  # names in docstrings stand between single backticks

html_theme = "furo"
html_title = "ephs"
html_show_copyright = False
html_static_path = ["_static", "../.build/static"]

# MathJax 3 with everything in one file; `make docs` puts it into .build/static.
mathjax_path = "mathjax/tex-svg-full.js"
mathjax_options = {"defer": "defer"}
if not Path(__file__).parent.joinpath("../.build/static", mathjax_path).is_file():
    raise FileNotFoundError("MathJax is missing, build the pages with `make docs`")

bibtex_bibfiles = ["../ephs/mechanics/references.bib"]  # the file that ephs.cite reads
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

nb_execution_mode = "cache"
nb_execution_cache_path = str(Path(__file__).parent / "_build" / ".jupyter_cache")
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True
nb_ipywidgets_js = {}  # its default comes from a network
nb_render_markdown_format = "myst"  # CommonMark has no tables


def setup(app):
    """Write the pages that simulate beside the built pages."""
    from live_pages import write

    app.connect("build-finished", lambda app, failure: failure or write(Path(app.outdir, "live")))
