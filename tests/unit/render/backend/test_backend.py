"""The choice of the backend, on machines made up of environment variables and fake libraries."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from lightfield.errors import BackendError
from lightfield.render import backend
from lightfield.render.backend import cuda, llvm


@pytest.fixture(autouse=True)
def plain_machine(tmp_path, monkeypatch):
    """No wishes, no driver, no library: each test adds what its machine has."""
    for variable in (*llvm.EXPLICIT_VARIABLES, "LIGHTFIELD_BACKEND", "LIGHTFIELD_THREADS"):
        monkeypatch.delenv(variable, raising=False)
    (tmp_path / "libraries").mkdir()
    monkeypatch.setenv("LIGHTFIELD_LLVM_FOLDERS", str(tmp_path / "libraries"))
    monkeypatch.setenv("LIGHTFIELD_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("DRJIT_LIBCUDA_PATH", "/nonexistent/libcuda.so.1")
    cuda.cuda_problem.cache_clear()
    yield
    cuda.cuda_problem.cache_clear()


def add(tmp_path, major):
    name = f"libLLVM-{major}.so.1" if major < 18 else f"libLLVM.so.{major}.1"
    path = tmp_path / "libraries" / name
    machine = {"x86_64": 62, "aarch64": 183}.get(os.uname().machine, 62)
    path.write_bytes(
        b"\x7fELF\x02\x01\x01" + bytes(9) + b"\x03\x00" + machine.to_bytes(2, "little") + bytes(44)
    )
    return path


@pytest.fixture
def loads(monkeypatch):
    """Record which libraries would be loaded, and let each load well."""
    loaded = []
    monkeypatch.setattr(llvm, "load_problem", lambda library: loaded.append(library.path.name) or "")
    return loaded


def test_without_any_library_the_error_gives_the_command():
    with pytest.raises(BackendError, match="no usable libLLVM") as caught:
        backend.choose()
    assert "\n" not in str(caught.value)
    assert caught.value.remedy == llvm.install_command()


def test_old_libraries_are_named_and_never_loaded(tmp_path, loads):
    for major in (14, 15, 16):
        add(tmp_path, major)
    with pytest.raises(BackendError) as caught:
        backend.choose()
    for major in (14, 15, 16):
        assert f"libLLVM-{major}.so.1 is LLVM {major}" in str(caught.value)
    assert loads == []


def test_best_library_is_taken(tmp_path, loads):
    for major in (15, 19, 22, 17):
        add(tmp_path, major)
    chosen = backend.choose()
    assert (chosen.kind, chosen.variant, chosen.llvm_version) == ("llvm", "llvm_ad_spectral", "22.1")
    assert loads == ["libLLVM.so.22.1"]


def test_a_library_that_does_not_load_makes_room_for_the_next(tmp_path, monkeypatch):
    for major in (19, 22):
        add(tmp_path, major)
    broken = {"libLLVM.so.22.1": "cannot be loaded (libedit.so.2: no such file)"}
    monkeypatch.setattr(llvm, "load_problem", lambda library: broken.get(library.path.name, ""))
    assert backend.choose().llvm_version == "19.1"


@pytest.mark.parametrize("variable", llvm.EXPLICIT_VARIABLES)
@pytest.mark.parametrize("major", [14, 15, 16])
def test_an_old_library_named_by_the_user_is_refused(tmp_path, monkeypatch, loads, variable, major):
    add(tmp_path, 19)
    monkeypatch.setenv(variable, str(add(tmp_path, major)))
    with pytest.raises(BackendError, match=f"{variable}=.*is LLVM {major}, and LLVM before 17 aborts"):
        backend.choose()
    assert loads == []


def test_a_missing_library_named_by_the_user_is_refused(tmp_path, monkeypatch, loads):
    add(tmp_path, 19)
    monkeypatch.setenv("LIGHTFIELD_LIBLLVM", "/nonexistent/libLLVM.so")
    with pytest.raises(BackendError, match="does not exist"):
        backend.choose()


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("LIGHTFIELD_BACKEND", "metal"),
        ("LIGHTFIELD_THREADS", "0"),
        ("LIGHTFIELD_THREADS", "-1"),
        ("LIGHTFIELD_THREADS", "two"),
        ("LIGHTFIELD_THREADS", "1.5"),
        ("LIGHTFIELD_THREADS", "100000"),
    ],
)
def test_bad_wishes_are_refused(tmp_path, monkeypatch, loads, variable, value):
    add(tmp_path, 19)
    monkeypatch.setenv(variable, value)
    with pytest.raises(BackendError, match=variable):
        backend.choose()


def test_threads_can_be_set(tmp_path, monkeypatch, loads):
    add(tmp_path, 19)
    monkeypatch.setenv("LIGHTFIELD_THREADS", "3")
    assert backend.choose().threads == 3


def test_cuda_without_a_driver(tmp_path, monkeypatch, loads):
    add(tmp_path, 19)
    assert backend.choose().kind == "llvm"
    monkeypatch.setenv("LIGHTFIELD_BACKEND", "cuda")
    with pytest.raises(BackendError, match="no NVIDIA driver"):
        backend.choose()


def test_cuda_is_taken_where_the_trial_works_and_remembered(tmp_path, monkeypatch, loads):
    add(tmp_path, 19)
    (tmp_path / "driver").write_text("NVRM version: 570\n")
    trials = []
    monkeypatch.setattr(cuda, "_DRIVER", tmp_path / "driver")
    monkeypatch.setattr(cuda, "_driver_problem", lambda: "")
    monkeypatch.setattr(cuda, "trial_problem", lambda variant: trials.append(variant) or "")
    assert backend.choose().variant == "cuda_ad_spectral"
    cuda.cuda_problem.cache_clear()  # as a new process
    assert backend.choose().kind == "cuda"
    assert trials == ["cuda_ad_spectral"]
    (tmp_path / "driver").write_text("NVRM version: 575\n")
    cuda.cuda_problem.cache_clear()
    backend.choose()
    assert len(trials) == 2
    monkeypatch.setenv("LIGHTFIELD_BACKEND", "llvm")
    assert backend.choose().kind == "llvm"


def test_a_failing_gpu_is_passed_over(tmp_path, monkeypatch, loads):
    add(tmp_path, 19)
    monkeypatch.setattr(cuda, "_driver_problem", lambda: "")
    monkeypatch.setattr(cuda, "trial_problem", lambda variant: "the trial render failed (exit -6): OptiX")
    assert backend.choose().kind == "llvm"


def run_here(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python code in a process of its own with this machine's real libraries."""
    wishes = {"LIGHTFIELD_LLVM_FOLDERS", "DRJIT_LIBCUDA_PATH", "DRJIT_CACHE_DIR", "DRJIT_LIBLLVM_PATH"}
    plain = {name: value for name, value in os.environ.items() if name not in wishes}
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={**plain, "LIGHTFIELD_BACKEND": "llvm", **environment},
    )


