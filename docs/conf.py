"""The documentation site: `make docs`. Its pages are the Markdown files in the folders, and those in `docs/`.

The reference of commands, of JSON documents and of Python is generated from the code each time. Equations become
MathML, which browsers draw themselves, and the search runs in the page: the site needs no network.
"""

from __future__ import annotations

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import generated_reference  # noqa: E402 - beside this file, which is no package

project, author = "armload", "the authors of armload"
copyright = "the authors of armload, Apache-2.0"  # noqa: A001 - Sphinx's name
version = release = installed_version("armload")
root_doc = "docs/index"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
include_patterns = [
    "docs/**.md",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "controller/*.md",
    "drivers/*.md",
    "configs/*.md",
    "identification/*.md",
    "identification/armload_core/*.md",
    "benchmarks/*.md",
    "tests/example_plugin/*.md",
]
exclude_patterns = ["**/.venv*", "docs/site", "**/node_modules"]
myst_enable_extensions = ["dollarmath", "deflist", "attrs_inline"]
myst_heading_anchors = 4
source_suffix = {".md": "markdown"}
html_theme = "furo"
html_title = f"armload {version}"
html_extra_path = ["entrance"]
html_show_sphinx = False
html_copy_source = False
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["site.css"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
suppress_warnings = ["misc.highlighting_failure"]  # shell lines and output stand in one block


def inline_mathml(writer: HTML5Translator, node: nodes.math) -> None:
    """Write an equation in a line."""
    writer.body.append(_mathml(node.astext(), block=False))
    raise nodes.SkipNode


def block_mathml(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write an equation of its own."""
    writer.body.append(f'<div class="equation">{_mathml(node.astext(), block=True)}</div>\n')
    raise nodes.SkipNode


def _mathml(text: str, *, block: bool) -> str:
    """MathML of an equation."""
    return latex2mathml.tex2mathml(text, as_block=block)


def links_to_folders(app: Sphinx, doctree: nodes.document) -> None:
    """Show links to folders and sources of the checkout, which are no pages, as their names."""
    for node in list(doctree.findall(pending_xref)):
        target = node.get("reftarget", "").partition("#")[0]
        folder = Path(app.srcdir, app.env.docname).parent
        path = (folder / target).resolve()
        if target and path.is_relative_to(app.srcdir) and path.exists() and path.suffix not in {".md", ".svg"}:
            node.replace_self(nodes.literal(text=str(path.relative_to(app.srcdir))))


def setup(app: Sphinx) -> None:
    """Register the generated pages, the equations, and the links to sources."""
    app.add_html_math_renderer("mathml", (inline_mathml, None), (block_mathml, None))
    app.connect("builder-inited", lambda _: generated_reference.write(HERE / "reference"))
    app.connect("doctree-read", links_to_folders)
