"""The numbers that filters and the multi-object tracker are built with, checked where they are built."""

from collections.abc import Collection
from dataclasses import fields
from math import inf
from numbers import Integral, Real
from typing import Any


def check_numbers(
    record: Any, positive: Collection[str] = (), signed: Collection[str] = (), unlimited: Collection[str] = ()
) -> None:
    """Raise ValueError, which names the field, unless every number in the fields of a dataclass makes sense.

    Numbers, also those in tuples, must be finite and not negative, and whole where the type of the field is int. In
    addition those of the fields `positive` must not be 0; those of `signed` may be negative, of `unlimited` infinite.
    """
    for field in fields(record):
        name, value = field.name, getattr(record, field.name)
        numbers: tuple[Any, ...] = value if isinstance(value, tuple) else (value,)
        if field.type not in (int, float) and not all(isinstance(x, Real) for x in numbers):
            continue  # text or another record
        kind: Any = Integral if field.type is int else Real
        for x in numbers:
            of_size = isinstance(x, kind) and (abs(x) < inf or name in unlimited)
            if not (of_size and (x > 0 or (x == 0 and name not in positive) or name in signed)):
                what = "whole number" if kind is Integral else "number" if name in unlimited else "finite number"
                least = "" if name in signed else " > 0" if name in positive else " >= 0"
                raise ValueError(f"{type(record).__name__}.{name} must be a {what}{least}, got {value!r}")
