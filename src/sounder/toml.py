"""TOML files: reader, base class of all tables, and one-line error messages."""

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Self, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

from erm.common.errors import DataError
from erm.common.gate.nesting import MAX_TOML, parse_toml
from erm.common.text_files import read_text
from erm.common.usage import invalid_value, shortened

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
MOST_DECIBELS = 1000.0
"""Largest level that is taken [dB], either way: products of three such powers are still floating-point numbers."""
Decibels = Annotated[float, Field(ge=-MOST_DECIBELS, le=MOST_DECIBELS)]
NotNegativeDecibels = Annotated[float, Field(ge=0, le=MOST_DECIBELS)]


def _beside(path: Path, info: ValidationInfo) -> Path:
    return path if info.context is None else Path(info.context).parent / path


RelativePath = Annotated[Path, AfterValidator(_beside)]
"""A file or folder, named relative to the folder of the TOML file."""


class Table(BaseModel):
    """A TOML table: unknown keys are errors, numbers are finite, values cannot change."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def from_tables(cls, tables: Any, source: Path | str, *, file: Path | None = None) -> Self:
        """Validate what was read from a TOML file.

        Parameters
        ----------
        tables : dict
            Nested tables.
        source : path or str
            Named in errors.
        file : Path, optional
            The file. Paths in it are relative to its folder.

        Raises
        ------
        DataError
            A key is unknown or missing, or a value does not fit. The message is one line and names the key.

        Examples
        --------
        >>> class Link(Table):
        ...     distance: Positive
        >>> Link.from_tables({"distance": -1.0}, "link.toml")
        Traceback (most recent call last):
        erm.common.errors.DataError: link.toml: distance is -1.0; expected more than 0
        >>> Link.from_tables({"distances": 1.0}, "link.toml")
        Traceback (most recent call last):
        erm.common.errors.DataError: link.toml: distance: missing; distances: unknown key; did you mean distance?
        """
        try:
            return cls.model_validate(tables, context=file)
        except ValidationError as error:
            raise DataError(f"{source}: {describe(error, cls)}") from None


def read_toml(path: Path | str) -> dict[str, Any]:
    """Read the tables of a TOML file.

    Raises
    ------
    DataError
        The file is missing or not TOML.
    """
    text = read_text(path, "a TOML file", limit=MAX_TOML)
    try:
        return parse_toml(text)
    except ValueError as error:
        raise DataError(f"{path}: not TOML ({error})") from None


def file_inside(description: Path, name: str, key: str) -> Path:
    """File that a key of a TOML file names. The TOML file may come from others, so it names no files elsewhere.

    Raises
    ------
    DataError
        The file is not in the folder of the TOML file or below.
    """
    folder = description.parent
    file = folder / name
    if Path(name).is_absolute() or not file.resolve().is_relative_to(folder.resolve()):
        raise DataError(f"{description}: {key}: {name} is not in the folder of this file; copy it there")
    return file


def describe(error: ValidationError, model: type[BaseModel]) -> str:
    """Describe an error of pydantic in one line: each key by its dotted name, what was found and what was expected.

    Parameters
    ----------
    error : ValidationError
    model : type
        The model of the whole file.
    """
    parts: dict[str, str] = {}
    hints: set[str] = set()
    for item in error.errors():
        # a part in angle brackets is the kind of a table, not a key
        *parents, last = [part for part in item["loc"] if not str(part).startswith("<")] or [""]
        key = ".".join(map(str, [*parents, last]))
        if item["type"] == "missing" and isinstance(last, int):  # a tuple that is too short has an error for each place
            key = ".".join(map(str, parents))
            message = f" holds {len(item['input'])} of {last + 1} values"
        elif item["type"] == "missing":
            message = ": missing"
        elif item["type"] == "extra_forbidden":
            hint = _hint(str(last), _table_at(model, parents))
            message = f": unknown key{'' if hint in hints else hint}"
            hints.add(hint)
        else:
            message = invalid_value(item)
        parts[key] = f"{key}{message}" if key else message.removeprefix(": ")
    return "; ".join(parts.values())


def _hint(key: str, model: type[BaseModel]) -> str:
    """Suggest a known key in place of an unknown one, or list the known keys."""
    near = get_close_matches(key, model.model_fields, n=1)
    return f"; did you mean {near[0]}?" if near else f"; known are {', '.join(model.model_fields)}"


def _table_at(model: type[BaseModel], parents: Sequence[int | str]) -> type[BaseModel]:
    """Model of a nested table."""
    for part in parents:
        if isinstance(part, str) and part in model.model_fields:
            model = next(_models(model.model_fields[part].annotation), model)
    return model


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Models that a field may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def Alternatives(expected: str) -> WrapValidator:  # noqa: N802 # annotates fields as pydantic's own classes do
    """For a value that may be one of several things: one error that says which, not one error for each."""

    def validate(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        try:
            return handler(value)
        except ValidationError:
            raise ValueError(f"found {shortened(value)}; expected {expected}") from None

    return WrapValidator(validate)
