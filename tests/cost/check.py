"""Recomputes the errors of a report of `abbe cost` from its images: reads the folder, prints one JSON object per row of cost.csv.

Written against the definitions alone (relMSE = mean (I-R)^2/(R^2+0.01) of Y; the trimmed one without the worst 0.1 % of the
pixels; log-RMSE with 0.01 added and negative values cut; variance from the layer noise.Y)."""
import csv
import json
import pathlib
import sys

import numpy as np
import OpenEXR


def channel(path, name):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return file.channels()[name].pixels.astype(np.float64)


folder = pathlib.Path(sys.argv[1])
report = json.loads((folder / "cost.json").read_text())
reference = channel(folder / report["reference"]["image"], "Y")
weight = 1.0 / (reference**2 + 0.01)
for row in csv.DictReader((folder / "cost.csv").open()):
    image = channel(folder / row["image"], "Y")
    noise = channel(folder / row["image"], "noise.Y")
    terms = np.sort(((image - reference) ** 2 * weight).ravel())
    logs = np.log(np.maximum(image, 0) + 0.01) - np.log(np.maximum(reference, 0) + 0.01)
    print(json.dumps({
        "image": row["image"],
        "rel_mse": terms.mean(),
        "trimmed_rel_mse": terms[: len(terms) - int(0.001 * len(terms))].mean(),
        "log_rmse": np.sqrt((logs**2).mean()),
        "rel_variance": (noise**2 * weight).mean(),
        "mean_ratio": image.mean() / reference.mean(),
    }))
