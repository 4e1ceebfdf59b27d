"""Committed results made again: a number that is another is shown."""

import shutil

import pytest
import typer

from studies.comparison import refresh as refresh_module
from studies.comparison.refresh import KEPT, Piece, draw, main
from tests.studies.comparison.conftest import DOCS


def refresh(results, sample, part):
    main(results=results, part=[part], sample=sample, seed=0, jobs=1, keep=False)


@pytest.mark.parametrize(
    "part", ["papers", *(pytest.param(part, marks=pytest.mark.slow) for part in ("drives", "probes"))]
)
def test_each_part_is_repeated_and_a_changed_number_of_it_is_shown(part, tmp_path, capsys, monkeypatch):
    committed = DOCS / "results"
    for name in ("probes.json", KEPT):
        shutil.copy(committed / name, tmp_path)
    shutil.copytree(committed / "regret" / "doses", tmp_path / "regret" / "doses")
    shutil.copy(committed / "regret" / "about.txt", tmp_path / "regret")
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
