"""Pages and their data files as they are committed, held against what results give."""

from pathlib import Path

from studies.page import NOTES, TABLES, split_tables

DOCS = Path(__file__).parents[2] / "docs"


def assert_committed(name: str, text: str) -> None:
    """The committed page and its data files are those of a text whose first line is the title."""
    shown, tables = split_tables(name, text)
    page = (DOCS / f"{name}.md").read_text()
    assert page.partition(NOTES)[0].split("\n", 4)[4].strip() == shown.partition("\n")[2].strip()
    folder = DOCS / TABLES / name
    assert {file.name: file.read_text() for file in folder.glob("*")} == tables
