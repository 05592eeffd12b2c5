"""Computed numbers as cells of a table."""

from __future__ import annotations

from html import escape
from typing import Any

from cpbench import Point
from cpbench.foundation.matrices import Vector
from lecture import numbers
from lecture.blocks import Html


def words(value: Any) -> Html:
    """Text in which no character is a mark.

    >>> words("<a$b>").markup
    '&lt;a$b&gt;'
    """
    return Html(escape(str(value), quote=False))


def number(value: Any, digits: int = 6) -> Html:
    """A number."""
    return Html(f"<data>{numbers.number(float(value), digits)}</data>")


def vector(values: Vector) -> Html:
    """A vector."""
    return Html(f"<data>{numbers.vector(values)}</data>")


def point(answer: Point) -> Html:
    """The parts of an answer."""
    return Html(f"<data>{numbers.point(answer)}</data>")


def error(value: float | None) -> Html:
    """A measured error, one digit."""
    return Html(f"<data>{numbers.error(value)}</data>")
