"""Pages that are made from the registries are those that the registries make."""

from pathlib import Path

import pytest

from studies.generated import pages

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize(("page", "text"), pages(DOCS).items(), ids=lambda value: getattr(value, "name", "text"))
def test_the_page_is_up_to_date(page, text):
    assert page.read_text() == text, f"{page.name} is older than the code; `make generated` writes it anew"
