"""The Python package against the command line it installs and against itself."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest

import abbe
from abbe import _processor, _render, _toml

# what a shell starts in its background ignores interrupts, and so would Python
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).parents[2]
PRISM = ROOT / "scenes/prism.toml"
BALL = {
    "unit": "cm",
    "render": {"spp": 4},
    "sensor": [
        {
            "name": "main",
            "resolution": [48, 32],
            "perspective": {"eye": [0, 15, 40], "target": [0, 5, 0], "fov_deg": 40},
        }
    ],
    "medium": {"flint": {"glass": "schott:N-SF11"}},
    "material": {"clear": {"dielectric": {}}, "white": {"diffuse": {"reflectance": 0.7}}},
    "object": [
        {"name": "floor", "quad": {"center": [0, 0, 0], "u": [0, 0, 30], "v": [30, 0, 0]}, "material": "white"},
        {"name": "ball", "sphere": {"center": [0, 6, 0], "radius": 6}, "material": "clear", "interior": "flint"},
    ],
    "light": [{"environment": {"radiance": {"name": "D65", "luminance": 0.2}}}],
}


def command(*arguments: object, cwd: Path | None = None) -> str:
    program = Path(sys.executable).with_name("abbe")
    done = subprocess.run([program, *map(str, arguments)], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_images_have_the_bytes_of_the_command_line(tmp_path: Path) -> None:
    keys = {"sensor.0.resolution": [64, 16], "medium.flint.glass": "schott:N-SF6"}
    image = abbe.render(
        abbe.load(PRISM).set(keys), spp=4, seed=7, layers=["error", "albedo"], spectral=20, regularize="mis", threads=1
    )
    image.save(tmp_path / "python.exr")
    options = ["--spp", 4, "--seed", 7, "--aov", "error,albedo", "--spectral", 20, "--regularize", "mis", "-q"]
    sets = ["--set", "sensor.0.resolution=[64, 16]", "--set", "medium.flint.glass=schott:N-SF6"]
    command("render", PRISM, *options, *sets, "-o", tmp_path / "command.exr")
    for ending in ("exr", "spectral.exr"):
        ours, theirs = (tmp_path / f"{name}.{ending}" for name in ("python", "command"))
        assert ours.read_bytes() == theirs.read_bytes(), ending
    # the preview, too
    image.save(tmp_path / "python.png")
    assert (tmp_path / "python.png").read_bytes() == (tmp_path / "command.png").read_bytes()
    # and what is read again is what was written
    read = abbe.read(tmp_path / "command.exr")
    assert np.array_equal(read.xyz, image.xyz) and np.array_equal(read.layers["error"], image.layers["error"])
    assert read.attributes["sceneHash"] == image.attributes["sceneHash"]


def test_the_command_says_what_is_wrong() -> None:
    program = Path(sys.executable).with_name("abbe")
    done = subprocess.run([program, "render", "nowhere.toml"], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("error: nowhere.toml:"), done.stderr
    assert "abbe" in command("--version")


def test_dictionaries_are_scenes() -> None:
    scene = abbe.load(BALL)
    assert scene.sensors == [("main", 48, 32)]
    assert [effect.name for effect in scene.effects if effect.on] == ["dispersion", "absorption", "specular"]
    image = abbe.render(BALL)
    assert image.shape == (32, 48) and image.xyz.dtype == np.float32 and image.passes == 4
    assert np.array_equal(image.xyz, abbe.render(scene, spp=4).xyz)
    # other settings are another image, and do not stay with the scene
    path = abbe.render(scene, integrator="path")
    assert path.attributes["integrator"] == "path" and scene.keys_set == {}
    assert np.array_equal(image.xyz, abbe.render(scene).xyz)


def test_scenes_with_problems_name_them_and_change_nothing() -> None:
    with pytest.raises(abbe.SceneError, match="radius"):
        abbe.load({**BALL, "object": [{"sphere": {"center": [0, 0, 0], "radius": -1}, "material": "white"}]})
    scene = abbe.load(BALL)
    before = scene.hash
    with pytest.raises(abbe.SceneError, match="nothing"):
        scene.set("object.ball.material", "nothing")
    assert scene.hash == before and scene.keys_set == {}
    # two keys that are right only together
    scene.set({"medium.crown.glass": "schott:N-BK7", "object.ball.interior": "crown"})
    assert scene.hash != before and list(scene.keys_set) == ["medium.crown.glass", "object.ball.interior"]
    scene.set("object.ball.interior", "flint")
    assert list(scene.keys_set) == ["medium.crown.glass", "object.ball.interior"]
    for wrong in ({"sensor": "none"}, {"crop": (0, 0, 99, 9)}, {"layers": ["grain"]}, {"time": -1.0}, {"passes": (3, 3)}):
        with pytest.raises(ValueError):
            abbe.render(scene, **wrong)  # type: ignore[arg-type]
    with pytest.raises(abbe.SceneError, match="integrator"):
        abbe.render(scene, integrator="paht")


def test_options_are_keys_of_scenes() -> None:
    keys = json.loads(command("keys", "--json"))["definitions"]["render"]["properties"]
    for name, kind in get_type_hints(_render.Settings).items():
        assert name in keys, name
        choices = [value for part in (kind, *get_args(kind)) if get_origin(part) is Literal for value in get_args(part)]
        assert all(json.dumps(choice) in json.dumps(keys[name]) for choice in choices), (name, choices)
    assert {"spp", "seed", "passes", "layers"} <= _render._OWN and not _render._OWN & {"aim", "lanes"}


def test_values_become_toml() -> None:
    assert _toml.value({"a b": [1, 2.5, True], "p": Path("x")}) == '{ "a b" = [1, 2.5, true], "p" = "x" }'
    assert _toml.value(np.array([[1.0, 2.0]])) == "[[1.0, 2.0]]" and _toml.value(np.float32(0.5)) == "0.5"
    assert _toml.value('"\\\n\x7f\u00e9') == '"\\"\\\\\\n\\u007f\u00e9"'
    with pytest.raises(TypeError):
        _toml.value(object())


def test_passes_come_one_by_one() -> None:
    images = list(abbe.passes(BALL, spp=5, every=2))
    assert [image.passes for image in images] == [2, 4, 5]
    assert np.array_equal(images[-1].xyz, abbe.render(BALL, spp=5).xyz)
    assert images[0].stop is not None and images[-1].stop == "all passes done"
    # passes given by number add up to the whole, each half a mean of its own
    halves = [abbe.render(BALL, spp=4, passes=p).xyz.astype(float) for p in ((0, 2), (2, 4))]
    whole = abbe.render(BALL, spp=4).xyz
    assert np.allclose(0.5 * (halves[0] + halves[1]), whole, rtol=1e-5, atol=1e-7)


def test_threads_render_at_the_same_time() -> None:
    alone = [abbe.render(BALL, seed=seed).xyz for seed in range(2)]
    scene, together = abbe.load(BALL), [None, None]
    barrier = threading.Barrier(2)

    def work(seed: int) -> None:
        barrier.wait()
        together[seed] = abbe.render(scene, seed=seed).xyz

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(a, b) for a, b in zip(alone, together))


def test_the_interpreter_goes_on_meanwhile() -> None:
    """Another thread, which the render waits for: with the lock held this would never end."""
    began, answered = threading.Event(), threading.Event()

    def answer() -> None:
        began.wait()
        answered.set()

    threading.Thread(target=answer, daemon=True).start()

    def tell(*_: object) -> None:
        began.set()
        if answered.is_set():
            raise StopIteration

    with pytest.raises(StopIteration):
        abbe.render(BALL, spp=4_000_000, progress=tell)


def test_an_interrupt_keeps_the_passes() -> None:
    enough = threading.Event()

    def interrupt() -> None:
        enough.wait()
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()

    def tell(share: float | None, passes: int, error: float | None, seconds: float) -> None:
        assert share is not None and 0 <= share < 1 and seconds >= 0
        if passes >= 2:
            enough.set()

    image = abbe.render(BALL, spp=4_000_000, progress=tell)
    assert image.stop == "interrupted" and 2 <= image.passes < 4_000_000
    whole = abbe.render(BALL, passes=(0, image.passes), spp=4_000_000)
    assert np.array_equal(image.xyz, whole.xyz)


def test_an_interrupt_ends_a_generator_between_whole_passes() -> None:
    kept: list[abbe.Image] = []
    with pytest.raises(KeyboardInterrupt):
        for image in abbe.passes(BALL, spp=4_000_000):
            kept.append(image)
            if len(kept) == 2:
                signal.raise_signal(signal.SIGINT)
    assert [image.passes for image in kept] == [1, 2]


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_memory_does_not_grow() -> None:
    """An image here takes 0.6 MB: 150 of them that stay would be 88 MB."""
    script = f"""