def test_starting_twice_is_starting_once_and_a_foreign_variant_is_undone():
    child = run_here(
        "from lightfield.render.backend import use_backend\n"
        "first = use_backend()\n"
        "import mitsuba as mi, drjit as dr\n"
        "assert mi.variant() == first.variant == 'llvm_ad_spectral', mi.variant()\n"
        "assert '.'.join(map(str, dr.detail.llvm_version())) == first.llvm_version\n"
        "assert dr.thread_count() == first.threads == 1\n"
        "mi.set_variant('scalar_rgb')\n"
        "assert use_backend() is first and mi.variant() == first.variant\n"
        "mi.load_dict({'type': 'lightfield_lamp'})\n",  # our plugins are known to the variant again
        LIGHTFIELD_THREADS="1",
    )
    assert child.returncode == 0, child.stderr


def test_a_forked_process_is_told_so():
    """Dr.Jit's threads do not survive a fork; without the check the first render in the child hangs."""
    child = run_here(
        "import os\n"
        "from lightfield.errors import BackendError\n"
        "from lightfield.render.backend import use_backend\n"
        "use_backend()\n"
        "if os.fork() == 0:\n"
        "    try:\n"
        "        use_backend()\n"
        "    except BackendError as error:\n"
        "        os._exit(7 if 'spawn' in str(error) else 8)\n"
        "    os._exit(9)\n"
        "raise SystemExit(os.waitstatus_to_exitcode(os.wait()[1]))\n"
    )
    assert child.returncode == 7, child.stderr


@pytest.mark.parametrize("variable", llvm.EXPLICIT_VARIABLES)
def test_an_old_library_is_not_even_mapped_into_the_process(variable):
    """With a real LLVM 14-16 named by the user, where this machine has one."""
    old = [library for library in _system_libraries() if library.version < (17,)]
    if not old:
        pytest.skip("no LLVM 14-16 on this machine")
    child = run_here(
        "from lightfield.errors import BackendError\n"
        # Imports Mitsuba, which loads whatever library it is told.
        "from lightfield.render.tracer import walk\n"
        "from lightfield.render.backend import use_backend\n"
        "try:\n"
        "    use_backend()\n"
        "except BackendError as error:\n"
        "    assert 'libLLVM' not in open('/proc/self/maps').read()\n"
        f"    raise SystemExit(7 if {variable!r} in str(error) else 8)\n",
        **{variable: str(old[0].path)},
    )
    assert child.returncode == 7, child.stderr


def _system_libraries() -> list[llvm.Library]:
    wish = os.environ.pop("LIGHTFIELD_LLVM_FOLDERS", None)
    try:
        return [library for library in llvm.installed() if library.version]
    finally:
        if wish is not None:
            os.environ["LIGHTFIELD_LLVM_FOLDERS"] = wish


def test_the_trial_tells_a_working_variant_from_one_that_does_not_work(monkeypatch):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(_system_libraries()[0].path))
    assert cuda.trial_problem("llvm_ad_spectral") == ""
    assert "trial render failed" in cuda.trial_problem("no_such_variant")
