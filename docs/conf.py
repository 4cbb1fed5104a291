"""Sphinx configuration. `make docs` builds these pages with every warning an error."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))
sys.path.insert(0, str(Path(__file__).parent.parent))

from turnbuckle import __version__  # noqa: E402  (the path comes first)

project = "Turnbuckle"
author = "The Turnbuckle authors"
copyright = "The Turnbuckle authors, Apache License 2.0"
version = release = __version__

extensions = [
    "myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_design", "sphinx_gallery.gen_gallery",
    "sphinxcontrib.video",
    "definition_table", "benchmark_tables",
]  # fmt: skip
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_extensions", "gallery"]
nitpicky = False

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3

default_role = "code"  # `name` in a docstring is code
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_class_signature = "separated"  # data classes are shown as tables of their fields

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "figures",  # made by the build
    "subsection_order": ["gallery/local", "gallery/displacement", "gallery/contact"],
    "within_subsection_order": "FileNameSortKey",
    "filename_pattern": r"\.py$",  # every page runs
    "image_scrapers": ("matplotlib", "gallery_films"),
    "capture_repr": (),
    "reset_modules": (),
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
}

html_theme = "pydata_sphinx_theme"
html_title = "Turnbuckle"
html_show_sphinx = False
html_sidebars = {page: [] for page in ("index", "quickstart", "benchmarks", "extending", "api")}  # they have no parts
html_static_path = ["_static"]
html_css_files = ["turnbuckle.css"]
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "navbar_align": "left",
    "header_links_before_dropdown": 8,
}
