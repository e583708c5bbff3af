"""The table of the benchmarks as markdown."""

from __future__ import annotations

import datetime
import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any


def machine(backend: Any) -> dict[str, Any]:
    """What the figures were measured on."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": names[0] if names else platform.processor(), "cores": os.cpu_count(), 
        "threads": backend.threads,
        "backend": backend.kind, "llvm": backend.llvm_version, "python": platform.python_version(),
        "mitsuba": version("mitsuba"), "drjit": version("drjit"),
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
    }  # fmt: skip


def table(r: dict[str, Any]) -> str:
    """Every figure beside its aim."""
    m = r["machine"]
    rows = [*_stock(r), *_peer(r), _spectrum(r), *_evaluate(r), *_paper(r)]
    head = [
        "# Transport benchmarks",
        "",
        f"{m['processor']}, {m['cores']} cores, {m['threads']} threads; {m['backend']}, LLVM {m['llvm']}, "
        f"Mitsuba {m['mitsuba']}, Dr.Jit {m['drjit']}, Python {m['python']}; {m['date']}.",
        f"Load average at the start {r['load_before'][0]:.1f}. Above the number of cores other work slowed "
        "the wall-clock times; processor times compare then.",
        "",
        "| what | this package | peer | ratio (wall) | ratio (processor) | aim |",
        "|---|---|---|---|---|---|",
    ]
    return "\n".join([*head, *(f"| {' | '.join(row)} |" for row in rows), "", *_notes(r), ""])


def _times(wall: float, cpu: float) -> str:
    return f"{wall:,.1f} s wall, {cpu:,.1f} s processor"


def _stock(r: dict[str, Any]) -> list[list[str]]:
    total, rows = r["stock_total"], []
    for name, label in (("symmetric", "mirror images share photons"), ("plain", "every pixel on its own")):
        for key, which in (("every_pixel", "in every pixel"), ("95_percent", "in 95 % of the pixels")):
            wall, cpu = r[name][f"wall_{key}"], r[name][f"cpu_{key}"]
            rows.append(
                [f"(a) five 65 x 65 maps of scattered light, 2 % {which}; {label}", _times(wall, cpu),
                 "`volpath` + `irradiancemeter`: " + _times(total["wall"], total["cpu"]),
                 f"{total['wall'] / wall:,.0f}", f"{total['cpu'] / cpu:,.0f}", "1000"]
            )  # fmt: skip
    return rows


def _rate(v: dict[str, Any]) -> str:
    wall, cpu = (v["photons"] / v[kind] / 1e3 for kind in ("wall", "cpu"))
    return f"{wall:,.0f} thousand/s, {cpu:,.0f} thousand per processor second"


def _peer(r: dict[str, Any]) -> list[list[str]]:
    label = "(b) photons, tank 3.6 x 2.4 x 9 m, black walls"
    ours, runs = r["tank"], [r["mcx"], r["mcx_again"]]
    good = [run for run in runs if "problem" not in run]
    if not good:
        rows = [[label, _rate(ours), f"not measured: {runs[0]['problem']}", "", "", "30"]]
    else:
        # Run before and after ours: the load on the machine changes.
        peer = {key: sum(run[key] for run in good) for key in ("photons", "wall", "cpu")}
        ratios = [ours["photons"] / ours[k] / (peer["photons"] / peer[k]) for k in ("wall", "cpu")]
        rows = [[label, _rate(ours), f"`pmcxcl` on {good[0]['device']}: {_rate(peer)}",
                 *(f"{ratio:.1f}" for ratio in ratios), "30"]]  # fmt: skip
    return [*rows, ["photons, open water", _rate(r["open"]), "", "", "", ""]]


def _spectrum(r: dict[str, Any]) -> list[str]:
    s = r["spectrum"]
    cost = {k: (s["trace"][k] + s["sixty_one"][k]) / (s["trace"][k] + s["one"][k]) for k in ("wall", "cpu")}
    both = [f"{s['trace']['wall'] + s[name]['wall']:.1f} s" for name in ("sixty_one", "one")]
    return ["(c) 61 wavelengths, 400 to 700 nm", both[0], f"one wavelength: {both[1]}",
            f"{cost['wall']:.2f}", f"{cost['cpu']:.2f}", "below 1.5"]  # fmt: skip


def _evaluate(r: dict[str, Any]) -> list[list[str]]:
    rows = []
    for name, label in (
        ("evaluate", "every pixel on its own"),
        ("evaluate_symmetric", "mirror images shared"),
    ):
        e = r[name]
        rows.append([f"(d) `evaluate` of a new water, mean and error; {label}",
                     f"{e['median_ms']:.1f} ms (least {e['least_ms']:.1f}; scattered part alone "
                     f"{e['diffuse_median_ms']:.1f}; tally {e['megabytes']:.0f} MB)",
                     "", "", "", "below 20 ms"])  # fmt: skip
    return rows


def _paper(r: dict[str, Any]) -> list[list[str]]:
    p = r["paper_scene"]
    label = "(e) the paper's tank, walls and surface: peak memory"
    if "problem" in p:
        return [[label, f"not measured: {p['problem']}", "", "", "", "below 2 GiB"]]
    return [[label, f"{p['peak_gib']:.2f} GiB", "", "", "", "below 2 GiB"],
                ["the same: photons/s, error that 95 % of the pixels have",
                 f"{p['rate'] / 1e3:,.0f} thousand/s, {100 * p['reached']:.1f} % after "
                 f"{p['photons'] / 1e6:.0f} million",
                 "", "", "", ""]]  # fmt: skip


def _notes(r: dict[str, Any]) -> list[str]:
    ratios = ", ".join(f"{a['ratio']:.2f} +- {a['stderr']:.2f}" for a in r["agreement"])
    notes = [f"Scattered irradiance, stock over ours, at its 15 detectors: {ratios}."]
    good = [run for run in (r["mcx"], r["mcx_again"]) if "problem" not in run]
    if good:
        notes += ["", f"Share of the light that the tank's water absorbs: {r['tank']['absorbed']:.4f} here, "
                      f"{good[0]['absorbed']:.4f} by `pmcxcl`."]  # fmt: skip
    return notes
