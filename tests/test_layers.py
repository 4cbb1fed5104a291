"""The house rules of ARCHITECTURE.md and CONTRIBUTING.md that a machine can check, by reading the source only."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "turnbuckle"
MAX_LINES = 400

# Imported where they are used: optional extras, so that a plain install works without them, and mesh readers, whose
# slow import only those pay who read a mesh.
EXTRAS = {
    *("trimesh", "meshio", "polyscope_bindings"),
    *("pytetwild", "tetgen", "pyvista", "vtk", "polyscope", "pxr", "imageio_ffmpeg", "matplotlib", "viser", "dask"),
    *("pymetis", "pypardiso", "pyamg", "ipctk", "newton", "mujoco", "pypbd", "pyPBD"),
    *("fontTools", "manifold3d", "playwright", "websockets"),
}
# Anybody may import the errors: they import nothing.
FOR_ALL = "turnbuckle.data.errors"
# These import inside functions so that `turnbuckle --help` and `import turnbuckle` answer at once.
LAZY = ("turnbuckle/cli/", "turnbuckle/__init__.py", "turnbuckle/__main__.py")

Layers = dict[str, int]  # package -> height; packages on one line have the same


def read_layers(architecture: Path) -> Layers:
    """Heights of the packages listed in the fenced block of the section "Layers", the lowest line is 0."""
    match = re.search(r"^## Layers\n.*?^```\n(.*?)^```", architecture.read_text(), re.DOTALL | re.MULTILINE)
    assert match, f"{architecture.name} has no fenced list in a section '## Layers'"
    lines = match[1].strip().splitlines()
    return {package: height for height, line in enumerate(reversed(lines)) for package in line.split()}


def height_of(module: str, layers: Layers) -> float:
    """Height of a module given by its dotted name. The face of the package is just below `benchmarks` and `cli`."""
    parts = module.split(".")
    if parts == [PACKAGE, "__main__"]:
        return max(layers.values()) + 1
    return layers["scenes"] + 0.5 if len(parts) == 1 else layers[parts[1]]


def imported(node: ast.Import | ast.ImportFrom, file: Path, root: Path) -> Iterator[str]:
    """Dotted names of the modules that an import statement in `file` reads, relative ones made absolute."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
        return
    base = node.module or ""
    if node.level:
        folder = file.relative_to(root).parent.parts
        base = ".".join([*folder[: len(folder) - node.level + 1], *([base] if base else [])])
    for alias in node.names:
        inner = root.joinpath(*base.split("."), alias.name)
        yield f"{base}.{alias.name}" if inner.is_dir() or inner.with_suffix(".py").is_file() else base


