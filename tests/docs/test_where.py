"""The table of CONTRIBUTING.md that says where things are set or decided."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROWS = re.findall(
    r"^\| ([^|]+) \| \[([\w./]+)\]\(\2\) \| `([^`]+)` \|$", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.M
)


def test_the_table_has_twelve_questions():
    assert len({question for question, _, _ in ROWS}) == 12


@pytest.mark.parametrize(("question", "file", "line"), ROWS)
def test_one_line_of_the_file_answers(question, file, line):
    found = [text for text in (ROOT / file).read_text(encoding="utf-8").splitlines() if line in text]
    assert len(found) == 1, question
