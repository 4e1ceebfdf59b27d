"""Links of the Markdown pages lead to files of the repository and to their headings; formulas stay formulas."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
FENCED = re.compile(r"^```.*?^```", re.S | re.M)
INLINE_CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"\]\(([^)\s]+)\)")


def targets(text: str) -> list[str]:
    """Links of a page that stay in the repository."""
    found = LINK.findall(INLINE_CODE.sub("", FENCED.sub("", text)))
    return [link for link in found if not re.match(r"[a-z]+:", link)]


def anchors(text: str) -> set[str]:
    """What GitHub and MyST make of the headings of a page."""
    heads = re.findall(r"^#+ (.+)$", FENCED.sub("", text), re.M)
    plain = (re.sub(r"[^\w\- ]", "", head.lower()) for head in heads)
    return {head.replace(" ", "-") for head in plain}


def broken(page: Path, text: str) -> list[str]:
    """Links of the text that lead nowhere from the place of the page."""
    found = []
    for link in targets(text):
        name, _, anchor = link.partition("#")
        target = page if not name else (page.parent / name).resolve()
        headed = not anchor or (target.suffix == ".md" and target.is_file() and anchor in anchors(target.read_text()))
        if not target.is_file() or not headed:  # the site has no page of a folder
            found.append(link)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    assert broken(page, page.read_text()) == []


@pytest.mark.parametrize(
    "link", ["nowhere.md", "index.md#no-such-heading", "#neither", "../testbed/no_such.py", "results"]
)
def test_a_broken_link_is_found(link):
    assert broken(ROOT / "docs" / "index.md", f"# Head\n\n[text]({link})") == [link]


def test_every_page_is_on_the_index():
    linked = set(targets((ROOT / "docs" / "index.md").read_text()))
    pages = {str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")}
    assert pages - linked == {"index.md"}


def test_every_page_is_in_the_contents_of_the_site():
    contents = re.findall(r"^[\w./*-]+$", (ROOT / "docs" / "conf.py").read_text(), re.M)
    pages = {str(page.relative_to(ROOT / "docs").with_suffix("")) for page in (ROOT / "docs").rglob("*.md")}
    listed = {page for page in pages if page in contents or f"{Path(page).parent}/*" in contents}
    assert pages - listed == {"index"}


def torn(text: str) -> list[str]:
    """Lines within a formula that Markdown takes for items of a list."""
    found = []
    for paragraph in re.split(r"\n\s*\n", FENCED.sub("", text)):
        lines = paragraph.splitlines()
        for k, line in enumerate(lines):
            if re.match(r"\s*([-+*]|\d+[.)])\s", line) and "\n".join(lines[:k]).count("$") % 2:
                found.append(line)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_formula_becomes_a_list(page):
    assert torn(page.read_text()) == []


def test_a_torn_formula_is_found():
    assert torn("the mean $(n\n- 1) X$ is\n\n- an item with $x$\n- another") == ["- 1) X$ is"]
