"""JSON and TOML with limits on depth."""

import json
import re
import tomllib
from itertools import accumulate
from typing import Any

MAX_DEPTH = 64
"""Deepest nesting of JSON and TOML. Chosen: GeoJSON needs ten, and Python's parsers fail at several hundred."""
MAX_TOML = 2**20
"""Largest TOML file [byte]. Chosen: a description of a sounder is 3 kB; parsing takes seconds for each megabyte."""
MAX_DIGITS = 19
"""Digits of 2**63."""
STRING = re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)
BRACKET = re.compile(r"[\[\]{}]")
DOTTED = re.compile(rf"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{MAX_DEPTH}}}""")


def parse_json(text: str) -> Any:
    """Parse JSON.

    Raises
    ------
    ValueError
        It is not JSON, or is nested too deeply.
    """
    steps = (1 if match[0] in "[{" else -1 for match in BRACKET.finditer(STRING.sub("", text)))
    if max(accumulate(steps), default=0) > MAX_DEPTH:
        raise ValueError(f"more than {MAX_DEPTH} levels of brackets")
    return json.loads(text, parse_int=_whole)


def _whole(text: str) -> int | float:
    """Whole number; one that no integer of 64 bits holds is rounded like a decimal one, perhaps to infinity."""
    return int(text) if len(text) < MAX_DIGITS else float(text)


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML.

    Raises
    ------
    ValueError
        It is not TOML, or is nested too deeply.
    """
    if DOTTED.search(text):
        raise ValueError(f"more than {MAX_DEPTH} levels of keys")
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"more than {MAX_DEPTH} levels of brackets") from None
    level: list[Any] = [tables]
    for _ in range(MAX_DEPTH):
        level = [inner for node in level for inner in (node.values() if isinstance(node, dict) else node)
                 if isinstance(inner, (dict, list))]  # fmt: skip
    if level:
        raise ValueError(f"more than {MAX_DEPTH} levels of tables")
    return tables
