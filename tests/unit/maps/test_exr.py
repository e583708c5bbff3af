"""Spectral EXR: independent readers see the same numbers in the right place.

Layout: Fichet, Pacanowski & Wilkie (2021), JCGT 10(3). The pattern is asymmetric in x, in y and in
wavelength, so that any flip, transposition or mixed-up channel is noticed.
"""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from lightfield.errors import OutputError
from lightfield.maps.colour import colour_matching, linear_rgb
from lightfield.maps.dataset import to_dataset, write_exr_planes
from lightfield.maps.exr import (
    SpectralImage,
    channel_name,
    plane_names,
    read_spectral_exr,
    write_rgb_exr,
    write_spectral_exr,
)
from lightfield.render.picture import exposure, tone_mapped
from lightfield.report.compare.exr_layers import write_layers
from lightfield.scene import Scene
from lightfield.studies.compare.maps import compare

WAVELENGTHS = np.array([95.5, 500.0, 525.0, 1000.0])  # alphabetical order of the channels is another one
X, Y = np.array([-0.75, -0.25, 0.25, 0.75, 1.25]), np.array([-0.2, 0.0, 0.2])


def pattern() -> np.ndarray:
    """A number that tells its wavelength, row (upwards) and column (towards +x): 1, 0.1 and 0.01 per step."""
    k, j, i = np.meshgrid(np.arange(4), np.arange(3), np.arange(5), indexing="ij")
    return 1e-6 * (1 + k + 0.1 * j + 0.01 * i)


@pytest.fixture
def image():
    return SpectralImage(
        WAVELENGTHS, pattern(), 0.01 * pattern(), X, Y, 4.5,
        response={525.0: ([500.0, 550.0], [1.0, 1.0])},
        attributes={"quantity": "irradiance", "seed": 7, "photons": 3 * 10**9, "mc": 0.1},
    )  # fmt: skip


@pytest.fixture
def file(tmp_path, image):
    return write_spectral_exr(tmp_path / "plane.exr", image)


def test_planes_closer_than_a_millimetre_have_files_of_their_own():
    assert plane_names("irradiance", [4.5, 10.25]) == ["irradiance_z4.500m.exr", "irradiance_z10.250m.exr"]
    assert plane_names("x", [0.2001, 0.2004]) == ["x_z0.2001m.exr", "x_z0.2004m.exr"]


def test_channel_names_have_a_decimal_comma_and_six_decimals():
    assert channel_name(525) == "S0.525,000000nm"
    assert channel_name(95.5) == "S0.95,500000nm"


def test_own_reader_returns_what_was_written(file, image):
    back = read_spectral_exr(file)
    np.testing.assert_array_equal(back.wavelength_nm, WAVELENGTHS)
    np.testing.assert_array_equal(back.value, image.value.astype(np.float32))
    np.testing.assert_array_equal(back.stderr, image.stderr.astype(np.float32))
    np.testing.assert_allclose(back.x_m, X, rtol=0, atol=1e-12)
    np.testing.assert_allclose(back.y_m, Y, rtol=0, atol=1e-12)
    assert (back.z_m, back.units) == (4.5, "W.m^-2.nm^-1")
    assert back.response == {525.0: ([500.0, 550.0], [1.0, 1.0])}
    assert back.attributes == {"quantity": "irradiance", "seed": 7, "photons": "3000000000", "mc": 0.1}


def test_openexr_sees_the_top_row_first_and_the_layout_header(file):
    with OpenEXR.File(str(file), separate_channels=True) as opened:
        header, channels = dict(opened.header()), opened.channels()
        top_left = channels["S0.525,000000nm"].pixels[0, 0]
        bottom_right = channels["S0.525,000000nm"].pixels[-1, -1]
        assert channels["S0.525,000000nm"].pixels.dtype == np.float32
        assert channels["stderr.S0.525,000000nm"].pixels[0, 0] == np.float32(0.01 * 3.2e-6)
        assert {"R", "G", "B"} <= set(channels)
    assert top_left == np.float32(1e-6 * (1 + 2 + 0.2)), "top left is +y, -x"
    assert bottom_right == np.float32(1e-6 * (1 + 2 + 0.04)), "bottom right is -y, +x"
    assert header["spectralLayoutVersion"] == "1.0"
    assert header["emissiveUnits"] == "W.m^-2.nm^-1"
    assert header["pixelAspectRatio"] == pytest.approx(0.5 / 0.2)
    assert header["S0.525,000000nm"] == "500nm:1;550nm:1;"


