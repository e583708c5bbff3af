"""The light field of an underwater lamp: rendered, modelled, measured, explained.

    import lightfield as lf

    readings = lf.load("readings.csv")
    print(lf.diagnose(readings, "scene.toml"))

What stands in `PUBLIC` is public: it keeps its name and its arguments, as CHANGELOG.md promises. Everything
else is the inside of the library, and may change with any version. Names are looked up when they are first
used, so that the import itself costs nothing.
"""

from importlib import import_module

from lightfield.version import __version__ as __version__

TYPE_CHECKING = False  # as in typing, which takes milliseconds to import
if TYPE_CHECKING:
    from lightfield.api import array, pose
    from lightfield.api.attenuation import Attenuation, attenuation
    from lightfield.api.band import Band, band
    from lightfield.api.diagnosis import Diagnosis, Plan, Together, diagnose, plan
    from lightfield.api.following import Following, follow
    from lightfield.api.given import import_, load, save
    from lightfield.api.hide import Riddle, hide
    from lightfield.api.light.compare import Comparison, Fit, compare
    from lightfield.api.light.maps import Maps, render
    from lightfield.api.light.picture import Picture, picture
    from lightfield.api.link import Link, link
    from lightfield.api.regime import Regime, regime
    from lightfield.api.result import Result
    from lightfield.api.sweep import Sweep, sweep
    from lightfield.api.working_range import Range
    from lightfield.api.working_range import range as range
    from lightfield.errors import LightfieldError
    from lightfield.readings import Readings
    from lightfield.scene import Scene

#: Public names, and where each is defined.
PUBLIC = {
    "Scene": "scene", "Readings": "readings", "LightfieldError": "errors", "load": "api.given",
    "save": "api.given", "import_": "api.given",
    "render": "api.light.maps", "Maps": "api.light.maps",
    "compare": "api.light.compare", "Comparison": "api.light.compare", "Fit": "api.light.compare",
    "picture": "api.light.picture", "Picture": "api.light.picture",
    "hide": "api.hide", "Riddle": "api.hide",
    "diagnose": "api.diagnosis", "Diagnosis": "api.diagnosis",
    "plan": "api.diagnosis", "Plan": "api.diagnosis", "Together": "api.diagnosis",
    "sweep": "api.sweep", "Sweep": "api.sweep",
    "attenuation": "api.attenuation", "Attenuation": "api.attenuation",
    "band": "api.band", "Band": "api.band",
    "range": "api.working_range", "Range": "api.working_range",
    "link": "api.link", "Link": "api.link",
    "regime": "api.regime", "Regime": "api.regime",
    "array": "api", "pose": "api", "follow": "api.following", "Following": "api.following",
    "Result": "api.result",
}  # fmt: skip
# Not `range`: `from lightfield import *` would hide Python's own.
__all__ = [
    "Attenuation",
    "Band",
    "Comparison",
    "Diagnosis",
    "Fit",
    "Following",
    "LightfieldError",
    "Link",
    "Maps",
    "Picture",
    "Plan",
    "Range",
    "Readings",
    "Regime",
    "Result",
    "Riddle",
    "Scene",
    "Sweep",
    "Together",
    "array",
    "attenuation",
    "band",
    "compare",
    "diagnose",
    "follow",
    "hide",
    "import_",
    "link",
    "load",
    "picture",
    "plan",
    "pose",
    "regime",
    "render",
    "save",
    "sweep",
]


#: Public functions that share their name with a room of the library.
ROOMS = ("render", "sweep")


def __getattr__(name: str) -> object:
    if name not in PUBLIC:
        raise AttributeError(f"module 'lightfield' has no attribute {name!r}")
    if name in ROOMS:
        return import_module(f"{__name__}.{name}")
    place = f"{__name__}.{PUBLIC[name]}"
    if PUBLIC[name] == "api":
        return import_module(f"{place}.{name}")
    return getattr(import_module(place), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *PUBLIC])
