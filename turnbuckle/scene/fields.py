"""Types of the fields of a scene: checked numbers, names and NumPy arrays, for pydantic.

Every type refuses what YAML or Python could pass by accident: a bool or a string for a number, NaN, infinity, a ragged
list, an array of the wrong shape. Arrays come out as read-only copies (float64 or int32), so a definition is constant.
"""

from __future__ import annotations

import numbers
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo
from pydantic_core import PydanticCustomError, core_schema

COUNT_LIMIT = 10_000_000  # largest count a scene may ask for in one number: guards against typing errors, not memory
NUMBER_LIMIT = 1e30  # largest number: products of two or three of them must not overflow while a scene is built
ARRAY_LIMIT = 1e12  # largest number in an array of positions, velocities, times
_INT32_MAX = 2**31 - 1


def describe(value: Any) -> str:
    """A short name of a value for an error message, such as `the text 'abc'` or `a list of 4`."""
    if value is None:
        return "nothing"
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"the text {value[:40]!r}"
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (int, float)):
        return f"{value:.6g}" if isinstance(value, float) or abs(value) < 10**15 else "a very large integer"
    return f"a {type(value).__name__}"


def _fail(message: str, at: tuple[int, ...] = ()) -> PydanticCustomError:
    """An error of one sentence; `at` are the indices inside an array."""
    # The message is a template to pydantic: the text goes in as a value, so that braces in it are harmless.
    return PydanticCustomError("turnbuckle", "{text}", {"text": message, "at": at})


def _number(value: Any) -> float:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise _fail(f"expected a number, got {describe(value)}")
    try:
        result = float(value)
    except OverflowError:
        result = float("inf")
    if not np.isfinite(result):
        raise _fail(f"expected a finite number, got {result}")
    if abs(result) > NUMBER_LIMIT:
        raise _fail(f"expected a number between -{NUMBER_LIMIT:g} and {NUMBER_LIMIT:g}, got {result:g}")
    return result


def _integer(value: Any) -> int:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Integral):
        raise _fail(f"expected a whole number, got {describe(value)}")
    return int(value)


