"""The peer `pmcxcl` (MCX-CL, Fang and co-workers) on the same tank, in a virtual environment of its own.

Run as a script, it is the peer's process: it needs NumPy and pmcxcl only, and prints one line of JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

PACKAGES = ("pmcxcl>=0.7,<0.8", "numpy", "intel-opencl-rt", "intel-cmplr-lib-rt")
VOXEL_M = 0.05


def environment(folder: Path) -> Path:
    """Python of a virtual environment that has the peer."""
    python = folder / "bin" / "python"
    if not python.exists() or subprocess.run([python, "-c", "import pmcxcl"], capture_output=True).returncode:
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
    return python


def run(folder: Path, case: dict[str, Any]) -> dict[str, Any]:
    """Run the peer in its environment; {"problem": ...} when it cannot be had."""
    try:
        python = environment(folder)
    except (OSError, subprocess.CalledProcessError) as error:
        return {"problem": f"its environment could not be made: {error}"}
    runtime = [path for path in folder.glob("lib*/libintelocl.so*") if path.suffix != ".py"]
    env = dict(os.environ)
    if runtime:
        vendors = folder / "vendors"
        vendors.mkdir(exist_ok=True)
        (vendors / "intel.icd").write_text(f"{runtime[0]}\n")
        env["OCL_ICD_VENDORS"] = str(vendors)
    done = subprocess.run([python, __file__, json.dumps(case)], capture_output=True, text=True, env=env)
    try:
        return dict(json.loads(done.stdout.splitlines()[-1]))
    except (IndexError, ValueError):
        lines = (done.stderr + done.stdout).strip().splitlines() or ["no message"]
        return {"problem": f"pmcxcl did not run (it needs ocl-icd-libopencl1): {lines[-1]}"}


def main(case: dict[str, Any]) -> None:
    import numpy as np
    import pmcxcl

    mm = 1e3
    size = [round(case[name] / VOXEL_M) for name in ("width_m", "depth_m", "length_m")]
    # Zenith angles that share the beam's power evenly, in units of pi.
    u = np.linspace(0, 0.9999, 4001)
    angle = np.radians(case["hwhm_deg"]) * np.sqrt(-np.log(1 - u) / np.log(2))
    config = {
        "nphoton": case["photons"],
        "vol": np.ones(size, np.uint8),
        "prop": np.array([[0, 0, 1, 1], [case["a"] / mm, case["b"] / mm, case["g"], 1.0]]),
        "unitinmm": VOXEL_M * mm,
        "srcpos": [size[0] / 2, size[1] / 2, 0.0],
        "srcdir": [0.0, 0.0, 1.0],
        "srctype": "pencil",
        "angleinvcdf": angle / np.pi,
        "tstart": 0.0,
        "tend": 1e-6,
        "tstep": 1e-6,
        "isreflect": 0,
        "issrcfrom0": 1,
        "outputtype": "fluence",
        "seed": 1,
        "compileropt": "-cl-std=CL3.0",
    }
    pmcxcl.run(config)  # compiles
    clock = Clock()
    stats = [pmcxcl.run(config)["stat"] for _ in range(case["repeats"])]
    photons = case["photons"] * case["repeats"]
    print(json.dumps({
        "device": pmcxcl.gpuinfo()[0]["name"], "photons": photons,
        # Its own clock, of the kernel alone.
        "wall": sum(stat["runtime"] for stat in stats) * 1e-3, "cpu": clock.read()["cpu"],
        "absorbed": stats[0]["energyabs"] / stats[0]["energytot"],
    }))  # fmt: skip


if __name__ == "__main__":
    from clock import Clock

    main(json.loads(sys.argv[1]))
