"""New digests for committed results: only where the repeated runs have the committed bits."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
import typer

from studies.comparison import refresh as refresh_module
from studies.comparison.publish import ABOUT, RUNS
from studies.comparison.refresh import KEPT, Piece, draw, main
from tests.studies.comparison.conftest import DOCS, TRACKERS


@pytest.fixture
def results(published, tmp_path):
    """Committed results of other code."""
    target = tmp_path / "results"
    shutil.copytree(published, target)
    known = json.loads((target / ABOUT).read_text())
    known["identity"] |= {"code": "0123456789ab", "code of rm-feldmann": "ba9876543210"}
    (target / ABOUT).write_text(json.dumps(known))
    return target


def change(results, measure, seed, by):
    """Change one committed number of a whole run of rm-feldmann."""
    table = pd.read_parquet(results / RUNS)
    row = (table["tracker"] == "rm-feldmann") & (table["seed"] == seed) & (table["phase"] == "all")
    assert row.sum() == 1
    table.loc[row, measure] = by(table.loc[row, measure].to_numpy())
    table.to_parquet(results / RUNS)


def refresh(results, sample, part="runs"):
    main(results=results, part=[part], sample=sample, seed=0, jobs=1, keep=False)


def test_equal_runs_get_the_digests_of_the_code_at_hand(results, published, capsys):
    change(results, "ms_per_scan", 1, lambda old: 2 * old)  # wall time, which differs from one execution to the next
    refresh(results, 4)
    known, wanted = (json.loads((folder / ABOUT).read_text()) for folder in (results, published))
    assert known == wanted
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("equal    runs:")]
    assert line.count("xia2020-lane_htg-mm_seed") == line.count("xia2020-lane_rm-feldmann_seed") == 2


def test_a_number_that_is_another_float_is_shown_and_nothing_is_written(results, capsys):
    before = (results / ABOUT).read_bytes()
    change(results, "gospa", 2, lambda old: np.nextafter(old, np.float32(np.inf)))
    with pytest.raises(typer.Exit) as left:
        refresh(results, 6)
    assert left.value.exit_code == 1
    out = capsys.readouterr().out
    assert "1 numbers that are not the committed ones" in out
    assert "gospa" in out
    assert "equal    runs" not in out
    assert (results / ABOUT).read_bytes() == before


def test_a_sample_without_a_tracker_whose_code_has_changed_is_refused(results, capsys):
    known = json.loads((results / ABOUT).read_text())
    known["identity"] |= {f"code of {tracker}": "ba9876543210" for tracker in TRACKERS}
    (results / ABOUT).write_text(json.dumps(known))
    with pytest.raises(typer.Exit) as left:
        refresh(results, 1)
    assert left.value.exit_code == 2
    assert "sample: 1 runs leave out" in capsys.readouterr().err
    assert json.loads((results / ABOUT).read_text()) == known


@pytest.mark.parametrize(
    "part", ["papers", *(pytest.param(part, marks=pytest.mark.slow) for part in ("drives", "probes"))]
)
def test_each_part_is_repeated_and_a_changed_number_of_it_is_shown(part, tmp_path, capsys, monkeypatch):
    committed = DOCS / "results"
    for name in ("probes.json", KEPT):
        shutil.copy(committed / name, tmp_path)
    shutil.copytree(committed / "regret" / "doses", tmp_path / "regret" / "doses")
    monkeypatch.setattr(refresh_module, "CASES", {"hoher2022": refresh_module.CASES["hoher2022"]})
    refresh(tmp_path, 1, part)
    assert f"equal    {part}: " in capsys.readouterr().out
    again = refresh_module.PARTS[part].again
    changed = refresh_module.PARTS[part]._replace(again=lambda *a: {k: v + 1 for k, v in again(*a).items()})
    monkeypatch.setattr(refresh_module, "PARTS", {part: changed})
    with pytest.raises(typer.Exit) as left:
        refresh(tmp_path, 1, part)
    assert left.value.exit_code == 1
    assert "numbers that are not the committed ones" in capsys.readouterr().out


def test_a_sample_has_every_tracker_before_any_twice():
    pieces = [Piece("runs", f"{s}{t}{k}", t, ()) for s in "ab" for t in "xyz" for k in range(3)]
    for seed in range(5):
        found = draw(pieces, 7, seed)
        assert len(set(found)) == 7
        assert {p.group for p in found[:3]} == {p.group for p in found[3:6]} == {"x", "y", "z"}
        assert found == draw(pieces, 7, seed)
    assert draw(pieces, 7, 0) != draw(pieces, 7, 1)
    assert set(draw(pieces, 100, 0)) == set(pieces)
