"""Random mutants of the product, each run against its file's own tests.

    python -m benchmarks.mutants [--seed 1] [--count 60] [--jobs 2] [FILE ...]

A mutant is one change at a point drawn uniformly from drivers, controller and identification, or from the files
given: a comparison or condition negated, a bound of integers made inclusive or exclusive, `and` for `or`, + for -, *
for /, a sign or `not` dropped, a number or an index changed, True for False, None returned. Left out are annotations,
texts, `strict=`, `stacklevel=`, and what makes a class a value (`frozen=`, `eq=`, `slots=`), which `test_values.py`
requires of all. A file's own tests are its package's `test_<file>.py`, and the tests in the mirror of its room
(`tests/unit/<package>/<room>`) that import it by name. A mutant survives if these pass, or if there are none; a time-
out kills. All tests must pass beforehand. The exit status is 1 if less than 80 % are killed.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("drivers", "controller", "identification")
REQUIRED, TIME_LIMIT_S = 0.8, 300
PAIRS: list[tuple[type[ast.AST], type[ast.AST]]] = [
    (ast.Lt, ast.GtE), (ast.Gt, ast.LtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn),
    (ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.And, ast.Or), (ast.BitAnd, ast.BitOr), (ast.LShift, ast.RShift),
]  # fmt: skip
OPPOSITE: dict[type[ast.AST], type[ast.AST]] = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])} | {
    ast.FloorDiv: ast.Mult,
    ast.Pow: ast.Mult,
}
TOUCHING = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
LEFT_OUT = {"strict", "stacklevel", "frozen", "eq", "slots"}


Node = ast.expr | ast.stmt


def changed(node: Node, **fields: object) -> str:
    """Text of a node with other fields."""
    other = copy.copy(node)
    vars(other).update(fields)
    text = ast.unparse(other)
    return text if isinstance(node, ast.stmt) else f"({text})"


def mutations(node: ast.AST) -> Iterator[tuple[Node, str]]:
    """What is replaced at a node, and by which text."""
    match node:
        case ast.Compare(ops=ops, comparators=right):
            for i, op in enumerate(ops):
                yield node, changed(node, ops=[*ops[:i], OPPOSITE[type(op)](), *ops[i + 1 :]])
                if type(op) in TOUCHING and isinstance(getattr(right[i], "value", None), int):
                    yield node, changed(node, ops=[*ops[:i], TOUCHING[type(op)](), *ops[i + 1 :]])
        case ast.BinOp(op=op) | ast.AugAssign(op=op) | ast.BoolOp(op=op) if type(op) in OPPOSITE:
            if not any(isinstance(getattr(part, "value", None), str) for part in ast.walk(node)):
                yield node, changed(node, op=OPPOSITE[type(op)]())
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield node, changed(operand)
        case ast.Constant(value=bool(value)):
            yield node, changed(node, value=not value)
        case ast.Constant(value=int(value)):
            yield node, changed(node, value=value + 1)
        case ast.Constant(value=float(value)):
            yield node, changed(node, value=2.0 * value or 1.0)
        case ast.Return(value=value) if value and not (isinstance(value, ast.Constant) and value.value is None):
            yield value, "None"
        case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
            if not isinstance(test, (ast.Compare, ast.Constant, ast.UnaryOp)):
                yield test, f"(not ({ast.unparse(test)}))"


def points(node: ast.AST) -> Iterator[tuple[Node, str]]:
    """All mutations at and below a node."""
    if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
        return
    yield from mutations(node)
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            left_out = isinstance(child, ast.keyword) and child.arg in LEFT_OUT
            if isinstance(child, ast.AST) and name not in {"annotation", "returns"} and not left_out:
                yield from points(child)


def replaced(source: bytes, node: Node, text: str) -> bytes:
    """A module's source with another text at a node; its columns count bytes."""
    starts = [0, *(at.end() for at in re.finditer(rb"\n", source))]
    begin, end = (
        starts[node.lineno - 1] + node.col_offset,
        starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0),
    )
    return source[:begin] + text.encode() + source[end:]


def own_tests(file: str, tests: dict[str, str]) -> list[str]:
    """Test files of a product file, its own one first: it kills soonest."""
    package, _, *below, name = file.split("/")
    module = ".".join(file.removesuffix(".py").split("/")[1:])
    room = "/".join(["tests/unit", package, *below[:1]]).replace("/armload_core/", "/core/") + "/"
    named = re.compile(rf"^\s*(from|import) {re.escape(module)}\b", re.MULTILINE)
    own = [t for t in tests if t.startswith(f"tests/unit/{package}/") and t.endswith(f"/test_{name}")]
    return own + [t for t, text in tests.items() if t not in own and t.startswith(room) and named.search(text)]


def passed(checkout: Path, tests: list[str]) -> bool:
    """Whether tests pass in a copy of the checkout, whose packages come before the installed ones."""
    path = os.pathsep.join(str(checkout / package) for package in (*PACKAGES, "configs"))
    environment = os.environ | {"PYTHONPATH": path, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"}
    command = ["nice", "-n", "1", sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        run = subprocess.run(
            command, cwd=checkout, env=environment, capture_output=True, timeout=TIME_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return False
    return run.returncode in {0, 5}


def main() -> int:
    """Draw, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("files", nargs="*")
    given = parser.parse_args()
    tracked = subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines()
    tests = {t: (ROOT / t).read_text() for t in tracked if re.match(r"tests/unit/.*/test_\w+\.py$", t)}
    files = given.files or [f for f in tracked if f.startswith(PACKAGES) and f.endswith(".py")]
    sources = {file: (ROOT / file).read_bytes() for file in files}
    every = [(file, *point) for file in files for point in points(ast.parse(sources[file]))]
    drawn = random.Random(given.seed).sample(every, min(given.count, len(every)))
    print(f"seed {given.seed}: {len(drawn)} of {len(every)} mutations of {len(files)} files", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        free: SimpleQueue[Path] = SimpleQueue()
        for job in range(given.jobs):
            copied = Path(folder) / str(job) / "checkout"
            (copied.parent / "shared").parent.mkdir()
            (copied.parent / "shared").symlink_to(ROOT.parent / "shared")
            for file in [*tracked, "identification/armload_core/kernels.abi3.so"]:
                (copied / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / file, copied / file, follow_symlinks=False)
            free.put(copied)

        def killed(number: int) -> bool:
            file, node, text = drawn[number]
            tests_of_it, checkout = own_tests(file, tests), free.get()
            try:
                (checkout / file).write_bytes(replaced(sources[file], node, text))
                os.utime(checkout / file, (number + 1, number + 1))  # byte code of another mutant has another time
                dead = bool(tests_of_it) and not passed(checkout, tests_of_it)
            finally:
                shutil.copy(ROOT / file, checkout / file)
                free.put(checkout)
            line = ast.unparse(node).splitlines()[0]
            word = "killed  " if dead else "survived" if tests_of_it else "untested"
            print(f"{word} {file}:{node.lineno}  {line[:70]}  ->  {text.splitlines()[0][:70]}", flush=True)
            return dead

        with ThreadPoolExecutor(given.jobs) as pool:
            dead = sum(pool.map(killed, range(len(drawn))))
    print(f"{dead} of {len(drawn)} killed, {dead / len(drawn):.0%}")
    return dead < REQUIRED * len(drawn)


if __name__ == "__main__":
    raise SystemExit(main())