def imports(tree: ast.AST, inside: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """All import statements, each with whether it stands inside a function."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, inside
        yield from imports(node, inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))


def check_imports(file: Path, root: Path, layers: Layers) -> Iterator[str]:
    name = file.relative_to(root).as_posix()
    own = name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    package = own.split(".")[1] if "." in own else None
    if package is not None and package not in layers and package != "__main__":
        yield f"{name}: package '{package}' is not in the list of layers of ARCHITECTURE.md"
        return
    for node, inside in imports(ast.parse(file.read_text())):
        for target in dict.fromkeys(imported(node, file, root)):
            top, *rest = target.split(".")
            if inside and top not in EXTRAS and not name.startswith(LAZY):
                yield f"{name}:{node.lineno}: import of {target} inside a function; move it to the top of the file"
            if top != PACKAGE or target == FOR_ALL or (rest and rest[0] == package):
                continue
            if rest and rest[0] not in layers:
                yield f"{name}:{node.lineno}: {target} is in no layer of ARCHITECTURE.md"
            elif height_of(target, layers) >= height_of(own, layers):
                yield f"{name}:{node.lineno}: {own} imports {target}, which is not below it"


def is_kernel(node: ast.AST) -> bool:
    if not isinstance(node, ast.FunctionDef):
        return False
    names = (ast.unparse(d.func if isinstance(d, ast.Call) else d) for d in node.decorator_list)
    return any(name in ("wp.kernel", "warp.kernel", "kernel") for name in names)


def check_kernels(file: Path, root: Path) -> Iterator[str]:
    name = file.relative_to(root).as_posix()
    for node in filter(is_kernel, ast.walk(ast.parse(file.read_text()))):
        if not ast.get_docstring(node):
            yield f"{name}:{node.lineno}: kernel {node.name} has no docstring"
        if [a.arg for a in node.args.args][:1] != ["begin"]:
            yield f"{name}:{node.lineno}: the first parameter of kernel {node.name} is not 'begin'"


def check_form(file: Path, root: Path) -> Iterator[str]:
    name = file.relative_to(root).as_posix()
    count = len(file.read_text().splitlines())
    if count > MAX_LINES:
        yield f"{name}: {count} lines, more than {MAX_LINES}; split it by concept"
    if file.name == "utils.py":
        yield f"{name}: name the file after its concept"


def violations(root: Path) -> list[str]:
    layers = read_layers(root / "ARCHITECTURE.md")
    found: list[str] = []
    for file in sorted((root / PACKAGE).rglob("*.py")):
        found += [*check_imports(file, root, layers), *check_kernels(file, root), *check_form(file, root)]
    for folder in ("tests", "benchmarks"):
        for file in sorted((root / folder).rglob("*.py")):
            found += check_form(file, root)
    return found


def test_house_rules() -> None:
    assert len(list((ROOT / PACKAGE).rglob("*.py"))) > 20, "the checker looks in the wrong place"
    found = violations(ROOT)
    assert not found, "\n" + "\n".join(found)


def test_every_layer_exists() -> None:
    missing = [package for package in read_layers(ROOT / "ARCHITECTURE.md") if not (ROOT / PACKAGE / package).is_dir()]
    assert not missing, f"ARCHITECTURE.md lists packages that do not exist: {missing}"


# The checker itself, on made-up trees.

LIST = "# A\n\n```\nnot this\n```\n\n## Layers\n\nwords\n\n```\ncli\nscenes\nio viewer\ndata\nmath\n```\n"
KERNEL = '@wp.kernel\ndef k(begin: int, x: wp.array(dtype=float)):\n    """Doc."""\n'


def judge(tmp_path: Path, **files: str) -> list[str]:
    """Violations in a tree with `files`, whose keys are paths with '__' for '/' and without '.py'."""
    (tmp_path / "ARCHITECTURE.md").write_text(LIST)
    for package in ("cli", "scenes", "io", "viewer", "data", "math"):
        (tmp_path / PACKAGE / package).mkdir(parents=True)
        (tmp_path / PACKAGE / package / "__init__.py").write_text("")
    for name in ("data/errors", "math/vec", "data/model", "io/npz"):
        (tmp_path / PACKAGE / f"{name}.py").write_text("")
    for name, text in files.items():
        (tmp_path / PACKAGE / f"{name.replace('__', '/')}.py").write_text(text)
    return violations(tmp_path)


def test_list_is_read(tmp_path: Path) -> None:
    (tmp_path / "A.md").write_text(LIST)
    assert read_layers(tmp_path / "A.md") == {"cli": 4, "scenes": 3, "io": 2, "viewer": 2, "data": 1, "math": 0}


GOOD = {
    "downward": dict(io__b="from turnbuckle.data.model import Model\nimport turnbuckle.math.vec\n"),
    "own package, relative": dict(io__b="from .npz import write\nfrom . import npz\nfrom ..data import model\n"),
    "errors from the bottom": dict(math__b="from turnbuckle.data.errors import InputError\n"),
    "errors as a module": dict(math__b="from turnbuckle.data import errors\n"),
    "extra inside a function": dict(viewer__b="def f():\n    import polyscope as ps\n    from pxr import Usd\n"),
    "lazy command": dict(cli__b="def run():\n    from turnbuckle.scenes import x\n    import numpy\n"),
    "face": dict(cli__b="import turnbuckle\nfrom turnbuckle import Scene\n"),
    "kernel": dict(math__b=KERNEL),
    "400 lines": dict(math__b="\n" * 400),
}


@pytest.mark.parametrize("files", GOOD.values(), ids=GOOD)
def test_checker_accepts(tmp_path: Path, files: dict[str, str]) -> None:
    assert judge(tmp_path, **files) == []


BAD = {
    "upward": (dict(data__b="from turnbuckle.io.npz import write\n"), "not below"),
    "upward, plain": (dict(data__b="import turnbuckle.io.npz\n"), "not below"),
    "upward, relative": (dict(data__b="from ..io import npz\n"), "not below"),
    "upward, package from the face": (dict(data__b="from turnbuckle import io\n"), "not below"),
    "upward, in a function": (dict(data__b="def f():\n    from turnbuckle.io import npz\n"), "not below"),
    "upward, under a condition": (dict(data__b="if True:\n    from turnbuckle.io import npz\n"), "not below"),
    "sideways": (dict(viewer__b="from turnbuckle.io.npz import write\n"), "not below"),
    "the face from below": (dict(io__b="from turnbuckle import Scene\n"), "not below"),
    "data, not its errors, from the bottom": (dict(math__b="from turnbuckle.data.model import M\n"), "not below"),
    "unknown target": (dict(io__b="import turnbuckle.physics\n"), "in no layer"),
    "hidden": (dict(io__b="def f():\n    import numpy\n"), "inside a function"),
    "hidden in a method": (dict(io__b="class A:\n    def f(self):\n        import numpy\n"), "inside a function"),
    "kernel without docstring": (dict(math__b=KERNEL.replace('"""Doc."""', "pass")), "no docstring"),
    "kernel without begin": (dict(math__b=KERNEL.replace("begin: int, ", "")), "not 'begin'"),
    "kernel with options": (dict(math__b='@wp.kernel(module="m")\ndef k(n: int):\n    """D."""\n'), "not 'begin'"),
    "long": (dict(math__b="\n" * 401), "401 lines"),
    "utils": (dict(math__utils=""), "after its concept"),
}


@pytest.mark.parametrize(("files", "message"), BAD.values(), ids=BAD)
def test_checker_refuses(tmp_path: Path, files: dict[str, str], message: str) -> None:
    found = judge(tmp_path, **files)
    assert any(message in line for line in found), found


def test_checker_refuses_a_package_outside_the_list(tmp_path: Path) -> None:
    (tmp_path / PACKAGE / "extra").mkdir(parents=True)
    assert "'extra' is not in the list" in judge(tmp_path, extra__b="x = 1\n")[0]