def _flag(value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise _fail(f"expected true or false, got {describe(value)}")
    return bool(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise _fail(f"expected text, got {describe(value)}")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise _fail("expected text, got characters that UTF-8 cannot hold") from None
    if "\0" in value:
        raise _fail("expected text, got a zero character in it")
    return str(value)


def _mesh_path(value: Any) -> Any:
    return str(value) if isinstance(value, Path) else value


def _sequence_exists(value: str, info: ValidationInfo) -> str:
    """A sequence of meshes, a file or a folder, must be there when the scene is read."""
    folder = (info.context or {}).get("folder")
    if folder is not None:
        path = Path(folder) / value
        try:
            found = path.exists()
        except (OSError, ValueError):
            found = False
        if not found:
            raise _fail(f"there is no file or folder {str(path)!r}")
    return value


def _mesh_exists(value: str, info: ValidationInfo) -> str:
    """A mesh must be there when the scene is read; without a `folder` in the context nothing is looked up."""
    folder = (info.context or {}).get("folder")
    if folder is not None:
        path = Path(folder) / value
        try:
            found, is_folder = path.is_file(), path.is_dir()
        except (OSError, ValueError):
            found, is_folder = False, False
        if not found:
            raise _fail(
                f"{str(path)!r} is a folder, not a mesh file" if is_folder else f"there is no file {str(path)!r}"
            )
    return value


# Bounds stand before the validator that runs first, so that they stay visible in the JSON Schema.
Number = Annotated[float, BeforeValidator(_number)]
Positive = Annotated[float, Field(gt=0), BeforeValidator(_number)]
NonNegative = Annotated[float, Field(ge=0), BeforeValidator(_number)]
Fraction = Annotated[float, Field(gt=0, le=1), BeforeValidator(_number)]
Integer = Annotated[int, BeforeValidator(_integer)]
Count = Annotated[int, Field(ge=1, le=COUNT_LIMIT), BeforeValidator(_integer)]
Corners = Annotated[int, Field(ge=3, le=10_000), BeforeValidator(_integer)]
Index = Annotated[int, Field(ge=0, le=_INT32_MAX), BeforeValidator(_integer)]
Flag = Annotated[bool, BeforeValidator(_flag)]
Text = Annotated[str, Field(min_length=1, max_length=1000), BeforeValidator(_text)]
MeshPath = Annotated[Text, BeforeValidator(_mesh_path), AfterValidator(_mesh_exists)]
SequencePath = Annotated[Text, BeforeValidator(_mesh_path), AfterValidator(_sequence_exists)]
Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^\w[\w.\-]*$"), BeforeValidator(_text)]


@dataclass(frozen=True)
class ArraySpec:
    """Pydantic annotation of a NumPy array.

    `shapes`: the shapes allowed, None where any length of at least 1 is; `dtype` float64 or int32 (int32 values must
    not be negative); `low` and `high`: inclusive bounds of the values (`above`: exclusive).
    A text `file.npz#key` or `file.npy` is read by the function `load_array` of the validation context, when there is
    one: scene files have it.
    """

    shapes: tuple[tuple[int | None, ...], ...]
    dtype: Any = np.float64
    low: float | None = None
    high: float | None = None
    above: float | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(
            self.validate,
            serialization=core_schema.plain_serializer_function_ser_schema(lambda a: a.tolist(), when_used="json"),
        )

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        options = [self._json_schema(shape) for shape in self.shapes]
        if any(None in shape for shape in self.shapes):
            options.append({"type": "string", "pattern": r"\.(npz#.+|npy)$"})
        return options[0] if len(options) == 1 else {"anyOf": options}

    def _json_schema(self, shape: tuple[int | None, ...]) -> dict[str, Any]:
        item: dict[str, Any] = {"type": "integer", "minimum": 0} if self.dtype == np.int32 else {"type": "number"}
        for key, bound in (("minimum", self.low), ("maximum", self.high), ("exclusiveMinimum", self.above)):
            if bound is not None:
                item[key] = bound
        for length in reversed(shape):
            item = {"type": "array", "items": item, "minItems": length or 1}
            if length is not None:
                item["maxItems"] = length
        return item

    def shape_text(self) -> str:
        """The allowed shapes in words, such as `(n, 3)`."""
        letters = "nmk"
        texts = []
        for shape in self.shapes:
            free = iter(letters)
            sizes = ", ".join(str(size) if size is not None else next(free) for size in shape)
            texts.append(f"({sizes},)" if len(shape) == 1 else f"({sizes})")
        return " or ".join(texts)

    def validate(self, value: Any, info: ValidationInfo | None = None) -> np.ndarray:
        """Read-only C-contiguous copy of `value`; a `PydanticCustomError` says what is wrong and where."""
        if isinstance(value, str):
            load = (info.context or {}).get("load_array") if info is not None else None
            if load is None:
                raise _fail(f"expected an array of shape {self.shape_text()}, got {describe(value)}")
            value = load(value)
        if isinstance(value, (list, tuple)):
            self._check_list(value, (), max(len(shape) for shape in self.shapes))
        elif not isinstance(value, np.ndarray):
            raise _fail(f"expected an array of shape {self.shape_text()}, got {describe(value)}")
        try:
            array = np.asarray(value)
        except (ValueError, OverflowError):
            raise _fail(f"expected an array of shape {self.shape_text()}, got rows of different lengths") from None
        kinds = "iu" if self.dtype == np.int32 else "iuf"
        if array.dtype.kind not in kinds and array.size:
            what = "whole numbers" if self.dtype == np.int32 else "numbers"
            raise _fail(f"expected an array of {what}, got {describe(array)}")
        if not any(self._fits(array.shape, shape) for shape in self.shapes):
            raise _fail(f"expected an array of shape {self.shape_text()}, got one of shape {array.shape}")
        if self.dtype == np.int32:
            self._refuse((array < 0) | (array > _INT32_MAX), array, "expected indices of 0 or more")
        array = np.array(array, dtype=self.dtype, order="C", copy=True)
        self._check_values(array)
        array.setflags(write=False)
        return array

    @staticmethod
    def _fits(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
        return len(shape) == len(wanted) and all(
            size >= 1 if want is None else size == want for size, want in zip(shape, wanted, strict=True)
        )

    def _check_list(self, value: Any, at: tuple[int, ...], depth: int) -> None:
        """Refuse leaves that NumPy would convert in silence (true, text) and nesting deeper than any shape."""
        for i, item in enumerate(value):
            if isinstance(item, (list, tuple)):
                if depth <= 1:
                    raise _fail(f"expected an array of shape {self.shape_text()}, got deeper nested lists", (*at, i))
                self._check_list(item, (*at, i), depth - 1)
            elif isinstance(item, (bool, np.bool_)) or not isinstance(item, (numbers.Real, np.ndarray)):
                raise _fail(f"expected a number, got {describe(item)}", (*at, i))

    def _check_values(self, array: np.ndarray) -> None:
        self._refuse(~np.isfinite(array), array, "expected finite numbers")
        if self.dtype != np.int32:
            limits = f"expected numbers between -{ARRAY_LIMIT:g} and {ARRAY_LIMIT:g}"
            self._refuse(np.abs(array) > ARRAY_LIMIT, array, limits)
        if self.low is not None:
            self._refuse(array < self.low, array, f"expected numbers of at least {self.low:g}")
        if self.above is not None:
            self._refuse(array <= self.above, array, f"expected numbers greater than {self.above:g}")
        if self.high is not None:
            self._refuse(array > self.high, array, f"expected numbers of at most {self.high:g}")

    @staticmethod
    def _refuse(bad: np.ndarray, array: np.ndarray, message: str) -> None:
        if bad.any():
            at = tuple(int(i) for i in np.argwhere(bad)[0])
            raise _fail(f"{message}, got {array[at]} at index {list(at)}", at)


Vec3 = Annotated[np.ndarray, ArraySpec(((3,),))]
Size2 = Annotated[np.ndarray, ArraySpec(((2,),), above=0.0)]
Size3 = Annotated[np.ndarray, ArraySpec(((3,),), above=0.0)]
Cells2 = Annotated[np.ndarray, ArraySpec(((2,),), np.int32, low=1, high=COUNT_LIMIT)]
Cells3 = Annotated[np.ndarray, ArraySpec(((3,),), np.int32, low=1, high=COUNT_LIMIT)]
Color = Annotated[np.ndarray, ArraySpec(((3,),), low=0.0, high=1.0)]
Positions = Annotated[np.ndarray, ArraySpec(((None, 3),))]
PositionOrPositions = Annotated[np.ndarray, ArraySpec(((3,), (None, 3)))]
Times = Annotated[np.ndarray, ArraySpec(((None,),))]
KeyPositions = Annotated[np.ndarray, ArraySpec(((None, 3), (None, None, 3)))]
Frames = Annotated[np.ndarray, ArraySpec(((None, None, 3),))]
Indices = Annotated[np.ndarray, ArraySpec(((None,),), np.int32)]
Lines = Annotated[np.ndarray, ArraySpec(((None, 2),), np.int32)]
Triangles = Annotated[np.ndarray, ArraySpec(((None, 3),), np.int32)]
Tetrahedra = Annotated[np.ndarray, ArraySpec(((None, 4),), np.int32)]
Line = Annotated[np.ndarray, ArraySpec(((2,),), np.int32)]
Triangle = Annotated[np.ndarray, ArraySpec(((3,),), np.int32)]
Elements = Annotated[np.ndarray, ArraySpec(((None, 2), (None, 3), (None, 4)), np.int32)]
Weights = Annotated[np.ndarray, ArraySpec(((None, 2), (None, 3), (None, 4)))]
Bounds = Annotated[np.ndarray, ArraySpec(((2, 3),))]


def zeros3() -> np.ndarray:
    """A read-only zero vector, the default of vector fields."""
    zero = np.zeros(3)
    zero.setflags(write=False)
    return zero
