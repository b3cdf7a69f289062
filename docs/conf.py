"""The documentation site: `make docs` builds it into build/docs. Nothing in it asks anything from outside."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

from modalscope import __version__

project, author, release = "modalscope", "The modalscope developers", __version__
copyright = f"2026, {author}"
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "cells",  # pages of the table, made from the table itself
    "faces",  # pages of the reference, made from what the package offers
]
exclude_patterns = [
    "_build",
    "**/GALLERY_HEADER.rst",
    "start/*",
    "howto/*",
    "executed/*",
    "_ext/*",
    "**/sg_execution_times.rst",
    "sg_execution_times.rst",
]
suppress_warnings = ["config.cache"]  # functions in the settings of the gallery

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
mathjax_path = "mathjax/tex-svg.js"  # fetched once by make docs, served from here
numpydoc_show_class_members = False
autodoc_typehints = "none"  # types stand in the docstrings, in words
autodoc_member_order = "bysource"
autosummary_generate = False

nitpicky = True  # for our own names: those of others have no page here
nitpick_ignore_regex = [(r".*", r"(?!modalscope).*")]

html_theme = "pydata_sphinx_theme"
html_title = "modalscope"
html_static_path = ["_static"]
html_extra_path = ["../build/conformance"]  # errata and conformance, as `make docs` has modalscope reproduce write it
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_align": "left",
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "navigation_with_keys": False,
}
html_sidebars = {"*": []}  # pages that stand alone have no section to show
html_context = {"default_mode": "auto"}


def _tidy(conf: dict, name: str) -> None:
    """Take away what scripts of the gallery wrote beside themselves."""
    for folder in ("start", "howto", "executed"):
        for path in (HERE / folder).iterdir():
            if path.is_file() and path.suffix not in (".py", ".rst"):
                path.unlink()


sphinx_gallery_conf = {
    "examples_dirs": ["start", "howto", "executed"],
    "gallery_dirs": ["generated/start", "generated/howto", "generated/executed"],
    "filename_pattern": r"plot_",
    "within_subsection_order": "FileNameSortKey",
    "reset_modules": ("matplotlib", _tidy),
    "reset_modules_order": "both",
    "abort_on_example_error": True,
    "only_warn_on_example_error": False,
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "min_reported_time": 1e9,
    "backreferences_dir": "generated/backreferences",
    "doc_module": ("modalscope",),
    "reference_url": {"modalscope": None},
    "matplotlib_animations": False,
    "capture_repr": (),  # what is printed is shown, and nothing else
    "remove_config_comments": True,
    "image_srcset": [],
    "thumbnail_size": (400, 280),
}