import abbe, json
def resident():
    return next(int(l.split()[1]) for l in open("/proc/self/status") if l.startswith("VmRSS"))
scene = abbe.load({BALL!r})
scene.set("sensor.0.resolution", [256, 192])
for i in range(200):
    image = abbe.render(scene, spp=1, integrator="path", threads=1)
    image.xyz, image.develop()
    if i == 49:
        early = resident()
print(resident() - early)
"""
    grown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert int(grown.stdout) < 20_000, f"{grown.stdout} KiB more after 150 renders"


def test_spectra_and_lines_of_an_image() -> None:
    keys = {"sensor.0.resolution": [16, 12], "light.0.environment": {"radiance": {"lines": [[435.8, 1.0], [546.1, 2.0]]}}}
    image = abbe.render(abbe.load(BALL).set(keys), spp=2, spectral=10)
    assert image.line_wavelengths.tolist() == [435.8, 546.1] and image.lines.shape == (12, 16, 2)
    assert image.wavelengths.size == 10 and image.spectrum.shape == (12, 16, 10)
    assert image.lines.max() > 0 and image.spectrum.max() == 0
    plain = abbe.render(BALL, spp=1)
    assert plain.wavelengths.size == 0 and plain.lines.shape == (32, 48, 0)


def test_pictures_are_those_of_the_command(tmp_path: Path) -> None:
    image = abbe.render(BALL)
    image.save(tmp_path / "ball.exr")
    picture = image.develop(tone="agx", white="3200K", display="p3", depth=16, exposure=0.5)
    options = ["--tone", "agx", "--white", "3200K", "--display", "p3", "--depth", 16, "--exposure", 0.5, "-q"]
    command("develop", tmp_path / "ball.exr", *options, "-o", tmp_path / "ball.png")
    assert picture.png == (tmp_path / "ball.png").read_bytes()
    assert picture.pixels.shape == (32, 48, 3) and picture.pixels.dtype == np.uint16 and picture.stops == 0.5
    assert image._repr_png_() == image.develop().png and image.develop().pixels.dtype == np.uint8
    for wrong in ({"tone": "warm"}, {"display": "lcd"}, {"depth": 12}, {"white": "?"}, {"exposure": 1e9}):
        with pytest.raises(ValueError):
            image.develop(**wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError):
        image.save(tmp_path / "ball.jpg")
    command("develop", tmp_path / "ball.exr", "-q", "--at", "5,7", "-o", tmp_path / "ball.svg")
    figure = image.figure(title="ball.exr", at=(5, 7))
    assert figure.svg == figure._repr_svg_() == (tmp_path / "ball.svg").read_text("utf-8")
    with pytest.raises(ValueError, match="has no pixel 48,0"):
        image.figure(at=(48, 0))
    with pytest.raises(OSError):
        image.save(tmp_path / "nowhere" / "ball.exr")


def test_glasses() -> None:
    # Schott's data sheet: n_d 1.78472, V_d 25.68
    flint = abbe.glass("schott:N-SF11")
    assert abs(flint.n_d - 1.78472) < 5e-6 and abs(flint.abbe_number - 25.68) < 5e-3
    n = flint.n(np.array([[486.1327, 587.5618, 656.2725]]))
    assert n.shape == (1, 3) and n[0, 1] == flint.n_d
    assert abs((n[0, 1] - 1) / (n[0, 0] - n[0, 2]) - flint.abbe_number) < 1e-3
    assert isinstance(flint.n(500), float) and flint.k(500) >= 0 and flint.k([500.0, 600.0]).shape == (2,)
    assert flint.name in abbe.glasses() and flint.source and flint.range_nm is not None
    with pytest.raises(LookupError, match="N-SF11"):
        abbe.glass("N-SF1l")


def test_lenses_are_those_of_the_command() -> None:
    file = ROOT / "scenes/lenses/double_gauss.zmx"
    lens, told = abbe.lens(file), json.loads(command("lens", file, "--json"))
    for order in told["first_order"]:
        found = lens.first_order(order["wavelength_nm"])
        assert found["efl"] == order["efl"] and found["f_number"] == order["f_number"]
    spot = told["spots"][0]
    points = lens.spot(tuple(spot["field"]), spot["wavelength_nm"])
    assert points.shape == (spot["rays"], 2)
    rms = np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert abs(rms - spot["rms_image"]) < 1e-12
    for wrong in ({"nm": -1.0}, {"rings": 0}):
        with pytest.raises(ValueError):
            lens.spot(**wrong)  # type: ignore[arg-type]


def test_errors_are_those_of_the_command(tmp_path: Path) -> None:
    image, reference = abbe.render(BALL, spp=1), abbe.render(BALL, spp=16, seed=1)
    errors = abbe.compare(image, reference)
    a, b = image.xyz[..., 1].astype(float), reference.xyz[..., 1].astype(float)
    assert np.isclose(errors["Y"].rel_mse, ((a - b) ** 2 / (b**2 + 0.01)).mean())
    assert np.isclose(errors["Y"].mean_ratio, a.mean() / b.mean())
    image.save(tmp_path / "a.exr")
    reference.save(tmp_path / "b.exr")
    told = json.loads(command("compare", tmp_path / "a.exr", tmp_path / "b.exr", "--json"))
    assert json.dumps(errors["Y"].rmse) in json.dumps(told)
    with pytest.raises(ValueError):
        abbe.compare(image.xyz, reference.xyz[:5])
    with pytest.raises(ValueError):
        abbe.compare(image.xyz * np.nan, reference)


def test_denoised_images_say_so() -> None:
    pytest.importorskip("pyoidn")
    noisy, reference = abbe.render(BALL, spp=1, layers=["albedo", "normal"]), abbe.render(BALL, spp=256, seed=1)
    clean = abbe.denoise(noisy)
    assert "Open Image Denoise" in clean.attributes["denoised"] and "denoised" not in noisy.attributes
    errors = [abbe.compare(image, reference)["Y"].trimmed_rel_mse for image in (noisy, clean)]
    assert errors[1] < 0.5 * errors[0], errors
    with pytest.raises(ValueError, match="albedo"):
        abbe.denoise(reference)


def test_data_sets_of_xarray() -> None:
    pytest.importorskip("xarray")
    image = abbe.render(BALL, spp=1, crop=(4, 8, 20, 16), layers=["depth"], spectral=5)
    data = image.to_xarray()
    assert data.xyz.sel(channel="Y").shape == (8, 16) and data.depth.dims == ("y", "x")
    assert data.x.values[0] == 4 and data.y.values[-1] == 15 and data.spectrum.sizes["nm"] == 5


def test_old_processors_get_a_sentence() -> None:
    assert _processor.lacks_avx2({"sse4_2", "avx"}) and _processor.lacks_avx2({"avx2"})
    assert not _processor.lacks_avx2({"avx2", "fma", "sse4_2"}) and not _processor.lacks_avx2(set())
    script = (
        "import builtins, io\n"
        "real = builtins.open\n"
        "builtins.open = lambda p, *a, **k: io.StringIO('flags : sse2 avx') if p == '/proc/cpuinfo' else real(p, *a, **k)\n"
        "import abbe\n"
    )
    if sys.platform == "linux" and os.uname().machine == "x86_64":
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
        assert done.returncode == 1 and "AVX2" in done.stderr.splitlines()[-1], done.stderr


def test_types_are_right() -> None:
    pytest.importorskip("mypy")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull, str(ROOT / "src/python/abbe")],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout
