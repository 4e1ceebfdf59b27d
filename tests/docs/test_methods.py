"""Pages of the methods and the code name the same equations: who follows a number finds one equation, on one page."""

import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "methods").glob("*.md"))
PACKAGES = ("trackers", "sensors", "scenarios", "testbed")
TAG = re.compile(r"\\tag\{([^}]*)\}")
NUMBER = re.compile(r"(?<![\w/])[A-Z]{2,5}\.\d+[a-z]?\b")  # after a slash it is part of a DOI
PAGE = re.compile(r"docs/methods/([\w.-]+\.md)")
DEFINED = {tag: page.name for page in PAGES for tag in TAG.findall(page.read_text())}
NAMES = DEFINED.keys() | {tag.rstrip("abcdefgh") for tag in DEFINED}  # X.5 names the equations X.5a, X.5b, ... together


def sources(*folders):
    """Python files below these folders."""
    return [file for folder in folders for file in sorted((ROOT / folder).rglob("*.py"))]


def unknown(texts, pattern, known):
    """`path:line: name` of every name under the pattern that is not known; texts are (path, text)."""
    return [
        f"{path.relative_to(ROOT)}:{number}: {name}"
        for path, text in texts
        for number, line in enumerate(text.splitlines(), 1)
        for name in pattern.findall(line)
        if name not in known
    ]


def test_no_equation_has_the_number_of_another():
    count = Counter(tag for page in PAGES for tag in TAG.findall(page.read_text()))
    assert [tag for tag, n in count.items() if n > 1] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_has_numbers_of_its_own_that_the_code_can_name(page):
    tags = TAG.findall(page.read_text())
    assert [tag for tag in tags if not NUMBER.fullmatch(tag)] == []
    prefixes = {tag.split(".")[0] for tag in tags}
    others = {tag.split(".")[0] for tag, name in DEFINED.items() if name != page.name}
    assert prefixes
    assert not prefixes & others


def test_every_equation_named_in_the_code_or_on_a_page_stands_on_a_page():
    named = [(file, file.read_text()) for file in (*sources(*PACKAGES, "tests"), *PAGES)]
    missing = unknown(named, NUMBER, NAMES)
    assert not missing, "\n".join(missing)


def test_every_page_named_anywhere_exists():
    pages = (*sorted((ROOT / "docs").rglob("*.md")), *ROOT.glob("*.md"))
    named = [(file, file.read_text()) for file in (*sources(*PACKAGES, "tests"), *pages)]
    missing = unknown(named, PAGE, {page.name for page in PAGES})
    assert not missing, "\n".join(missing)
