"""The texts of reports, from the Markdown files and pages in `templates`."""

import re
from collections.abc import Sequence
from functools import cache
from typing import Any

from jinja2 import DictLoader, Environment, PackageLoader, StrictUndefined, Template

TEXTS = ("sentences.md", "captions.md")
HEADING = re.compile(r"^## (.+)$", re.MULTILINE)


def say(key: str, **values: Any) -> str:
    """The text under a heading of `TEXTS`; KeyError for a heading that is not there."""
    return _texts()[key].render(values).strip()


def page(name: str) -> Template:
    """A page of HTML, in which everything that comes from outside is escaped."""
    return _environment(PackageLoader("testbed.experiments.report", "templates"), html=True).get_template(name)


@cache
def _texts() -> dict[str, Template]:
    loader = PackageLoader("testbed.experiments.report", "templates")
    parts: dict[str, str] = {}
    for file in TEXTS:
        _, *found = HEADING.split(loader.get_source(Environment(autoescape=False), file)[0])
        parts |= {key: text.strip() for key, text in zip(found[::2], found[1::2], strict=True)}
    environment = _environment(DictLoader(parts), html=False)
    return {key: environment.get_template(key) for key in parts}


def _environment(loader: DictLoader | PackageLoader, html: bool) -> Environment:
    found = Environment(loader=loader, autoescape=html, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    found.filters |= {"counted": counted, "listed": listed}
    return found


def counted(n: int, what: str) -> str:
    """A number of things.

    >>> counted(1, "seed"), counted(3, "seed")
    ('1 seed', '3 seeds')
    """
    return f"{n} {what}{'' if n == 1 else 's'}"


def listed(names: Sequence[str], most: int = 4) -> str:
    """Names as a sentence has them; of many, the first ones and how many more.

    >>> listed(["a", "b", "c"]), listed(list("abcdef"))
    ('a, b and c', 'a, b, c and 3 more')
    """
    if len(names) > most:
        return f"{', '.join(names[: most - 1])} and {len(names) - most + 1} more"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def numbered(what: str, names: Sequence[str]) -> tuple[str, str]:
    """Names as a fact: their term, and all of them, behind their number where there are several.

    >>> numbered("tracker", ["a"]), numbered("tracker", ["a", "b"])
    (('tracker', 'a'), ('trackers', '2: a, b'))
    """
    if len(names) == 1:
        return what, names[0]
    return f"{what}s", f"{len(names)}: {', '.join(names)}" if names else "none"


def seeds_text(seeds: Sequence[int]) -> str:
    """Seeds as people write them.

    >>> seeds_text((0, 1, 2, 3)), seeds_text((1, 5))
    ('0 to 3', '1, 5')
    """
    first, last = min(seeds), max(seeds)
    gapless = len(seeds) > 2 and sorted(seeds) == list(range(first, last + 1))
    return f"{first} to {last}" if gapless else ", ".join(map(str, seeds))


def seeds_fact(seeds: Sequence[int]) -> tuple[str, str]:
    """Seeds as a fact, as in `numbered`."""
    return ("seed", str(seeds[0])) if len(seeds) == 1 else ("seeds", f"{len(seeds)}: {seeds_text(seeds)}")
