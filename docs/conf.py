"""How the documentation is built: `make docs`, or Sphinx by hand."""

import io
from contextlib import redirect_stdout, suppress

from docutils import nodes
from docutils.parsers.rst import Directive

import vnca
from vnca.cli import main

project, author = "vnca", "the vnca authors"
release = version = vnca.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
root_doc = "index"
exclude_patterns = ["gallery/textures/*.md"]

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4

html_theme = "furo"
html_title = "vnca"
html_copy_source = False

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_class_signature = "mixed"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_custom_sections = ["Reference"]


class CommandHelp(Directive):
    """What a command prints for `--help-all`: ``{command-help} train``."""

    required_arguments = 1
    optional_arguments = 4

    def run(self) -> list[nodes.Node]:
        """The help as a block of text."""
        shown = io.StringIO()
        with redirect_stdout(shown), suppress(SystemExit):
            main(self.arguments)
        text = shown.getvalue()
        if not text.startswith("usage:"):
            raise self.error(f"vnca {' '.join(self.arguments)} printed no help")
        return [nodes.literal_block(text, text, language="text")]


def setup(app: object) -> None:
    """Add our directive, as Sphinx asks."""
    app.add_directive("command-help", CommandHelp)  # pyright: ignore[reportAttributeAccessIssue]
