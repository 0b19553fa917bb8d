"""One-line messages for wrong command lines and wrong values."""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typer import BadParameter

MAX_LENGTH = 60
"""Letters of a value that are printed; chosen."""
EXPECTED = {
    "greater_than": "more than {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "less than {lt:g}",
    "less_than_equal": "at most {le:g}",
    "finite_number": "a finite number",
    "literal_error": "{expected}",
    "too_short": "at least {min_length}",
    "too_long": "at most {max_length}",
}
"""Expected values, by type of pydantic's error."""
KINDS = {"float": "a number", "int": "a whole number", "string": "text", "bool": "true or false", "tuple": "a list"}
"""Expected values for types of error such as ``float_type``, ``int_parsing`` or ``int_from_float``."""


def invalid_value(item: Mapping[str, Any]) -> str:
    """Say what was found and what was expected, for one error of pydantic. Messages of validators are kept.

    Parameters
    ----------
    item : mapping
        One entry of ``ValidationError.errors()``.
    """
    expected = EXPECTED.get(item["type"], "").format(**item.get("ctx", {}))
    kind, _, rest = item["type"].partition("_")
    if not expected and rest in ("type", "parsing", "from_float"):
        expected = KINDS.get(kind, "a table" if kind in ("dict", "model") else "")
    if not expected:
        return f": {item['msg'].removeprefix('Value error, ').rstrip('.')}"
    value = item["input"]
    found = f"has the length {len(value)}" if item["type"] in ("too_short", "too_long") else f"is {shortened(value)}"
    return f" {found}; expected {expected}"


def shortened(value: object) -> str:
    """Write a value as Python does, in one line; a long one is cut."""
    text = re.sub(r"\n\s*", " ", repr(value))
    return text if len(text) <= MAX_LENGTH else f"{text[:MAX_LENGTH]}..."


def usage_message(error: "BadParameter") -> str:
    """Say in one line what is wrong with a command line, and where help is.

    Parameters
    ----------
    error : UsageError
        Error of typer. If pydantic caused it, the message says what was found and what was expected.
    """
    message = error.format_message()
    if "\n" in message:  # no command was given: this is the help text
        return message
    if error.ctx is None:
        return message.rstrip(".")
    items: Sequence[Mapping[str, Any]] = getattr(error.__cause__, "errors", list)()
    if items and error.param is not None:
        option = error.param.opts[0] if error.param.opts else error.param.name
        message = f"{option}{invalid_value(items[0])}"
    elif re.match(r"No such option: -\d", message):
        message += "; if it is a number: separate the numbers of one option by spaces, as in --tx 0 0 28.4"
    return f"{message.removeprefix('Invalid value: ').rstrip('.')}; see {error.ctx.command_path} --help"
