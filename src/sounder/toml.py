"""TOML files: read, and what is wrong with them in one line."""

import tomllib
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError, ValidatorFunctionWrapHandler, WrapValidator

from erm.common.errors import DataError
from erm.common.usage import shortened, wrong


def read_toml(path: Path | str) -> dict[str, Any]:
    """Tables of a TOML file.

    Raises
    ------
    DataError
        The file is missing or not TOML.
    """
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}; expected a TOML file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not TOML ({error})") from None


def describe(error: ValidationError, model: type[BaseModel]) -> str:
    """One line for an error of pydantic: each key by its dotted name, what was found there and what was expected.

    Parameters
    ----------
    error : ValidationError
    model : type
        What was to be made of the file's tables.
    """
    parts: dict[str, str] = {}
    listed: set[str] = set()
    for item in error.errors():
        *inside, last = item["loc"] or ("",)
        where = ".".join(map(str, [*inside, last]))
        if item["type"] == "missing" and isinstance(last, int):  # a tuple that ends too early: one error a place
            where = ".".join(map(str, inside))
            message = f" holds {len(item['input'])} of {last + 1} values"
        elif item["type"] == "missing":
            message = ": missing"
        elif item["type"] == "extra_forbidden":
            hint = _hint(str(last), _table(model, inside))
            message = f": unknown key{'' if hint in listed else hint}"
            listed.add(hint)
        else:
            message = wrong(item)
        parts[where] = f"{where}{message}" if where else message.removeprefix(": ")
    return "; ".join(parts.values())


def _hint(key: str, model: type[BaseModel]) -> str:
    """What an unknown key may have been meant for, or which keys are known there."""
    near = get_close_matches(key, model.model_fields, n=1)
    return f"; did you mean {near[0]}?" if near else f"; known are {', '.join(model.model_fields)}"


def _table(model: type[BaseModel], inside: Sequence[int | str]) -> type[BaseModel]:
    """The table at a place in another."""
    for part in inside:
        if isinstance(part, str) and part in model.model_fields:
            model = next(_models(model.model_fields[part].annotation), model)
    return model


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Tables that a field may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def Alternatives(expected: str) -> WrapValidator:  # noqa: N802 # annotates fields as pydantic's own classes do
    """Where a value may be one of several things, say in one phrase which, instead of what it lacks for each."""

    def validate(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        try:
            return handler(value)
        except ValidationError:
            raise ValueError(f"found {shortened(value)}; expected {expected}") from None

    return WrapValidator(validate)
