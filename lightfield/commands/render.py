"""`lightfield render`: trace a scene and write its maps as NetCDF, spectral EXR and PNG."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lightfield.commands.shared.options import add_option
from lightfield.commands.shared.tracing import add_tracing_arguments, as_text, traced
from lightfield.errors import UsageError
from lightfield.render.at_readings import render_positions
from lightfield.render.limits import MOST_WAVELENGTHS, check_wavelengths
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.scene.bands import refuse_unlit_wavelengths
from lightfield.storage.files import locked_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_option(parser, "scene")
    add_option(parser, "--output", "render", default=Path("render"))
    parser.add_argument(
        "--wavelengths",
        metavar="NM",
        help="comma-separated wavelengths, or from:to:step; default: one map per band of the detector",
    )
    parser.add_argument("--no-exr", action="store_true", help="write no EXR images")
    parser.add_argument("--no-figures", action="store_true", help="write no PNG figures")
    add_tracing_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Trace, write, list what was written."""
    wavelengths = None if args.wavelengths is None else wavelengths_of(args.wavelengths)
    scene = Scene.load(args.scene)
    if wavelengths is not None:
        refuse_unlit_wavelengths(scene, wavelengths, "--wavelengths")
    with locked_folder(args.output) as folder:
        return _render(scene, wavelengths, folder, args)


def _render(scene: Scene, wavelengths: np.ndarray | None, folder: Path, args: argparse.Namespace) -> int:
    from lightfield.maps.dataset import to_dataset, write_exr_planes, write_netcdf

    if scene.detector.positions_m is None:
        rendering = traced(scene, args, render_scene)
        dataset = to_dataset(rendering, wavelengths)
    else:
        places = traced(scene, args, render_positions)
        rendering, dataset = places.rendering, to_dataset(places, wavelengths)
    written = [write_netcdf(dataset, folder / "maps.nc")]
    planes = scene.detector.positions_m is None
    if not args.no_exr and planes:
        written += write_exr_planes(dataset, folder)
    if not args.no_figures and planes:
        from lightfield.report.light_figures import planes_figure
        from lightfield.report.style import save_png

        written.append(save_png(planes_figure(dataset), folder / "maps.png"))
    print(as_text(rendering))
    if not planes and not (args.no_exr and args.no_figures):
        print("single positions have no images: no EXR, no PNG")
    for path in written:
        print(path)
    if older := sorted(path.name for path in folder.glob("*.exr") if path not in written):
        print(f"of another render, not touched: {', '.join(older)}")
    return 0


def wavelengths_of(text: str) -> np.ndarray:
    """Wavelengths from `500,525,550` or `400:700:5` (end included), nm.

    Raises
    ------
    UsageError
        Not numbers, not rising, or outside 200 to 2000 nm.
    """
    try:
        if ":" in text:
            low, high, step = (float(part) for part in text.split(":"))
            if not step > 0:
                raise ValueError
            steps = np.floor((high - low) / step + 1e-9)
            found = low + step * np.arange(int(np.clip(steps, -1, MOST_WAVELENGTHS)) + 1)
        else:
            found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise UsageError(
            "not wavelengths",
            where="--wavelengths",
            found=text,
            rule="500,525,550 or from:to:step in nm",
            remedy="for example --wavelengths 500:550:5",
        ) from None
    check_wavelengths(found.tolist(), "--wavelengths", text)
    return found
