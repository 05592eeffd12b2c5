"""Names with what is set of them: `nsgs[omega=1.2,shuffle=true]`, and lists of such names."""

from __future__ import annotations

from cpbench.errors import CpbenchError


def read(kind: str, text: str) -> tuple[str, dict[str, str]]:
    """Read a name and what is set of it; raises CpbenchError on an item that is none, or is there twice.

    >>> read("solver", "nsgs[omega=1.2,shuffle=true]")
    ('nsgs', {'omega': '1.2', 'shuffle': 'true'})
    """
    name, bracket, rest = text.partition("[")
    if bracket and not rest.rstrip().endswith("]"):
        raise CpbenchError(f"{kind} '{text}': the bracket is not closed; write NAME[option=value,...]")
    given: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in rest.strip().removesuffix("]").split(","))):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not equals or not value:
            raise CpbenchError(f"{kind} '{text}': '{item}' is not an option; write NAME[option=value,...]")
        if key in given:
            raise CpbenchError(f"{kind} '{text}': {key} is given twice, as {given[key]} and {value}")
        given[key] = value
    return name.strip(), given


def split(text: str, separator: str) -> list[str]:
    """Split a list of names at separators that are not within brackets.

    >>> split("fc-lcp-inner[facets=1e+1]+lcp-qp", "+"), split("nsgs[omega=1,shuffle=true], psor", ",")
    (['fc-lcp-inner[facets=1e+1]', 'lcp-qp'], ['nsgs[omega=1,shuffle=true]', 'psor'])
    """
    parts, begin, depth = list[str](), 0, 0
    for k, letter in enumerate(text):
        if letter == "[":
            depth += 1
        elif letter == "]":
            depth -= 1
        elif letter == separator and depth <= 0:
            parts.append(text[begin:k])
            begin = k + 1
    return [part.strip() for part in (*parts, text[begin:])]
