"""The README: short, and its program runs; tests/studies/comparison/test_page.py has its figures."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_the_readme_is_short():
    assert len(README.encode()) <= 6000


def test_the_program_runs(tmp_path):
    code = re.search(r"```python\n(.*?)```", README, re.S).group(1)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "track at" in done.stdout
