"""The learned profiles of sensors on the page are those of the committed result."""

import json
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "methods" / "size-from-both-ends.md").read_text()
RESULT = json.loads((DOCS / "results" / "profiles.json").read_text())


@pytest.mark.parametrize("name", RESULT["profiles"])
@pytest.mark.parametrize("table", ["profiles", "log_density"])
def test_a_row_of_the_page_is_that_of_the_result(table, name):
    row = RESULT[table][name]
    learned_from = row if table == "profiles" else {key: row[key] for key in ("default", *RESULT["profiles"])}
    assert f"| {name} | " + " | ".join(f"{x:.2f}" for x in learned_from.values()) + " |\n" in PAGE