def test_mitsuba_reads_the_same_numbers(file):
    # A process of its own: the variant of Mitsuba is global, and scalar_rgb needs no LLVM.
    code = (
        "import sys, json, mitsuba as mi, numpy as np; mi.set_variant('scalar_rgb');"
        "b = mi.Bitmap(sys.argv[1]);"
        "names = [f.name for f in b.struct_()]; a = np.array(b);"
        "print(json.dumps({n: a[:, :, i].tolist() for i, n in enumerate(names)}))"
    )
    run = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=True)
    channels = json.loads(run.stdout.splitlines()[-1])
    for index, wavelength in enumerate(WAVELENGTHS):
        expected = pattern()[index, ::-1].astype(np.float32)
        np.testing.assert_array_equal(np.float32(channels[channel_name(wavelength)]), expected)


def test_colour_science_reads_the_same_spectrum(file):
    pytest.importorskip("OpenImageIO", reason="colour-science reads EXR through OpenImageIO")
    colour = pytest.importorskip("colour")
    components, specification = colour.read_spectral_image_Fichet2021(str(file), additional_data=True)
    wavelengths, values = components["S0"]
    order = np.argsort(wavelengths)
    np.testing.assert_allclose(wavelengths[order], WAVELENGTHS)
    np.testing.assert_array_equal(
        np.moveaxis(values[:, :, order], -1, 0), pattern()[:, ::-1].astype(np.float32)
    )
    assert specification.is_emissive
    assert set(components) == {"S0"}, "error channels are no Stokes component"


def test_preview_shows_525_nm_green_and_keeps_the_orientation(tmp_path):
    value = np.zeros((1, 3, 5))
    value[0, 2, 4] = 2e-7  # top right
    path = write_spectral_exr(tmp_path / "p.exr", SpectralImage(np.array([525.0]), value, None, X, Y, 1.0))
    with OpenEXR.File(str(path)) as opened:
        rgb = opened.channels()["RGB"].pixels
    assert np.unravel_index(rgb.sum(axis=2).argmax(), (3, 5)) == (0, 4)
    assert rgb[0, 4].argmax() == 1
    assert rgb.max() == 1


def test_colour_matching_follows_the_cie_table():
    # CIE 1931 y at 555 nm = 1.000, x at 600 nm = 1.0622, z at 450 nm = 1.7721; the fits are good to 1 %.
    xyz = colour_matching(np.array([555.0, 600.0, 450.0]))
    np.testing.assert_allclose([xyz[0, 1], xyz[1, 0], xyz[2, 2]], [1.0, 1.0622, 1.7721], rtol=0.02)


def test_bands_in_another_order_have_the_same_colour():
    """Scenes may state their bands as they like: light of 450 to 620 nm that grows to the red is orange."""
    wavelength, value = np.array([450.0, 550.0, 620.0]), np.array([1.0, 2.0, 3.0])
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        rgb = linear_rgb(value[order], wavelength[order])
        assert rgb == pytest.approx(linear_rgb(value, wavelength))
        assert rgb[0] > rgb[1] > rgb[2] > 0


def test_unknown_error_stays_infinite_and_unknown_value_is_refused(tmp_path, image):
    endless = SpectralImage(WAVELENGTHS, pattern(), np.full((4, 3, 5), np.inf), X, Y, 1.0)
    assert np.isinf(read_spectral_exr(write_spectral_exr(tmp_path / "a.exr", endless)).stderr).all()
    broken = pattern()
    broken[1, 1, 1] = np.nan
    with pytest.raises(OutputError, match=r"b\.exr: value has 1 values"):
        write_spectral_exr(tmp_path / "b.exr", SpectralImage(WAVELENGTHS, broken, None, X, Y, 1.0))
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"], "nothing half-written stays"


@pytest.mark.parametrize("content", [b"", b"not an image", bytes.fromhex("762f3101") + bytes(40)])
def test_a_broken_file_is_one_clear_error(tmp_path, content):
    path = tmp_path / "broken.exr"
    path.write_bytes(content)
    with pytest.raises(OutputError, match=r"broken\.exr: cannot read this as an EXR image"):
        read_spectral_exr(path)


