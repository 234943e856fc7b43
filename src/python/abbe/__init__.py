"""abbe: a spectral renderer for dispersive glass, lenses and correct color.

>>> import abbe
>>> scene = abbe.load("scenes/prism.toml")
>>> scene.set("medium.flint.glass", "schott:N-BK7")
>>> image = abbe.render(scene, spp=16)
>>> image.xyz.shape, image.error
>>> image.save("prism.exr")

Lengths of scenes are in the unit of the scene; angles are radians or degrees as the key says;
wavelengths are vacuum wavelengths in nanometers. Images are CIE XYZ (1931, 2 degree): radiance of
cameras, irradiance of detectors; equal-energy light of 1 W/(m2 sr nm) has Y = 1.

Everything runs without the interpreter's lock. The same scene, settings, seed and passes give the
same values on any number of threads, and the same bytes as the command line.
"""

from . import _processor

_processor.check()

from ._abbe import Lens, SceneError, version
from ._denoise import denoise
from ._glass import Glass, glass, glasses
from ._image import Errors, Figure, Image, Picture, compare, read
from ._lens import lens
from ._render import passes, render
from ._scene import Effect, Scene, Sensor, load

__version__ = version()

__all__ = [
    "Effect",
    "Errors",
    "Figure",
    "Glass",
    "Image",
    "Lens",
    "Picture",
    "Scene",
    "SceneError",
    "Sensor",
    "compare",
    "denoise",
    "glass",
    "glasses",
    "lens",
    "load",
    "passes",
    "read",
    "render",
    "version",
]
