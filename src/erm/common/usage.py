"""What is wrong with a command as it was typed, or with a value, in one line."""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typer import BadParameter

LONGEST = 60
"""Letters of a value that are shown."""
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
"""What pydantic wanted, by the type of its error."""
KINDS = {"float": "a number", "int": "a whole number", "string": "text", "bool": "true or false", "tuple": "a list"}
"""What pydantic wanted where the type of its error begins so and ends with ``type``, ``parsing`` or ``from_float``."""


def wrong(item: Mapping[str, Any]) -> str:
    """What was found and what was expected instead, of one of pydantic's errors; what has words of its own keeps them.

    Parameters
    ----------
    item : mapping
        Of the errors that a ``ValidationError`` lists.
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
    """A value as Python writes it, its end left out where that is long."""
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def told(error: "BadParameter") -> str:
    """One line for what a command line refuses: what is wrong, what was found, where help is.

    Parameters
    ----------
    error : UsageError
        Of typer. Where it stands for an error of pydantic, it says what was expected and not what was found.
    """
    message = error.format_message()
    if "\n" in message:  # the whole help, for want of a command
        return message
    if error.ctx is None:
        return message.rstrip(".")
    items: Sequence[Mapping[str, Any]] = getattr(error.__cause__, "errors", list)()
    if items and error.param is not None:
        option = error.param.opts[0] if error.param.opts else error.param.name
        message = f"{option}{wrong(items[0])}"
    elif re.match(r"No such option: -\d", message):
        message += "; is it a number? Those of one option are parted by spaces, as in --tx 0 0 28.4"
    return f"{message.removeprefix('Invalid value: ').rstrip('.')}; see {error.ctx.command_path} --help"