def test_an_ordinary_exr_is_not_taken_for_a_spectral_one(tmp_path):
    path = tmp_path / "rgb.exr"
    OpenEXR.File({}, {"RGB": np.zeros((2, 2, 3), "f")}).write(str(path))
    with pytest.raises(OutputError, match="not a spectral image"):
        read_spectral_exr(path)


def test_repeated_wavelength_and_wrong_shape_are_refused(tmp_path):
    with pytest.raises(OutputError, match="same wavelength"):
        write_spectral_exr(
            tmp_path / "a.exr", SpectralImage(np.array([5.0, 5.0]), pattern()[:2], None, X, Y, 1.0)
        )
    with pytest.raises(OutputError, match="wrong shape"):
        write_spectral_exr(tmp_path / "a.exr", SpectralImage(np.array([5.0]), pattern(), None, X, Y, 1.0))


def test_previews_say_their_scale_and_planes_share_one(tmp_path, make):
    """RGB x preview_scale and common RGB x common_scale are the same light, in sRGB's primaries."""
    dataset = to_dataset(make(pixels=9))
    files = write_exr_planes(dataset, tmp_path)
    peaks = []
    for file in files:
        with OpenEXR.File(str(file), separate_channels=True) as opened:
            header = dict(opened.header())
            channels = {name: channel.pixels for name, channel in opened.channels().items()}
        own = header["lightfield.preview_scale"][0] * np.array([channels[c] for c in "RGB"])
        shared = header["lightfield.common_scale"][0] * np.array([channels[f"common.{c}"] for c in "RGB"])
        np.testing.assert_allclose(own, shared, rtol=1e-5, atol=1e-6 * own.max())
        assert max(channels[c].max() for c in "RGB") == pytest.approx(1)
        assert header["chromaticities"][:2] == pytest.approx((0.64, 0.33))
        peaks.append(max(channels[f"common.{c}"].max() for c in "RGB"))
    assert max(peaks) == pytest.approx(1) and min(peaks) < 0.9  # far planes are darker


def header_of(file):
    with OpenEXR.File(str(file), separate_channels=True) as opened:
        return dict(opened.header())


def test_a_single_pixel_is_as_large_as_its_plane(tmp_path, make):
    """2 m wide and, in a tank of 1.2 m, 1.2 m high; it was said to be 1 m by 1 m."""
    one = to_dataset(make(pixels=1, planes=(4.5,)))
    (file,) = write_exr_planes(one, tmp_path / "one")
    assert header_of(file)["lightfield.pixel_size_m"].tolist() == [2.0, 2.0]
    scene = make(pixels=1).scene.model_dump(mode="json")
    scene["detector"]["width_m"] = None
    scene["tank"] = {"width_m": 3.0, "depth_m": 1.2, "lamp_depth_m": 0.6}
    one.attrs["scene_json"] = json.dumps(scene)
    (file,) = write_exr_planes(one, tmp_path / "tank")
    assert header_of(file)["lightfield.pixel_size_m"].tolist() == [2.0, 1.2]


def test_a_channel_states_the_response_that_weighed_its_band(tmp_path, make):
    """A filter whose table falls from 1 at 510 to a half at 530 nm, read 5 nm above the stated band."""
    table = tmp_path / "filter.csv"
    table.write_text("wavelength_nm,response\n400,3\n510,3\n530,1.5\n600,1.5\n", encoding="utf-8")
    values = {"detector__response_table": str(table), "detector__response": "table"}
    seen = to_dataset(make(pixels=3, planes=(4.5,), detector__wavelength_shift_nm=5.0, **values))
    (file,) = write_exr_planes(seen, tmp_path / "seen")
    stated = "505nm:1;510nm:1;530nm:0.5;555nm:0.5;"
    assert header_of(file)["S0.525,000000nm"] == stated
    assert read_spectral_exr(file).response == {525.0: ([505.0, 510.0, 530.0, 555.0], [1.0, 1.0, 0.5, 0.5])}
    table.unlink()
    (file,) = write_exr_planes(seen, tmp_path / "gone")
    assert "S0.525,000000nm" not in header_of(file)


