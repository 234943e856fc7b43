"""Prints an OpenEXR image as the reference library reads it: JSON of header and channels."""
import json
import sys

import numpy as np
import OpenEXR


def plain(value):
    if isinstance(value, (tuple, list)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return value if isinstance(value, (int, float, str)) else str(value)


with OpenEXR.File(sys.argv[1], separate_channels=True) as file:
    header = {name: plain(value) for name, value in file.header().items() if name != "channels"}
    channels = {
        name: {"type": str(c.pixels.dtype), "shape": c.pixels.shape, "values": plain(c.pixels.astype(float).ravel())}
        for name, c in file.channels().items()
    }
print(json.dumps({"header": header, "channels": channels}))
