"""What ghosts and unused options of a radar cost is on the page as in the committed result, and within the goals."""

import json
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "ghosts.md").read_text()
RESULT = json.loads((DOCS / "results" / "radar-cost.json").read_text())


def test_the_cost_of_ghosts_is_that_of_the_result():
    rows = RESULT["ghosts"]["rows"]
    for scenario, (low, high) in rows.items():
        assert f"| {scenario} | {low:.2f} to {high:.2f} |\n" in PAGE
    low, high = min(a for a, _ in rows.values()), max(b for _, b in rows.values())
    assert f"takes {low:.2f} to {high:.2f} times the CPU time" in PAGE
    assert high < 1.5


def test_the_cost_of_options_that_are_off_is_that_of_the_result():
    ratios = [ratio for row in RESULT["options_off"]["rows"].values() for ratio in row.values()]
    assert f"{min(ratios):.2f} to\n{max(ratios):.2f} times (goal 1.2)" in PAGE
    assert max(ratios) < 1.2