def test_layers_of_a_comparison_are_what_was_compared(tmp_path, make, light):
    comparison = compare(
        to_dataset(make(pixels=9, glow=0.03)), lambda scene, x, y, z, wavelength: light(scene, x, y, z)
    )
    first, *_ = write_layers(comparison, tmp_path)
    plane = comparison.planes[0]
    with OpenEXR.File(str(first), separate_channels=True) as opened:
        header, channels = dict(opened.header()), opened.channels()
        found = {name: channel.pixels[::-1] for name, channel in channels.items()}
    nm = f"{plane.wavelength_nm:g}nm"
    np.testing.assert_array_equal(found[f"render.{nm}"], plane.render.astype(np.float32))
    np.testing.assert_array_equal(found[f"formula.{nm}"], plane.formula.astype(np.float32))
    error = found[f"formula.{nm}"] / found[f"render.{nm}"] - 1
    np.testing.assert_allclose(found[f"error.{nm}"], error, atol=1e-6)
    assert header["lightfield.plane_z_m"][0] == plane.z_m and header["lightfield.units"] == comparison.units
    size = plane.x_m[1] - plane.x_m[0], plane.y_m[1] - plane.y_m[0]
    assert header["lightfield.pixel_size_m"] == pytest.approx(size)
    assert header["lightfield.first_pixel_m"] == pytest.approx([plane.x_m[0], plane.y_m[-1]])
    assert header["pixelAspectRatio"] == pytest.approx(size[0] / size[1])
    assert header["lightfield.scene_digest"] == comparison.scene.digest()
    assert Scene.from_toml(header["lightfield.scene_toml"]) == comparison.scene


def test_a_picture_is_exposed_and_says_how(tmp_path):
    """Four fifths of the lit part lie below a quarter of white, however bright the render."""
    rgb = 1e-4 * np.random.default_rng(1).uniform(0, 1, (20, 30, 3))
    path = write_rgb_exr(rgb, exposure(rgb), tmp_path / "picture.png", ("lent",), {"orientation": "along"})
    with OpenEXR.File(str(path), separate_channels=True) as opened:
        header = dict(opened.header())
        shown = np.stack([opened.channels()[c].pixels for c in "RGB"], axis=-1)
    assert np.quantile(shown.max(axis=-1), 0.8) == pytest.approx(0.25, rel=1e-5)
    np.testing.assert_allclose(shown / header["lightfield.exposure"][0], rgb, rtol=1e-6)
    assert "relative radiance" in header["lightfield.units"] and header["comments"] == "lent"
    assert header["lightfield.orientation"] == "along"


@pytest.mark.parametrize("colour", range(3))
def test_the_light_of_a_coloured_lamp_keeps_its_shape_in_a_picture(colour):
    """Twenty times as bright as four fifths of the picture: not all one white, and never darker again."""
    rgb = np.zeros((20, 30, 3))
    rgb[..., colour] = np.geomspace(1e-6, 1e-2, 600).reshape(20, 30)
    rgb[..., colour] = np.minimum(rgb[..., colour], 20 * np.quantile(rgb[..., colour], 0.8))
    shown = tone_mapped(rgb).reshape(-1, 3).astype(int)
    assert (np.diff(shown, axis=0) >= 0).all()
    assert len(np.unique(shown[480:, colour])) > 50 and (shown[:480, colour] < 160).all()


def test_a_cropped_image_keeps_its_places(tmp_path, file, image):
    """As a compositor crops it: the data window begins elsewhere, the attributes stay."""
    with OpenEXR.File(str(file), separate_channels=True) as opened:
        header = dict(opened.header())
        channels = {name: channel.pixels[1:, 2:].copy() for name, channel in opened.channels().items()}
    header["dataWindow"] = (np.array([2, 1], np.int32), np.array([4, 2], np.int32))
    cropped = tmp_path / "cropped.exr"
    OpenEXR.File(header, channels).write(str(cropped))
    read = read_spectral_exr(cropped)
    np.testing.assert_allclose(read.x_m, X[2:])
    np.testing.assert_allclose(read.y_m, Y[:2], atol=1e-12)
    np.testing.assert_allclose(read.value, image.value[:, :2, 2:], rtol=1e-6)


def test_a_single_pixel_keeps_its_size(tmp_path, image):
    one = replace(
        image,
        value=image.value[:, :1, :1],
        stderr=None,
        x_m=np.zeros(1),
        y_m=np.zeros(1),
        plane_m=(1.31, 0.77),
    )
    read = read_spectral_exr(write_spectral_exr(tmp_path / "one.exr", one))
    assert read.plane_m == pytest.approx((1.31, 0.77))
    again = read_spectral_exr(write_spectral_exr(tmp_path / "again.exr", read))
    assert again.plane_m == pytest.approx((1.31, 0.77))
