"""Sphinx's settings of the documentation site, for docs/build_site.py and for rosdoc2, which runs it in a copy."""

import importlib.util
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

HERE = Path(__file__).resolve().parent
# rosdoc2 runs a copy of this folder, and puts the checkout on the path itself.
sys.path[:0] = [str(HERE), str(HERE.parent)]

import robot_formation  # noqa: E402

ROOT = Path(robot_formation.__file__).resolve().parents[1]
PACKAGE = ElementTree.parse(ROOT / "package.xml").getroot()

project = str(PACKAGE.findtext("name"))
author = str(PACKAGE.findtext("maintainer"))
copyright = f"{author}. Licence: {PACKAGE.findtext('license')}"
release = version = str(PACKAGE.findtext("version"))
project_root = str(ROOT)
project_url = (PACKAGE.findtext("url[@type='repository']") or "").removesuffix("/").removesuffix(".git")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "site_builder"]
# rosdoc2 writes an index.rst and copies of README, CHANGELOG and the like beside the pages.
exclude_patterns = ["[A-Z]*", "__*", "index.rst"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline"]

# The docstrings write code in single backticks; names of the API become links.
default_role = "py:obj"
autosummary_generate = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
# Signatures show the names of the code, not what these stand for.
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Matrix", "NDArray", "Vector")}
python_use_unqualified_type_names = True
maximum_signature_line_length = 90
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_custom_sections = [("Attributes", "params_style")]  # a list: some are documented by themselves too
napoleon_attr_annotations = False  # the signature of the class has them
napoleon_use_rtype = False
# What the API's modules import of other packages, and an install without ROS or simulation may lack.
_OPTIONAL = ("cv2", "dask", "distributed", "mcap", "pybullet", "rclpy", "setproctitle", "viser")
autodoc_mock_imports = [name for name in _OPTIONAL if importlib.util.find_spec(name) is None]

html_theme = "furo"
html_theme_options: dict[str, object] = {}  # in place of rosdoc2's for another theme
html_title = "robot_formation"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
templates_path: list[str] = []

rosdoc2_settings = {"override_theme": False, "allow_other_extensions": True}
