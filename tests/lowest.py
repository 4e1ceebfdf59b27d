"""The oldest environment that pyproject.toml allows, as pip constraints on stdout; `make test-lowest` installs it.

What users install with us has the version of its floor; the tools of the tests, and what our dependencies bring
themselves, have their pins.
"""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)(\[[\w,-]+\])?>=(?P<floor>[\d.]+)(,<[\d.]+)?")
TOOLS = ("dev", "docs")  # extras for those who work on the project


def floors(requirements: list[str]) -> dict[str, str]:
    """Name in lower case -> lowest version; raises ValueError for a requirement without one."""
    found = {}
    for requirement in requirements:
        match = REQUIREMENT.fullmatch(requirement)
        if match is None:
            raise ValueError(f"{requirement!r} has no floor; write NAME>=VERSION")
        found[match["name"].lower()] = match["floor"]
    return found


def constraints() -> dict[str, str]:
    """Name in lower case -> version of every package of the oldest environment."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].items()
    ours = project["dependencies"] + [r for extra, wanted in extras if extra not in TOOLS for r in wanted]
    pins = dict(line.lower().split("==") for line in (ROOT / "constraints.txt").read_text().splitlines())
    return pins | floors(ours)


if __name__ == "__main__":
    print(*(f"{name}=={version}" for name, version in constraints().items()), sep="\n")
