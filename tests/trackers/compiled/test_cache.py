"""The folder of compiled code has another name as soon as any compiled file has another content."""

from pathlib import Path

import pytest

from trackers import compiled


@pytest.mark.parametrize(("name", "same"), [("linear.py", False), ("core.py", True)])
def test_a_change_of_any_compiled_file_takes_another_cache(tmp_path, monkeypatch, name, same):
    for path in Path(compiled.__file__).parent.glob("*.py"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(compiled, "HERE", tmp_path)
    before = compiled.cache_folder.__wrapped__()
    assert before == compiled.cache_folder()
    (tmp_path / name).write_text((tmp_path / name).read_text() + "\n")
    assert (compiled.cache_folder.__wrapped__() == before) is same


def test_the_cache_lies_where_the_environment_says(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert compiled.cache_folder.__wrapped__().parent == tmp_path / "eot-testbed"
