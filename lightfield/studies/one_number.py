"""Water whose scattering is one number: what a study asks for that changes it."""

from __future__ import annotations

from lightfield.errors import SceneError
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.bands import middles_nm
from lightfield.scene.parameters import fields_on, neutral_of
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.scene.water.water import Water

#: What scatters, unless it is at its neutral value, beside `water.scattering_per_m` and a base.
_SCATTERING = [
    name
    for name in fields_on(Water, Acts.SCATTERING)
    if name in neutral_of(Water) and name not in ("base", "scattering_per_m")
]


def refuse_several(
    scene: Scene, *, found: str, rule: str, where: str | None = None, otherwise: str = ""
) -> None:
    """Refuse water that scatters by more than `water.scattering_per_m`.

    Parameters
    ----------
    found, rule : str
        Of the error: what asks for one number, and why.
    where : str, optional
        The value that asks; by default that of the water.
    otherwise : str
        What can be done instead of stating the water by numbers.

    Raises
    ------
    SceneError
        Its remedy has the numbers of this water in the middle of its band.
    """
    water = scene.water
    held = {"base": f'"{water.base}"'} if water.base != "none" else {}
    held |= {name: f"{getattr(water, name):g}" for name in _SCATTERING if getattr(water, name)}
    if not held:
        return
    at = middles_nm(scene)[0].mean(keepdims=True)
    a, b = (float(f(water, at)[0]) for f in (absorption_per_m, scattering_per_m))
    raise SceneError(
        "the scattering of this water is not one number", where=where or f"water.{next(iter(held))}",
        found=f"{found} in water of {', '.join(f'{k} = {v}' for k, v in held.items())}", rule=rule,
        remedy=f"state the water by numbers, as it is at {at[0]:g} nm: [water] "
        f'base = "none", absorption_per_m = {a:.3g}, scattering_per_m = {b:.3g}, '
        f"and no more of what absorbs or scatters{otherwise}",
    )  # fmt: skip
