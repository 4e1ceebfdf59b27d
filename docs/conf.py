"""How `make docs` builds the site: the Markdown pages as they are, and the API reference from the docstrings."""

import inspect
import re
from posixpath import relpath
from typing import Any

from sphinx.application import Sphinx

import testbed

project = html_title = "eot-testbed"
version = release = testbed.__version__
copyright = "its authors, MIT licence"

# The root of the repository is the source, so that links between pages, README and code are those of the checkout.
root_doc = "docs/index"
include_patterns = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/**"]
exclude_patterns = [".*", "build", "runs", "tests"]

extensions = [
    "myst_parser",  # Markdown, $equations$
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",  # a page a module, in docs/api/
    "sphinx.ext.napoleon",  # sections Args and Raises
    "sphinx.ext.viewcode",
    "sphinx-mathjax-offline",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
autodoc_default_options = {"members": True, "ignore-module-all": True}
autodoc_member_order = "bysource"
default_role = "code"  # `names` in docstrings
html_theme = "furo"
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["site.css"]

CONTENTS = """
```{toctree}
:hidden:

../README
catalogue
contract
scan
layers
own-code
own-recordings
own-tracks
real-traffic
reviewing
benchmark
citing
results
comparing
regression
track-observation
learning-to-drive
learning
ghosts
random-streams
dependencies
../CONTRIBUTING
../CHANGELOG
```

```{toctree}
:hidden:
:caption: Methods
:glob:

methods/*
```

```{toctree}
:hidden:
:caption: Measured

comparison
consistency
closed-loop
regret
probes
learned-policies
reproductions
partial-view
contours
modes
htg-tables
faults
persistence
radars
calibration
standing-returns
traffic
speed
```

```{toctree}
:hidden:
:caption: Code

api
```
"""


CODE = re.compile(r"\]\((?:\.\./)*((?:trackers|sensors|scenarios|testbed)/[\w/]+)\.py\)")  # a link to a module
FIELD = re.compile(r"^    ([a-zA-Z]\w*): ([^#\n]+?)(?:  # (.*))?$", re.M)

ARRAY = re.compile(r"[~\w.]*ndarray\[tuple\[.*?_ScalarT\]\]")
NO_COLON = "\u2236"  # looks like one


def adapt_page(app: Sphinx, page: str, source: list[str]) -> None:
    """Add the contents to the index, and lead links to modules to their pages of the API reference."""
    if page == root_doc:
        source[0] += CONTENTS
    api = relpath("docs/api", page.rpartition("/")[0] or ".")
    source[0] = CODE.sub(lambda m: f"]({api}/{m[1].removesuffix('/__init__').replace('/', '.')}.rst)", source[0])


def adapt_docstring(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Our docstrings are plain text, not reStructuredText: sketches stay as they are drawn, a bar is a bar.

    The comments behind the fields of a record, with their shapes and units, are part of its documentation.
    """
    text = "\n".join(lines)
    if what == "module":
        text = re.sub(r"\n\n(?= {4})", "\n\n.. code-block:: none\n\n", text)  # an indented part is a sketch
    if what == "class" and has_fields(thing):
        found = FIELD.findall(inspect.getsource(thing))
        text += "\n\n" + "\n".join(f"- `{field}: {kind}` {comment}" for field, kind, comment in found) + "\n"
    if what in ("property", "attribute"):
        text = text.replace(":", NO_COLON)  # what stands before one would be taken for a type
    kept = r"(?m)^ {4}.*$|^>>>.*$|`[^`]*`"
    lines[:] = re.sub(rf"{kept}|[|*]", lambda m: "\\" + m[0] if m[0] in "|*" else m[0], text).split("\n")


def restore_colons(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Undo what `adapt_docstring` did to colons."""
    lines[:] = [line.replace(NO_COLON, ":") for line in lines]


def shorten_signature(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Arrays are called as in the source; their shapes stand in the docstring."""
    return signature and ARRAY.sub("NDArray", signature), returned and ARRAY.sub("NDArray", returned)


def skip_field(app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Fields of named tuples are listed with their record."""
    return True if type(thing).__name__ == "_tuplegetter" else None


def has_fields(thing: Any) -> bool:
    """Whether it is a NamedTuple or a dataclass."""
    return hasattr(thing, "_fields") or hasattr(thing, "__dataclass_fields__")


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", adapt_page)
    app.connect("autodoc-process-docstring", adapt_docstring, priority=100)  # before the sections Args and Raises
    app.connect("autodoc-process-docstring", restore_colons, priority=900)  # after them
    app.connect("autodoc-process-signature", shorten_signature)
    app.connect("autodoc-skip-member", skip_field)
