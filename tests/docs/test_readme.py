"""The README's promises: its example runs, its catalogue is the registries'."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from testbed.command_line.tables import entries

README = Path(__file__).parents[2] / "README.md"


def catalogue() -> str:
    """The README's catalogue as the registries have it."""
    parts = []
    for name, found in entries().items():
        rows = "\n".join(f"| `{entry}` | {what} |" for entry, what in found)
        parts.append(f"**{name.capitalize()}**\n\n| name | what |\n|---|---|\n{rows}\n")
    return "\n".join(parts)


def section(text):
    return re.search(r"tests/docs/test_readme\.py -->\n(.*)<!-- end of catalogue -->", text, re.S).group(1)


def test_the_catalogue_is_that_of_the_registries():
    """On failure: `python tests/docs/test_readme.py` writes it anew."""
    assert section(README.read_text()).strip() == catalogue().strip()


def test_the_python_example_runs(tmp_path):
    code = re.search(r"```python\n(.*?)```", README.read_text(), re.S).group(1)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "track at" in done.stdout


@pytest.mark.parametrize("picture", re.findall(r"!\[.*?\]\((.*?)\)", README.read_text()))
def test_every_picture_is_there(picture):
    assert (README.parent / picture).is_file()


if __name__ == "__main__":
    sys.path[0] = str(README.parent)  # not this folder, whose `scenarios` are tests
    head, mark, rest = README.read_text().partition("tests/docs/test_readme.py -->\n")
    README.write_text(head + mark + "\n" + catalogue() + "\n" + rest[rest.index("<!-- end of catalogue -->") :])
