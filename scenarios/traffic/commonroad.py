"""Trajectories of a CommonRoad scenario (XML, versions 2018b and 2020a) as columns of a table."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, parse

from scenarios.traffic.layouts import Layout

LAYOUT = Layout(
    "CommonRoad",
    {key: key for key in ("time", "id", "x", "y", "length", "width", "heading", "kind")},
    left=True,
)
SUFFIX = ".xml"
PLACES = {
    "x": "position/point/x", "y": "position/point/y", "heading": "orientation/exact", "time": "time/exact",
}  # fmt: skip
BOX = {"length": "shape/rectangle/length", "width": "shape/rectangle/width"}


def columns_of(path: Path) -> dict[str, list[str]]:
    """The states of all dynamic obstacles with a trajectory, as texts by column; times in seconds.

    Raises:
        ValueError: it is no such file, or an obstacle has no rectangle or no exact state.
    """
    try:
        root = parse(path).getroot()
    except ParseError as error:
        raise ValueError(f"{path.name} is no XML: {error}; give a CommonRoad scenario") from None
    if root.tag != "commonRoad" or "timeStepSize" not in root.attrib:
        raise ValueError(f"{path.name} begins with {root.tag!r}, not with 'commonRoad' and its timeStepSize")
    step = _number(root.attrib["timeStepSize"], "timeStepSize", path.name)
    found: dict[str, list[str]] = {key: [] for key in LAYOUT.columns}
    for obstacle in _obstacles(root):
        name = obstacle.get("id", "")
        fixed = {key: _text(obstacle, place, name, path.name) for key, place in BOX.items()}
        fixed |= {"id": name, "kind": obstacle.findtext("type", "")}
        for state in (*obstacle.findall("initialState"), *obstacle.findall("trajectory/state")):
            row = fixed | {key: _text(state, place, name, path.name) for key, place in PLACES.items()}
            row["time"] = f"{_number(row['time'], f'time of obstacle {name}', path.name) * step:.6f}"
            for key, cell in row.items():
                found[key].append(cell)
    return found


def _obstacles(root: Element) -> Iterator[Element]:
    """Dynamic obstacles of both versions."""
    yield from root.findall("dynamicObstacle")
    yield from (o for o in root.findall("obstacle") if o.findtext("role") == "dynamic")


def _number(text: str, what: str, file: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{file}: {what} is {text!r}; give a number") from None


def _text(element: Element, place: str, name: str, file: str) -> str:
    text = element.findtext(place)
    if text is None:
        raise ValueError(f"{file}: obstacle {name} has no {place}; give one with rectangles and exact states")
    return text
