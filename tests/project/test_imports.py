"""What may import what: `import segar` stays light, and imports point from analysis to experiments to segar."""

import ast
import importlib.metadata
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.places import ROOT, sources
from tests.project.rooms import PACKAGES, all_imports

# What a user of the simulator does not pay for. `ot` is POT: 5 s, and torch with it unless told otherwise.
HEAVY = {"torch", "tensordict", "torchrl", "hydra", "omegaconf", "mlflow", "matplotlib", "pandas", "ot"}
HEAVY |= {"numba", "scipy", "pygame", "imageio", "minari", "pyarrow", "h5py", "PIL"}
HEAVY |= {"stable_baselines3", "starlette", "uvicorn"}

MOST_OF_OURS = 20  # modules that `import segar` loads

TORCH = ("torch", "torchrl", "tensordict")
THE_TORCH_FILES = ("segar/envs/torchrl_env.py", "segar/envs/device_episodes.py")
THE_ONLY_MATPLOTLIB_FILE = "segar/cli/figures.py"
PLACES_WITH_AN_EXTRA = {
    "segar/lab/mcp_server.py": "lab",
    "segar/cli/": "render",
    "segar/rendering/": "render",
    "segar/datasets/": "datasets",
    "segar/textures/": "filters",
    "segar/envs/sb3_env.py": "sb3",
    "segar/policies/onnx_policy.py": "onnx",
    "segar/support/yaml_text.py": "train",
    "segar/support/parquet.py": "train",
    "segar/playground/server.py": "studio",
}

# The extras of pyproject.toml that a package may count on, besides the core dependencies.
EXTRAS = {"segar": (), "experiments": ("train", "ui", "search"), "analysis": ("train", "analysis")}


def test_what_users_do_first_loads_nothing_heavy():
    """One process does one thing after the other, and says each time what it has loaded."""
    alone, shown, measured, reported = modules_loaded_by(
        "import segar",
        "segar.family('empty-easy')._repr_html_()",
        "sample = segar.family('empty-hard').sample\nsegar.metrics.w2(sample(3), sample(4), mode='exact')",
        "import segar.analysis.collect, segar.analysis.gap_plot, segar.analysis.report.make",
    )
    assert not HEAVY & alone, "import them inside the function that needs them"
    own = sorted(name for name in alone if is_within(name, "segar"))
    assert len(own) <= MOST_OF_OURS, f"`import segar` loads {len(own)} modules of ours: {', '.join(own)}"
    assert not {"torch", "pygame"} & shown
    assert "torch" not in measured, "POT brought torch: set POT_BACKEND_DISABLE_PYTORCH before `import ot`"
    assert "torch" not in reported, "what reads results imports what trains"


def test_no_import_is_wrapped_in_try():
    wrong = [
        f"{place_of(path, statement)}: an import in a `try` that swallows its failure; declare the dependency"
        for package in PACKAGES
        for path in sources(package)
        for statement in guarded_imports(ast.parse(path.read_text(), str(path)))
    ]
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_is_declared_in_pyproject(package):
    providers = importlib.metadata.packages_distributions()
    wrong = []
    for place, name in imports_from(package):
        top = name.partition(".")[0]
        if top in sys.stdlib_module_names or top in PACKAGES:
            continue
        extras = EXTRAS[package]
        extras += ("train",) if place.startswith(THE_TORCH_FILES) else ()
        extras += ("analysis",) if place.startswith(THE_ONLY_MATPLOTLIB_FILE) else ()
        extras += tuple(extra for where, extra in PLACES_WITH_AN_EXTRA.items() if place.startswith(where))
        of_others = package == "segar" and top in TORCH and not place.startswith(THE_TORCH_FILES)
        if of_others or not declared(extras) & {normalized(dist) for dist in providers.get(top, [top])}:
            where = " or ".join(["dependencies", *(f"the extra '{extra}'" for extra in extras if not of_others)])
            wrong.append(f"{place}: imports {top}, which pyproject.toml does not list in {where}")
    assert not wrong, "\n" + "\n".join(wrong)


def modules_loaded_by(*steps: str) -> list[set[str]]:
    """Names of all modules that a fresh interpreter holds after each of these steps."""
    code = "\n".join(f"{step}\nimport json, sys; print(json.dumps(sorted(sys.modules)))" for step in steps)
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, f"this failed:\n{code}\n{run.stderr}"
    return [set(json.loads(line)) for line in run.stdout.splitlines()]


def imports_from(package: str) -> Iterator[tuple[str, str]]:
    """(place, imported module) of every import in the package."""
    for one in all_imports():
        if one.place.startswith(f"{package}/"):
            yield one.place, one.target


def guarded_imports(tree: ast.AST) -> Iterator[ast.AST]:
    """Imports inside a `try`, or a `with suppress`, that would swallow an ImportError."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Try) and any(catches_import_error(handler.type) for handler in node.handlers):
            guarded = node.body
        elif isinstance(node, ast.With) and any("suppress" in ast.unparse(item.context_expr) for item in node.items):
            guarded = node.body
        else:
            continue
        for statement in guarded:
            yield from (inner for inner in ast.walk(statement) if isinstance(inner, ast.Import | ast.ImportFrom))


def catches_import_error(caught: ast.expr | None) -> bool:
    too_wide = {"ImportError", "ModuleNotFoundError", "Exception", "BaseException"}
    return caught is None or bool(too_wide & {n.id for n in ast.walk(caught) if isinstance(n, ast.Name)})


def is_within(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def place_of(path: Path, node: ast.AST) -> str:
    return f"{path.relative_to(ROOT).as_posix()}:{getattr(node, 'lineno', 1)}"


def declared(extras: tuple[str, ...]) -> set[str]:
    """Normalized names of the distributions that the core and these extras ask for."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    requirements = list(project["dependencies"])
    for extra in extras:
        requirements += project["optional-dependencies"][extra]
        inner = [re.fullmatch(r"segar\[(.*)\]", one) for one in project["optional-dependencies"][extra]]
        requirements += [more for one in inner if one for name in one[1].split(",") for more in declared((name,))]
    return {normalized(re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0]) for requirement in requirements}


def normalized(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
