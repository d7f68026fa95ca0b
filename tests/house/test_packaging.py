"""What `pip` and `python -m build` make of the project: an install compiles nothing, an archive tests itself."""

import contextlib
import importlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PLACEHOLDER = "https://example.org/pwsmooth"
# Built or drawn, not packed, or large.
LEFT_OUT = (
    "__pycache__",
    "*.egg-info",
    "build",
    "_build",
    "auto",
    ".*_cache",
    ".git",
    ".venv",
    "*.json",
    "*.p[nd][gf]",
)


def ask_backend(project: Path, call: str) -> str:
    """What a call of the build backend gives in a process of its own, as a front end makes it."""
    program = f"import build_backend; print(build_backend.{call})"
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=project, env=environment, capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the project, without its largest data, for what a build writes beside the sources."""
    copy = tmp_path_factory.mktemp("packaging") / "pwsmooth"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*LEFT_OUT))
    return copy


def test_an_install_needs_no_compiler_and_the_compiled_wheel_does():
    assert ask_backend(ROOT, "get_requires_for_build_wheel()") == "[]"
    needed = ask_backend(ROOT, "get_requires_for_build_wheel({'core': 'compiled'})")
    assert "numba" in needed and "llvmlite" in needed


def test_a_core_that_is_not_known_is_refused_with_the_command():
    with pytest.raises(RuntimeError, match=r"`core` is 'fast'.*-C core=compiled"):
        ask_backend(ROOT, "get_requires_for_build_wheel({'core': 'fast'})")


def test_a_plain_wheel_serves_every_platform_and_has_the_modules_that_there_are(project, tmp_path):
    # A module that a later version lacks, as an earlier build left it.
    left = project / "build" / "lib" / "pwsmooth" / "of_an_earlier_version.py"
    left.parent.mkdir(parents=True)
    left.touch()
    wheel = tmp_path / ask_backend(project, f"build_wheel({str(tmp_path)!r})")
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if name.startswith("pwsmooth/")}
    package = ROOT / "pwsmooth"
    sources = {f"pwsmooth/{path.relative_to(package).as_posix()}" for path in package.rglob("*.py")}
    assert {name for name in packed if name.endswith(".py")} == sources
    static = {f"pwsmooth/explorer/static/{path.name}" for path in (package / "explorer/static").iterdir()}
    assert static and not static - packed
    assert not any("_compiled" in name for name in packed)


@pytest.mark.parametrize("left_out", [0, 1])
def test_the_core_is_compiled_at_every_level_and_a_missing_part_is_an_error(left_out, tmp_path, monkeypatch):
    """By a compiler that writes empty parts."""
    from pwsmooth.codegen.machine.objects import all_levels, level_settings
    from pwsmooth.codegen.machine.units import ALL

    monkeypatch.syspath_prepend(str(ROOT))
    backend = importlib.import_module("build_backend")
    levels = iter(all_levels())

    def compile_nothing(command, env, cwd, check):
        level, folder = next(levels), Path(env["PWSMOOTH_CACHE_DIR"]) / "kernels-0"
        assert env.items() >= level_settings(level).items() and check
        folder.mkdir(parents=True, exist_ok=True)
        for name in list(ALL)[left_out:]:
            (folder / f"{name}.{level}.o").touch()

    monkeypatch.setattr(backend.subprocess, "run", compile_nothing)
    with pytest.raises(RuntimeError, match="parts of the core") if left_out else contextlib.nullcontext():
        backend._compile_core(tmp_path)
    assert bool(list(levels)) == bool(left_out)
    assert (tmp_path / "pwsmooth" / "_compiled").is_dir()


def test_an_archive_of_the_sources_has_what_its_tests_read(project, tmp_path):
    archive = tmp_path / ask_backend(project, f"build_sdist({str(tmp_path)!r})")
    with tarfile.open(archive) as content:
        packed = {name.partition("/")[2] for name in content.getnames()}
    wanted = {"build_backend.py", ".ci/run", ".github/workflows/wheels.yml", "tests/house/test_packaging.py"}
    wanted |= {"docs/build.py", "experiments/bench_start.py", "paper_figures/statements.py", "CITATION.cff"}
    assert not wanted - packed


def test_the_recipe_of_conda_asks_for_what_pyproject_asks_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    recipe = yaml.safe_load((ROOT / ".ci/conda/recipe.yaml").read_text(encoding="utf-8"))
    declared, needs = project["project"], recipe["requirements"]
    assert recipe["context"]["version"] == declared["version"]
    # conda's matplotlib brings a window toolkit with it, matplotlib-base none.
    run = {need.replace("matplotlib-base", "matplotlib").replace(" ", "") for need in needs["run"]}
    assert run == {*declared["dependencies"], f"python{declared['requires-python']}"}
    assert {need.replace(" ", "") for need in needs["host"]} >= {*project["build-system"]["requires"]}
    assert recipe["build"]["python"]["entry_points"] == [f"pwsmooth = {declared['scripts']['pwsmooth']}"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == declared["version"] and cited["repository-code"] == declared["urls"]["Homepage"]


def test_the_address_is_one_placeholder_wherever_it_stands():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    assert {*declared.values()} == {PLACEHOLDER}
    for name in ("CITATION.cff", "README.md", "CONTRIBUTING.md", ".ci/conda/recipe.yaml"):
        addresses = re.findall(r"https?://[^\s)>\"'`#,]+", (ROOT / name).read_text(encoding="utf-8"))
        assert {*addresses} == {PLACEHOLDER}, name
